"""Vectors of three numbers in compiled code: tuples live in registers and cost no allocation."""

from __future__ import annotations

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined

Vec = tuple[float, float, float]
#: A rotation matrix, row by row.
Mat = tuple[float, float, float, float, float, float, float, float, float]
#: A unit quaternion w, x, y, z.
Quat = tuple[float, float, float, float]


@inlined
def add(a: Vec, b: Vec) -> Vec:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def sub(a: Vec, b: Vec) -> Vec:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(a: Vec, factor: float) -> Vec:
    """factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def dot(a: Vec, b: Vec) -> float:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vec, b: Vec) -> Vec:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def norm(a: Vec) -> float:
    """|a|."""
    return float((a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) ** 0.5)


@inlined
def across(a: Vec, normal: Vec) -> Vec:
    """The part of a vector across a unit normal."""
    along = dot(a, normal)
    return (
        a[0] - along * normal[0], a[1] - along * normal[1], a[2] - along * normal[2]
    )  # fmt: skip


@inlined
def turned(rotation: Mat, a: Vec) -> Vec:
    """R a."""
    return (
        rotation[0] * a[0] + rotation[1] * a[1] + rotation[2] * a[2],
        rotation[3] * a[0] + rotation[4] * a[1] + rotation[5] * a[2],
        rotation[6] * a[0] + rotation[7] * a[1] + rotation[8] * a[2],
    )


@inlined
def turned_back(rotation: Mat, a: Vec) -> Vec:
    """R^T a."""
    return (
        rotation[0] * a[0] + rotation[3] * a[1] + rotation[6] * a[2],
        rotation[1] * a[0] + rotation[4] * a[1] + rotation[7] * a[2],
        rotation[2] * a[0] + rotation[5] * a[1] + rotation[8] * a[2],
    )


@inlined
def row(array: FloatArray, i: int) -> Vec:
    """Row i of an array of shape (n, 3)."""
    return array[i, 0], array[i, 1], array[i, 2]


@inlined
def row3(array: FloatArray, first: int) -> Vec:
    """Three numbers of a flat array, from ``first`` on."""
    return array[first], array[first + 1], array[first + 2]


@inlined
def matrix(array: FloatArray, i: int) -> Mat:
    """Row i of an array of shape (n, 9)."""
    return (
        array[i, 0], array[i, 1], array[i, 2], array[i, 3], array[i, 4], array[i, 5], array[i, 6],
        array[i, 7], array[i, 8],
    )  # fmt: skip


@inlined
def quaternion(array: FloatArray, first: int) -> Quat:
    """The four numbers of an array from the first on."""
    return array[first], array[first + 1], array[first + 2], array[first + 3]


@inlined
def matrix_of(q: Quat) -> Mat:
    """The rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@compiled
def write(to: FloatArray, values: FloatArray) -> None:
    """Copy numbers from one array to another, (n,): an assigned slice would make a third."""
    for k in range(len(to)):
        to[k] = values[k]
