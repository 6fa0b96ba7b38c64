"""How far a point inside a shape is from its surface along a given direction."""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.surface.compiled import HALF_SPACE, Surface
from helmet_sim_ros.model.surface.shapes import signed_distance

STEPS = 100
CLOSE = 1e-13  # m, from the surface
ENDLESS = 1e6  # m, where a direction does not lead out
GRAZING = 1e-9  # least cosine to the normal that still leads out


@compiled
def depth_along(
    surface: Surface, i: int, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, float, float, float]:
    """Way out of a shape along a direction: the depth of a column that is crushed along it.

    Unlike the distance to the nearest face it keeps growing where a thin shape (a plate, a bar)
    goes deep into the helmet. The distance is convex along the line: Newton's method, and steps of
    the distance itself while it does not grow yet.

    Args:
        surface: compiled shapes.
        i: index of the shape.
        x, y, z: point, world axes [m].
        dx, dy, dz: unit vector, world axes.

    Returns:
        Length [m], 0 outside, ``ENDLESS`` where there is no way out; outward normal where the line
        leaves the shape, world axes.
    """
    d, nx, ny, nz, _ = signed_distance(surface, i, x, y, z)
    if d >= 0.0:
        return 0.0, nx, ny, nz
    if surface.kind[i] == HALF_SPACE:
        slope = nx * dx + ny * dy + nz * dz
        if slope <= GRAZING:
            return ENDLESS, nx, ny, nz
        return -d / slope, nx, ny, nz
    way = 0.0
    for _ in range(STEPS):
        slope = nx * dx + ny * dy + nz * dz
        way += abs(d) if slope <= GRAZING else -d / slope
        d, nx, ny, nz, _ = signed_distance(
            surface, i, x + way * dx, y + way * dy, z + way * dz
        )  # fmt: skip
        if abs(d) <= CLOSE:
            return way, nx, ny, nz
    return way, nx, ny, nz
