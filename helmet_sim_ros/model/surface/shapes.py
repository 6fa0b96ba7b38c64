"""What helmet and body strike: convex shapes by signed distance and outward normal.

A rounded shape is a core (point, segment, box, cylinder, prism) and a radius: the distance to the
core less the radius. Outside a core that is the distance to its nearest point, inside it minus the
distance to its nearest face; so every distance is exact, convex and 1-Lipschitz, and the depth
grows on behind the rounding.

Shape axes: half space below z = 0; capsule and disc along z; wedge with its edge along x, crest at
the origin, faces down to both sides of y. All other shapes are centred on the origin.
"""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.surface.compiled import (
    BOX,
    CAPSULE,
    COSINE,
    DISC,
    ELLIPSOID,
    FIRST,
    HALF_SPACE,
    RADIUS,
    SECOND,
    SINE,
    SPHERE,
    THIRD,
    WEDGE,
    Size,
    Surface,
)
from helmet_sim_ros.model.surface.ellipsoid import ellipsoid_form

SHARPEST = 1e-9  # m, least radius of curvature that is reported
TINY = 1e-30  # m, nearer to a core's point or axis there is no direction away from it

#: Distance [m], outward normal (3), a unit tangent e (3), and the second derivatives [1/m] of the
#: distance along (e, e), (e, n x e), (n x e, n x e); all in shape axes.
Form = tuple[float, float, float, float, float, float, float, float, float, float]


@inlined  # a plane costs 1 ns instead of 30
def signed_distance(
    surface: Surface, i: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, float]:
    """Distance from a shape, and which way is out.

    Args:
        surface: compiled shapes.
        i: index of the shape.
        x, y, z: point, world axes [m].

    Returns:
        Distance [m], negative inside; outward unit normal x, y, z, world axes; sum of the two
        principal curvatures of the level surface through the point [1/m], positive where convex.
    """
    r, position = surface.rotation, surface.position
    r2, r5, r8 = r[i, 2], r[i, 5], r[i, 8]
    dx, dy, dz = x - position[i, 0], y - position[i, 1], z - position[i, 2]
    along = r2 * dx + r5 * dy + r8 * dz
    kind = surface.kind[i]
    if kind == HALF_SPACE:
        return along, r2, r5, r8, 0.0
    r0, r1, r3, r4, r6, r7 = r[i, 0], r[i, 1], r[i, 3], r[i, 4], r[i, 6], r[i, 7]
    d, nx, ny, nz, _, _, _, k1, _, k2 = local_form(
        kind, size_of(surface, i), r0 * dx + r3 * dy + r6 * dz, r1 * dx + r4 * dy + r7 * dz, along
    )
    return (
        d,
        r0 * nx + r1 * ny + r2 * nz,
        r3 * nx + r4 * ny + r5 * nz,
        r6 * nx + r7 * ny + r8 * nz,
        k1 + k2,
    )


@compiled
def nearest(
    surface: Surface, x: float, y: float, z: float
) -> tuple[int, float, float, float, float, float]:
    """Index of the shape with the least signed distance, then as :func:`signed_distance`."""
    best = 0
    d, nx, ny, nz, curvature = signed_distance(surface, 0, x, y, z)
    for i in range(1, len(surface.kind)):
        other = signed_distance(surface, i, x, y, z)
        if other[0] < d:
            best = i
            d, nx, ny, nz, curvature = other
    return best, d, nx, ny, nz, curvature


@inlined
def size_of(surface: Surface, i: int) -> Size:
    """The size row of a shape. As a tuple: arrays cost their counting of references."""
    s = surface.size
    return s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4]


