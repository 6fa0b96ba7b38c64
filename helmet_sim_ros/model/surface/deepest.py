"""How deep an ellipsoid is in a shape, and where: the least distance over its surface."""

from __future__ import annotations

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.surface.compiled import (
    CAPSULE,
    FIRST,
    HALF_SPACE,
    RADIUS,
    Size,
    Surface,
)
from helmet_sim_ros.model.surface.cutting import Plane, lowest_of_planes
from helmet_sim_ros.model.surface.shapes import Form, local_form, size_of, tangent

#: Newton ends with the step that promises less than this [m]; being of second order, the step
#: leaves nothing to speak of.
ENOUGH = 1e-10
STEPS = 25  # of Newton; more only where the distance has a crease
CUTS = 60  # of the search over creases
GAP = 1e-13  # m, between the least value found and its lower bound

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float, float, float, float, float, float]

#: An ellipsoid in the axes of a shape: centre (3), and the map from its unit sphere, row-major (9).
Pose = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip


@inlined  # as fast on flat ground as without a call
def deepest_point(
    surface: Surface,
    i: int,
    center: Vector,
    rotation: FloatArray,
    semi_axes: Vector,
    guess: FloatArray,
) -> tuple[float, Vector, Vector]:
    """The point of an ellipsoid's surface with the least signed distance from a shape.

    A half space has a closed form. Otherwise Newton's method over the directions of the unit
    sphere, with backtracking. Deep in a shape the distance has creases (where two faces are
    equally near); there tangent planes of the convex distance give lower bounds that rise.

    Args:
        surface: compiled shapes.
        i: index of the shape.
        center: of the ellipsoid, world axes [m].
        rotation: ellipsoid axes to world, row-major, (9,).
        semi_axes: of the ellipsoid [m].
        guess: direction to start from, on the unit sphere whose image is the ellipsoid, ellipsoid
            axes, (3,); zeros: none. Replaced by the result.

    Returns:
        Depth [m], above 0 in contact; the point, world axes [m]; outward normal of the shape there,
        world axes. On a crease: the normal that lies opposite to the ellipsoid's own.
    """
    cx, cy, cz = center
    m, o, s = rotation, surface.position, surface.rotation
    ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
    kind = surface.kind[i]
    if kind == HALF_SPACE:
        ax, ay, az = semi_axes
        nx, ny, nz = s[i, 2], s[i, 5], s[i, 8]
        dx = -(m[0] * nx + m[3] * ny + m[6] * nz)
        dy = -(m[1] * nx + m[4] * ny + m[7] * nz)
        dz = -(m[2] * nx + m[5] * ny + m[8] * nz)
        scale = 1.0 / ((ax * dx) ** 2 + (ay * dy) ** 2 + (az * dz) ** 2) ** 0.5
        guess[0], guess[1], guess[2] = ax * dx * scale, ay * dy * scale, az * dz * scale
        lx, ly, lz = ax * ax * dx * scale, ay * ay * dy * scale, az * az * dz * scale
        px = cx + m[0] * lx + m[1] * ly + m[2] * lz
        py = cy + m[3] * lx + m[4] * ly + m[5] * lz
        pz = cz + m[6] * lx + m[7] * ly + m[8] * lz
        distance = nx * (px - ox) + ny * (py - oy) + nz * (pz - oz)
        return -distance, (px, py, pz), (nx, ny, nz)

    depth, about_origin, normal, u = _curved(
        kind,
        size_of(surface, i),
        (s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4], s[i, 5], s[i, 6], s[i, 7], s[i, 8]),
        (cx - ox, cy - oy, cz - oz),
        (m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]),
        semi_axes,
        (guess[0], guess[1], guess[2]),
    )
    guess[0], guess[1], guess[2] = u
    x, y, z = about_origin
    return depth, (x + ox, y + oy, z + oz), normal


