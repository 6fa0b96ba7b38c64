"""Rotations of head and helmet in compiled code."""

from __future__ import annotations

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.vector import Quat, Vec


@inlined
def turned_by(q: Quat, spin: Vec, time: float) -> Quat:
    """A unit quaternion after a small turn: angular velocity [rad/s] in its own axes times [s]."""
    x, y, z = 0.5 * time * spin[0], 0.5 * time * spin[1], 0.5 * time * spin[2]
    a = q[0] - q[1] * x - q[2] * y - q[3] * z
    b = q[1] + q[0] * x + q[2] * z - q[3] * y
    c = q[2] + q[0] * y + q[3] * x - q[1] * z
    d = q[3] + q[0] * z + q[1] * y - q[2] * x
    size = 1.0 / (a * a + b * b + c * c + d * d) ** 0.5
    return a * size, b * size, c * size, d * size


@inlined
def times(a: Quat, b: Quat) -> Quat:
    """The product of two quaternions."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    )  # fmt: skip


@inlined
def conjugate(a: Quat) -> Quat:
    """The inverse of a unit quaternion."""
    return a[0], -a[1], -a[2], -a[3]


@compiled
def put(array: FloatArray, first: int, value: Vec) -> None:
    """Write three numbers."""
    for k in range(3):
        array[first + k] = value[k]