@compiled
def local_form(kind: int, s: Size, x: float, y: float, z: float) -> Form:
    """The :data:`Form` of a shape of a kind and size at a point in shape axes [m]."""
    if kind == SPHERE:
        return _about_point(x, y, z, s[RADIUS], 0.0, 0.0, 1.0)
    if kind == CAPSULE:
        return _capsule(x, y, z, s[RADIUS], s[FIRST])
    if kind == BOX:
        return _box(x, y, z, s[RADIUS], s[FIRST], s[SECOND], s[THIRD])
    if kind == DISC:
        return _disc(x, y, z, s[RADIUS], s[FIRST], s[SECOND])
    if kind == WEDGE:
        return _wedge(x, y, z, s[RADIUS], s[FIRST], s[SECOND], s[SINE], s[COSINE])
    if kind == ELLIPSOID:
        return ellipsoid_form(x, y, z, s[FIRST], s[SECOND], s[THIRD])
    return z, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def tangent(nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """A unit vector across a unit vector."""
    if abs(nz) < 0.9:
        scale = 1.0 / (nx * nx + ny * ny) ** 0.5
        return -ny * scale, nx * scale, 0.0
    scale = 1.0 / (ny * ny + nz * nz) ** 0.5
    return 0.0, -nz * scale, ny * scale


@compiled
def _about_point(
    x: float, y: float, z: float, radius: float, ux: float, uy: float, uz: float
) -> Form:
    """A ball about the origin; u is the normal in its very middle."""
    rho = (x * x + y * y + z * z) ** 0.5
    nx, ny, nz = ux, uy, uz
    if rho > TINY:
        nx, ny, nz = x / rho, y / rho, z / rho
    k = 1.0 / max(rho, SHARPEST)
    ex, ey, ez = tangent(nx, ny, nz)
    return rho - radius, nx, ny, nz, ex, ey, ez, k, 0.0, k


@compiled
def _capsule(x: float, y: float, z: float, radius: float, half: float) -> Form:
    if abs(z) > half:
        return _about_point(x, y, z - (half if z > 0.0 else -half), radius, 1.0, 0.0, 0.0)
    rho = (x * x + y * y) ** 0.5
    nx, ny = 1.0, 0.0
    if rho > TINY:
        nx, ny = x / rho, y / rho
    k = 1.0 / max(rho, SHARPEST)
    return rho - radius, nx, ny, 0.0, -ny, nx, 0.0, k, 0.0, 0.0


@compiled
def _box(x: float, y: float, z: float, radius: float, hx: float, hy: float, hz: float) -> Form:
    sx = 1.0 if x >= 0.0 else -1.0
    sy = 1.0 if y >= 0.0 else -1.0
    sz = 1.0 if z >= 0.0 else -1.0
    qx, qy, qz = abs(x) - hx, abs(y) - hy, abs(z) - hz
    faces = (qx > TINY) + (qy > TINY) + (qz > TINY)
    if faces <= 1:  # in the core, or straight above a face
        if qz >= qx and qz >= qy:
            return qz - radius, 0.0, 0.0, sz, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if qy >= qx:
            return qy - radius, 0.0, sy, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return qx - radius, sx, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0
    qx = qx if qx > TINY else 0.0
    qy = qy if qy > TINY else 0.0
    qz = qz if qz > TINY else 0.0
    if faces == 3:
        return _about_point(sx * qx, sy * qy, sz * qz, radius, sx, 0.0, 0.0)
    rho = (qx * qx + qy * qy + qz * qz) ** 0.5
    k = 1.0 / max(rho, SHARPEST)
    nx, ny, nz = sx * qx / rho, sy * qy / rho, sz * qz / rho
    ex, ey, ez = 0.0, 0.0, 0.0  # along the edge
    if qx == 0.0:
        ex = 1.0
    elif qy == 0.0:
        ey = 1.0
    else:
        ez = 1.0
    return rho - radius, nx, ny, nz, ex, ey, ez, 0.0, 0.0, k


@compiled
def _disc(x: float, y: float, z: float, radius: float, core: float, half: float) -> Form:
    rho = (x * x + y * y) ** 0.5
    cx, cy = 1.0, 0.0
    if rho > TINY:
        cx, cy = x / rho, y / rho
    sz = 1.0 if z >= 0.0 else -1.0
    out, above = rho - core, abs(z) - half
    if out > TINY and above > TINY:
        q = (out * out + above * above) ** 0.5
        n = out / q
        around, k = n / max(rho, SHARPEST), 1.0 / max(q, SHARPEST)
        return q - radius, n * cx, n * cy, sz * above / q, -cy, cx, 0.0, around, 0.0, k
    if out > above:
        return out - radius, cx, cy, 0.0, -cy, cx, 0.0, 1.0 / max(rho, SHARPEST), 0.0, 0.0
    return above - radius, 0.0, 0.0, sz, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0


@compiled
def _wedge(
    x: float, y: float, z: float, radius: float, half: float, height: float, sine: float,
    cosine: float,
) -> Form:  # fmt: skip
    sx = 1.0 if x >= 0.0 else -1.0
    sy = 1.0 if y >= 0.0 else -1.0
    q, ny, nz, corner = _triangle(abs(y), z + radius, height, sine, cosine)
    end = abs(x) - half
    if q <= TINY or end <= TINY:
        if end > q:
            return end - radius, sx, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0
        k = 1.0 / max(q, SHARPEST) if corner else 0.0
        return q - radius, 0.0, sy * ny, nz, 1.0, 0.0, 0.0, 0.0, 0.0, k
    rho = (q * q + end * end) ** 0.5
    k = 1.0 / max(rho, SHARPEST)
    share = q / rho
    along = k if corner else 0.0  # the edge between a face and an end is straight
    return (
        rho - radius, sx * end / rho, share * sy * ny, share * nz,
        0.0, -nz, sy * ny, along, 0.0, k,
    )  # fmt: skip


@compiled
def _triangle(
    y: float, z: float, height: float, sine: float, cosine: float
) -> tuple[float, float, float, bool]:
    """Distance from a wedge's cross-section (y >= 0, tip at the origin), normal, at a corner?"""
    face = cosine * y + sine * z
    base = -z - height
    if face <= 0.0 and base <= 0.0:
        if face >= base:
            return face, cosine, sine, False
        return base, 0.0, -1.0, False
    along = sine * y - cosine * z
    if face > 0.0 and 0.0 <= along <= height / cosine:
        return face, cosine, sine, False
    width = height * sine / cosine
    if base > 0.0 and y <= width:
        return base, 0.0, -1.0, False
    if along > 0.0:  # foot of the face
        y -= width
        z += height
    q = (y * y + z * z) ** 0.5
    if q <= TINY:
        return q, cosine, sine, True
    return q, y / q, z / q, True