@compiled
def _curved(
    kind: int, size: Size, r: Rotation, q: Vector, m: Rotation, semi_axes: Vector, guess: Vector
) -> tuple[float, Vector, Vector, Vector]:
    """:func:`deepest_point` for every other shape, about its origin; and the direction found.

    Args:
        kind, size, r: of the shape.
        q, m, semi_axes: of the ellipsoid; centre from the origin of the shape.
        guess: direction to start from.
    """
    ax, ay, az = semi_axes
    qx, qy, qz = q
    pose = (
        r[0] * qx + r[3] * qy + r[6] * qz,
        r[1] * qx + r[4] * qy + r[7] * qz,
        r[2] * qx + r[5] * qy + r[8] * qz,
        (r[0] * m[0] + r[3] * m[3] + r[6] * m[6]) * ax,
        (r[0] * m[1] + r[3] * m[4] + r[6] * m[7]) * ay,
        (r[0] * m[2] + r[3] * m[5] + r[6] * m[8]) * az,
        (r[1] * m[0] + r[4] * m[3] + r[7] * m[6]) * ax,
        (r[1] * m[1] + r[4] * m[4] + r[7] * m[7]) * ay,
        (r[1] * m[2] + r[4] * m[5] + r[7] * m[8]) * az,
        (r[2] * m[0] + r[5] * m[3] + r[8] * m[6]) * ax,
        (r[2] * m[1] + r[5] * m[4] + r[8] * m[7]) * ay,
        (r[2] * m[2] + r[5] * m[5] + r[8] * m[8]) * az,
    )
    u = guess
    if u[0] == 0.0 and u[1] == 0.0 and u[2] == 0.0:
        u = _towards(local_form(kind, size, pose[0], pose[1], pose[2]), pose)
    u, form, smooth = _newton(kind, size, pose, u)
    nx, ny, nz = form[1], form[2], form[3]
    distance = form[0]
    if not smooth:
        u, distance = _cut(kind, size, pose, u, distance)
        if kind == CAPSULE:
            u, distance = _pierced(kind, size, pose, u, distance)
        wx, wy, wz = u[0] / ax, u[1] / ay, u[2] / az
        scale = -1.0 / (wx * wx + wy * wy + wz * wz) ** 0.5
        wx, wy, wz = wx * scale, wy * scale, wz * scale
        nx, ny, nz = (
            m[0] * wx + m[1] * wy + m[2] * wz,
            m[3] * wx + m[4] * wy + m[5] * wz,
            m[6] * wx + m[7] * wy + m[8] * wz,
        )
    else:
        nx, ny, nz = (
            r[0] * nx + r[1] * ny + r[2] * nz,
            r[3] * nx + r[4] * ny + r[5] * nz,
            r[6] * nx + r[7] * ny + r[8] * nz,
        )
    lx, ly, lz = ax * u[0], ay * u[1], az * u[2]
    return (
        -distance,
        (
            qx + m[0] * lx + m[1] * ly + m[2] * lz,
            qy + m[3] * lx + m[4] * ly + m[5] * lz,
            qz + m[6] * lx + m[7] * ly + m[8] * lz,
        ),
        (nx, ny, nz),
        u,
    )


@compiled
def _form_at(kind: int, size: Size, p: Pose, u: Vector) -> Form:
    ux, uy, uz = u
    return local_form(
        kind,
        size,
        p[0] + p[3] * ux + p[4] * uy + p[5] * uz,
        p[1] + p[6] * ux + p[7] * uy + p[8] * uz,
        p[2] + p[9] * ux + p[10] * uy + p[11] * uz,
    )


@compiled
def _gradient(form: Form, p: Pose) -> Vector:
    """Derivative of the distance by the direction u."""
    nx, ny, nz = form[1], form[2], form[3]
    return (
        p[3] * nx + p[6] * ny + p[9] * nz,
        p[4] * nx + p[7] * ny + p[10] * nz,
        p[5] * nx + p[8] * ny + p[11] * nz,
    )


@compiled
def _towards(form: Form, p: Pose) -> Vector:
    """The direction that is best where the distance is linear."""
    gx, gy, gz = _gradient(form, p)
    scale = -1.0 / (gx * gx + gy * gy + gz * gz) ** 0.5
    return gx * scale, gy * scale, gz * scale


