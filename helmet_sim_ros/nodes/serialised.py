"""Samples and scenes as serialised messages, for the log.

Every message of a channel is as long as the next, and only its stamps and its numbers change. So
one is serialised by the middleware, with numbers that tell where each of them lies, and the others
are copies of it with their own.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.nodes.conversion import CHANNELS, Channel, nanoseconds, stamp
from helmet_sim_ros.nodes.scene_markers import SceneMarkers

Bytes = NDArray[np.uint8]

#: Topic of simulation time.
CLOCK_TOPIC = "/clock"
#: A time [ns] whose seconds and nanoseconds occur nowhere else in a message.
_TELLING_TIME = 1_234_567_891 * 1_000_000_000 + 987_654_321
_SECOND = 1_000_000_000


class _Template(NamedTuple):
    """A serialised message, and the places of all bytes of its stamps and of its numbers."""

    raw: Bytes
    stamps: NDArray[np.intp]
    numbers: NDArray[np.intp]

    def filled(self, times: NDArray[np.int64], values: FloatArray) -> Bytes:
        """A message for each time [ns], (n,), with its row of numbers, (n, k): (n, size) bytes."""
        table = np.tile(self.raw, (len(times), 1))
        when = np.stack(np.divmod(times, _SECOND), axis=1).astype("<u4").view(np.uint8)
        table[:, self.stamps] = np.tile(when, len(self.stamps) // 8)
        table[:, self.numbers] = np.ascontiguousarray(values, dtype="<f8").view(np.uint8)
        return table


def serialised(
    record: ImpactRecord, start_time: float
) -> tuple[NDArray[np.int64], dict[str, Bytes]]:
    """Every sample of a record: simulation times (n,) [ns], and topic -> its serialised messages,
    (n, size of one) bytes.

    A headform has no joints and so no ``joint_states``.

    Args:
        record: the samples.
        start_time: simulation time of the impact's start [s].
    """
    times = np.array([nanoseconds(start_time, time) for time in record.time.tolist()])
    topics: dict[str, Bytes] = {}
    for channel in CHANNELS:
        if channel.type is not JointState or record.joint_names:
            values = channel.values(record)
            template = _template(channel, record.joint_names, values.shape[1])
            topics[channel.topic] = template.filled(times, values)
    topics[CLOCK_TOPIC] = _clock_template().filled(times, np.empty((len(times), 0)))
    return times, topics


class SerialisedScene:
    """The markers of one setup as serialised messages."""

    def __init__(self, markers: SceneMarkers) -> None:
        self._markers = markers
        self._templates: dict[tuple[bool, ...], _Template] = {}  # by the arrows that are there

    def message(self, record: ImpactRecord, index: int, time_ns: int) -> bytes:
        """The scene at one sample."""
        values, visible = self._markers.values(record, index)
        if visible not in self._templates:
            telling = _telling(len(values))
            message = self._markers.filled(telling, visible, _TELLING_TIME)
            self._templates[visible] = _located(message, telling, len(message.markers))
        template = self._templates[visible]
        return template.filled(np.array([time_ns]), values[None]).tobytes()


@lru_cache(maxsize=1)
def _clock_template() -> _Template:
    return _located(Clock(clock=stamp(_TELLING_TIME)), _telling(0))


@lru_cache(maxsize=64)
def _template(channel: Channel, joints: tuple[str, ...], width: int) -> _Template:
    message = channel.message(joints)
    message.header.stamp = stamp(_TELLING_TIME)
    telling = _telling(width)
    channel.fill(message, telling.tolist())
    return _located(message, telling)


def _telling(count: int) -> FloatArray:
    """Numbers that occur nowhere else: roots that are not rational."""
    roots: FloatArray = np.sqrt(np.arange(count) + 1.5)
    return roots


def _located(message: Any, telling: FloatArray, stamps: int = 1) -> _Template:
    """The template of a message that holds the telling time so many times and every telling number
    once."""
    raw = np.frombuffer(serialize_message(message), dtype=np.uint8)
    there = np.ascontiguousarray(sliding_window_view(raw, 8)).view("<u8").ravel()
    seconds, rest = divmod(_TELLING_TIME, _SECOND)
    times = np.flatnonzero(there == seconds + (rest << 32))
    wanted = telling.astype("<f8").view("<u8")  # ascending, as roots are
    numbers = np.flatnonzero(np.isin(there, wanted))
    numbers = numbers[np.argsort(there[numbers])]
    if len(times) != stamps or not np.array_equal(there[numbers], wanted):
        raise NodeError("a serialised message does not show where its numbers lie")
    return _Template(raw, _bytes_at(times), _bytes_at(numbers))


def _bytes_at(places: NDArray[np.intp]) -> NDArray[np.intp]:
    """The places of all eight bytes of what begins at some places."""
    return (places[:, None] + np.arange(8)).ravel()
