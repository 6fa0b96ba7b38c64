"""The lowest point of the greatest of a few planes over the unit sphere, in closed form."""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled

Vector = tuple[float, float, float]

#: Gradient (3) and value at the origin.
Plane = tuple[float, float, float, float]
Planes = tuple[Plane, Plane, Plane, Plane]

PARALLEL = 1e-24  # least squared length of a difference of gradients that defines a crease


@compiled
def lowest_of_planes(planes: Planes, near: Vector) -> tuple[float, Vector, tuple[int, int, int]]:
    """Least value of max_k (g_k . u + b_k) over |u| = 1, where, and the planes that meet there.

    The least lies where one plane alone is lowest, where two meet (a circle) or where three meet
    (two points): all such points are looked at.

    Args:
        planes: the four planes, equal ones allowed.
        near: unit vector; where a whole circle is equally low, its point on this side is taken.
    """
    best = 1e300
    where = (0.0, 0.0, 1.0)
    kept = (0, 0, 0)
    for i in range(4):
        for j in range(i, 4):
            for k in range(j, 4):
                if i == j and j != k:  # a pair is written i, k, k
                    continue
                for sign in (-1.0, 1.0):
                    if sign > 0.0 and j == k:
                        continue
                    found, u = _meeting(planes[i], planes[j], planes[k], i == j, j == k, sign, near)
                    if not found:
                        continue
                    value = _greatest(planes, u)
                    if value < best:
                        best, where, kept = value, u, (i, j, k)
    return best, where, kept


@compiled
def _greatest(planes: Planes, u: Vector) -> float:
    value = -1e300
    for k in range(4):
        g = planes[k]
        value = max(value, g[0] * u[0] + g[1] * u[1] + g[2] * u[2] + g[3])
    return value


@compiled
def _meeting(
    p: Plane, q: Plane, r: Plane, single: bool, pair: bool, sign: float, near: Vector
) -> tuple[bool, Vector]:
    """The lowest point of p on the unit sphere, of p and q where they meet, or of three."""
    none = (False, (0.0, 0.0, 1.0))
    if single:
        scale = -1.0 / (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) ** 0.5
        return True, (p[0] * scale, p[1] * scale, p[2] * scale)
    ax, ay, az, a = p[0] - q[0], p[1] - q[1], p[2] - q[2], q[3] - p[3]  # (ax, ay, az) . u = a
    if pair:
        square = ax * ax + ay * ay + az * az
        if square < PARALLEL:
            return none
        shift = a / square
        along = (p[0] * ax + p[1] * ay + p[2] * az) / square
        dx, dy, dz = along * ax - p[0], along * ay - p[1], along * az - p[2]
        if dx * dx + dy * dy + dz * dz < PARALLEL:  # opposite faces: level all along the crease
            along = (near[0] * ax + near[1] * ay + near[2] * az) / square
            dx, dy, dz = near[0] - along * ax, near[1] - along * ay, near[2] - along * az
    else:
        bx, by, bz, b = p[0] - r[0], p[1] - r[1], p[2] - r[2], r[3] - p[3]
        dx, dy, dz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = dx * dx + dy * dy + dz * dz
    if length < PARALLEL:
        return none
    if pair:
        mx, my, mz = shift * ax, shift * ay, shift * az
    else:
        mx = (a * (by * dz - bz * dy) + b * (dy * az - dz * ay)) / length
        my = (a * (bz * dx - bx * dz) + b * (dz * ax - dx * az)) / length
        mz = (a * (bx * dy - by * dx) + b * (dx * ay - dy * ax)) / length
    rest = 1.0 - (mx * mx + my * my + mz * mz)
    if rest < 0.0:
        return none
    scale = sign * (rest / length) ** 0.5
    if pair:
        scale = abs(scale)
    return True, (mx + scale * dx, my + scale * dy, mz + scale * dz)
