"""Samples as serialised messages, many at once, for the log.

Every message of a channel is as long as the next, and only its stamp and its numbers change. So one
is serialised by the middleware, with numbers that tell where each of them lies, and the others are
copies of it with their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.nodes.conversion import CHANNELS, Channel, nanoseconds, stamp

#: Topic of simulation time.
CLOCK_TOPIC = "/clock"
#: A time [ns] whose seconds and nanoseconds occur nowhere else in a message.
_TELLING_TIME = 1_234_567_891 * 1_000_000_000 + 987_654_321
_SECOND = 1_000_000_000


class _Template(NamedTuple):
    """A serialised message, and where its stamp and its numbers lie."""

    raw: NDArray[np.uint8]
    stamp: int
    numbers: tuple[int, ...]


def serialised(record: ImpactRecord, start_time: float) -> Iterator[tuple[int, dict[str, bytes]]]:
    """Every sample of a record as simulation time [ns] and topic -> serialised message.

    A headform has no joints and so no ``joint_states``.

    Args:
        record: the samples.
        start_time: simulation time of the impact's start [s].
    """
    times = [nanoseconds(start_time, time) for time in record.time.tolist()]
    stamps = np.array([divmod(time, _SECOND) for time in times], dtype="<u4")
    topics: dict[str, list[bytes]] = {}
    for channel in CHANNELS:
        if channel.type is not JointState or record.joint_names:
            values = channel.values(record)
            template = _template(channel, record.joint_names, values.shape[1])
            topics[channel.topic] = _rows(template, stamps, values)
    topics[CLOCK_TOPIC] = _rows(_clock_template(), stamps, np.zeros((len(times), 0)))
    for i, time in enumerate(times):
        yield time, {topic: rows[i] for topic, rows in topics.items()}


def _rows(template: _Template, stamps: NDArray[np.uint32], values: FloatArray) -> list[bytes]:
    count, size = len(stamps), len(template.raw)
    table = np.empty((count, size), dtype=np.uint8)
    table[:] = template.raw
    table[:, template.stamp : template.stamp + 8] = stamps.view(np.uint8).reshape(count, 8)
    columns = np.ascontiguousarray(values.T, dtype="<f8")
    for place, column in zip(template.numbers, columns, strict=True):
        table[:, place : place + 8] = column.view(np.uint8).reshape(count, 8)
    raw = table.tobytes()
    return [raw[i : i + size] for i in range(0, count * size, size)]


@lru_cache(maxsize=1)
def _clock_template() -> _Template:
    return _located(serialize_message(Clock(clock=stamp(_TELLING_TIME))), ())


@lru_cache(maxsize=64)
def _template(channel: Channel, joints: tuple[str, ...], width: int) -> _Template:
    message = channel.message(joints)
    message.header.stamp = stamp(_TELLING_TIME)
    telling = [1.0 + (i + 1) / 4096.0 for i in range(width)]
    channel.fill(message, telling)
    return _located(serialize_message(message), tuple(telling))


def _located(raw: bytes, telling: tuple[float, ...]) -> _Template:
    seconds, rest = divmod(_TELLING_TIME, _SECOND)
    when = np.array([seconds, rest], dtype="<u4").tobytes()
    wanted = [when, *(np.float64(value).astype("<f8").tobytes() for value in telling)]
    places = [raw.find(value) for value in wanted]
    if min(places) < 0 or any(raw.count(value) != 1 for value in wanted):
        raise NodeError("a serialised message does not show where its numbers lie")
    return _Template(np.frombuffer(raw, dtype=np.uint8), places[0], tuple(places[1:]))