@compiled
def _newton(kind: int, size: Size, p: Pose, u: Vector) -> tuple[Vector, Form, bool]:
    """Direction of least distance, the form there, and whether that is sure to be a minimum."""
    form = _form_at(kind, size, p, u)
    for _ in range(STEPS):
        gx, gy, gz = _gradient(form, p)
        pull = -(gx * u[0] + gy * u[1] + gz * u[2])
        if pull <= 0.0:  # on the far side: over to the near one, if that is better
            other = _towards(form, p)
            there = _form_at(kind, size, p, other)
            if there[0] >= form[0]:
                return u, form, False
            u, form = other, there
            continue
        bx, by, bz = tangent(u[0], u[1], u[2])
        dx, dy, dz = u[1] * bz - u[2] * by, u[2] * bx - u[0] * bz, u[0] * by - u[1] * bx
        # The two tangents in shape axes, then along the two tangents of the level surface.
        vx = p[3] * bx + p[4] * by + p[5] * bz
        vy = p[6] * bx + p[7] * by + p[8] * bz
        vz = p[9] * bx + p[10] * by + p[11] * bz
        wx = p[3] * dx + p[4] * dy + p[5] * dz
        wy = p[6] * dx + p[7] * dy + p[8] * dz
        wz = p[9] * dx + p[10] * dy + p[11] * dz
        nx, ny, nz, ex, ey, ez, h11, h12, h22 = form[1:]
        fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
        ve, vf = vx * ex + vy * ey + vz * ez, vx * fx + vy * fy + vz * fz
        we, wf = wx * ex + wy * ey + wz * ez, wx * fx + wy * fy + wz * fz
        a = pull + h11 * ve * ve + 2.0 * h12 * ve * vf + h22 * vf * vf
        b = h11 * ve * we + h12 * (ve * wf + vf * we) + h22 * vf * wf
        c = pull + h11 * we * we + 2.0 * h12 * we * wf + h22 * wf * wf
        s, t = gx * bx + gy * by + gz * bz, gx * dx + gy * dy + gz * dz
        det = a * c - b * b  # at least pull^2: the distance is convex
        if det <= 0.0:  # but for rounding, where the pull is all but nothing
            return u, form, False
        step_b, step_d = -(c * s - b * t) / det, -(a * t - b * s) / det
        promise = -0.5 * (step_b * s + step_d * t)
        share = 1.0
        found = False
        while share > 1e-3:
            x = u[0] + share * (step_b * bx + step_d * dx)
            y = u[1] + share * (step_b * by + step_d * dy)
            z = u[2] + share * (step_b * bz + step_d * dz)
            scale = 1.0 / (x * x + y * y + z * z) ** 0.5
            other = (x * scale, y * scale, z * scale)
            there = _form_at(kind, size, p, other)
            if there[0] <= form[0] - 0.1 * share * promise or (
                promise < ENOUGH and there[0] <= form[0] + 1e-15
            ):
                found = True
                break
            share *= 0.5
        if not found:
            return u, form, promise < GAP
        u, form = other, there
        if promise < ENOUGH and share == 1.0:
            return u, form, True
    return u, form, False


@compiled
def _plane(form: Form, p: Pose, u: Vector) -> Plane:
    """The tangent plane of the distance as a function of the direction."""
    gx, gy, gz = _gradient(form, p)
    return gx, gy, gz, form[0] - (gx * u[0] + gy * u[1] + gz * u[2])


@compiled
def _cut(kind: int, size: Size, p: Pose, u: Vector, distance: float) -> tuple[Vector, float]:
    """Direction of least distance where it has creases, from ``u`` on, and that distance.

    Kelley's cutting planes: the greatest of some tangent planes bounds a convex function from
    below. Of the planes only those that meet in the last bound are kept.
    """
    first = _plane(_form_at(kind, size, p, u), p, u)
    planes = (first, first, first, first)
    for _ in range(CUTS):
        bound, other, kept = lowest_of_planes(planes, u)
        form = _form_at(kind, size, p, other)
        if form[0] < distance:
            u, distance = other, form[0]
        if distance - bound < GAP:
            break
        planes = (planes[kept[0]], planes[kept[1]], planes[kept[2]], _plane(form, p, other))
    return u, distance


@compiled
def _pierced(kind: int, size: Size, p: Pose, u: Vector, distance: float) -> tuple[Vector, float]:
    """Where a capsule's axis passes through the ellipsoid's surface nothing is deeper."""
    radius, half = size[RADIUS], size[FIRST]
    # The axis in the space of the unit sphere: the map's columns are orthogonal.
    na = p[3] * p[3] + p[6] * p[6] + p[9] * p[9]
    nb = p[4] * p[4] + p[7] * p[7] + p[10] * p[10]
    nc = p[5] * p[5] + p[8] * p[8] + p[11] * p[11]
    ox = -(p[3] * p[0] + p[6] * p[1] + p[9] * p[2]) / na
    oy = -(p[4] * p[0] + p[7] * p[1] + p[10] * p[2]) / nb
    oz = -(p[5] * p[0] + p[8] * p[1] + p[11] * p[2]) / nc
    kx, ky, kz = p[9] / na, p[10] / nb, p[11] / nc
    a = kx * kx + ky * ky + kz * kz
    b = kx * ox + ky * oy + kz * oz
    root = b * b - a * (ox * ox + oy * oy + oz * oz - 1.0)
    if root <= 0.0:
        return u, distance
    root = root**0.5
    nearest = -2.0
    result = u
    for sign in (-1.0, 1.0):
        z = (-b + sign * root) / a
        if abs(z) <= half:
            x, y, w = ox + z * kx, oy + z * ky, oz + z * kz
            near = x * u[0] + y * u[1] + w * u[2]
            if near > nearest:
                nearest, result, distance = near, (x, y, w), -radius
    return result, distance
