"""Samples as standard ROS messages: one table of topics for the live view and for the log.

Frames: ``world`` has z up and the ground at z = 0; ``head`` has its origin at the head's centre of
gravity, x forward, y left, z up; ``helmet`` coincides with it while the coupling is not compressed;
``neck`` has its origin at the head-neck joint and the axes of ``head``.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import Imu, JointState

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.biomech.rotation import turned_back

Row = list[float]


@dataclass(frozen=True)
class Channel:
    """One topic that carries one message per sample.

    Attributes:
        topic: relative name.
        type: message class.
        frame: frame id of its header.
        values: what it takes from a record, shape (n, k).
        fill: writes one row of these values into a message.
    """

    topic: str
    type: type
    frame: str
    values: Callable[[ImpactRecord], FloatArray]
    fill: Callable[[Any, Row], None]

    @property
    def type_name(self) -> str:
        """Full type name, ``geometry_msgs/msg/AccelStamped``."""
        package = self.type.__module__.split(".", 1)[0]
        return f"{package}/msg/{self.type.__name__}"

    def message(self, joints: tuple[str, ...]) -> Any:
        """An empty message to fill for samples of a body with these joints."""
        message = self.type()
        message.header.frame_id = self.frame
        if self.type is JointState:
            message.name = list(joints)
            # Not computed. Left empty, the serialised message would end in stray bytes (Fast CDR
            # aligns a last, empty sequence of doubles), which strict readers of a log refuse.
            message.effort = array("d", [math.nan] * len(joints))
        return message


def _vector(target: Any, x: float, y: float, z: float) -> None:
    target.x, target.y, target.z = x, y, z


def _orientation(target: Any, x: float, y: float, z: float, w: float) -> None:
    target.x, target.y, target.z, target.w = x, y, z, w


def _accel(message: AccelStamped, row: Row) -> None:
    _vector(message.accel.linear, *row[:3])
    _vector(message.accel.angular, *row[3:])


def _twist(message: TwistStamped, row: Row) -> None:
    _vector(message.twist.linear, *row[:3])
    _vector(message.twist.angular, *row[3:])


def _pose(message: PoseStamped, row: Row) -> None:
    _vector(message.pose.position, *row[:3])
    _orientation(message.pose.orientation, *row[3:])


def _wrench(message: WrenchStamped, row: Row) -> None:
    _vector(message.wrench.force, *row[:3])
    _vector(message.wrench.torque, *row[3:])


def _imu(message: Imu, row: Row) -> None:
    _vector(message.linear_acceleration, *row[:3])
    _vector(message.angular_velocity, *row[3:6])
    _orientation(message.orientation, *row[6:])


def _joints(message: JointState, row: Row) -> None:
    half = len(row) // 2
    message.position = array("d", row[:half])
    message.velocity = array("d", row[half:])


def _imu_values(record: ImpactRecord) -> FloatArray:
    """Specific force and angular velocity in head axes, and the orientation (REP-145).

    Specific force is the inertial acceleration less gravity: +g upwards at rest, 0 in free fall.
    """
    turn = record.head_orientation
    amount = record.setup.get("impact.gravity", record.setup.get("fall.gravity"))
    gravity = np.array([0.0, 0.0, -float(amount)])
    return np.hstack(
        [
            turned_back(record.head_acceleration - gravity, turn),
            turned_back(record.head_angular_velocity, turn),
            turn,
        ]
    )


#: Every topic with one message per sample.
CHANNELS = (
    Channel(
        "head/acceleration", AccelStamped, "world",
        lambda r: np.hstack([r.head_acceleration, r.head_angular_acceleration]), _accel,
    ),
    Channel(
        "head/velocity", TwistStamped, "world",
        lambda r: np.hstack([r.head_velocity, r.head_angular_velocity]), _twist,
    ),
    Channel(
        "head/pose", PoseStamped, "world",
        lambda r: np.hstack([r.head_position, r.head_orientation]), _pose,
    ),
    Channel("head/imu", Imu, "head", _imu_values, _imu),
    Channel(
        "helmet/pose", PoseStamped, "world",
        lambda r: np.hstack([r.helmet_position, r.helmet_orientation]), _pose,
    ),
    Channel(
        "helmet/ground_contact", WrenchStamped, "world",
        lambda r: np.hstack([r.ground_force, r.ground_torque]), _wrench,
    ),
    Channel(
        "helmet/coupling", WrenchStamped, "head",
        lambda r: np.hstack([r.coupling_force, r.coupling_torque]), _wrench,
    ),
    Channel(
        "neck/load", WrenchStamped, "neck",
        lambda r: np.hstack([r.neck_force, r.neck_torque]), _wrench,
    ),
    Channel(
        "joint_states", JointState, "",
        lambda r: np.hstack([r.joint_positions, r.joint_velocities]), _joints,
    ),
)  # fmt: skip


def nanoseconds(start_time: float, time: float) -> int:
    """The simulation time of a sample [ns]: start of the impact plus time in it, both [s]."""
    return round(start_time * 1e9) + round(time * 1e9)


def stamp(time_ns: int) -> Time:
    """A ROS time of nanoseconds."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def messages(
    record: ImpactRecord, start_time: float, channels: tuple[Channel, ...] = CHANNELS
) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Every sample of a record as simulation time [ns] and topic -> message.

    The messages are the same objects for every sample: use them before the next one. A headform has
    no joints and so no ``joint_states``.
    """
    channels = tuple(c for c in channels if c.type is not JointState or record.joint_names)
    filled = {channel.topic: channel.message(record.joint_names) for channel in channels}
    parts = [
        (channel.fill, filled[channel.topic], channel.values(record).tolist())
        for channel in channels
    ]
    for i, time in enumerate(record.time.tolist()):
        time_ns = nanoseconds(start_time, time)
        now = stamp(time_ns)
        for fill, message, rows in parts:
            fill(message, rows[i])
            message.header.stamp = now
        yield time_ns, filled
