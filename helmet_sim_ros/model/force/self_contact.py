"""The rider against himself: limbs on trunk and limbs, the helmet on shoulders, chest and arms.

Capsules (a segment and a radius) meet capsules and ellipsoids (trunk segments, the helmet). Pairs
are listed once; of each, spheres about both are compared first. Two parts that overlap at the start
are tissue that is displaced already: their depth counts from there, until they have come apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import allocating, compiled, inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion, push, rigid, velocity_at
from helmet_sim_ros.model.force.tissue import elastic_energy, elastic_force, resisting
from helmet_sim_ros.model.force.vector import (
    Mat,
    Vec,
    across,
    add,
    dot,
    matrix,
    norm,
    row,
    scaled,
    sub,
    turned,
    turned_back,
)

SLOW = 0.1  # m/s, slip below which friction fades (choice: it damps, and need not hold)
TINY = 1e-9  # m


class SelfContact(NamedTuple):
    """Parts and pairs; row i belongs to part i, row j to pair j.

    Attributes:
        body: MuJoCo body that carries the part, (n,).
        start, end: ends of a capsule's segment, both the centre of an ellipsoid; frame of the body,
            (n, 3) [m].
        radius: of a capsule, 0 for an ellipsoid, (n,) [m].
        semi_axes: of an ellipsoid along the body's axes, the third above and the fourth below its
            centre, (n, 4) [m].
        reach: of the part about the middle of its segment, (n,) [m].
        first, second: parts of a pair; the second is a capsule, (m,).
        overlap: what is left of that at the start, (m,) [m]; state.
        stiffness, thickness, straight: of both tissues in series, see
            :mod:`helmet_sim_ros.model.force.tissue`, (m,) [N/m], [m], [-].
        mass: the least that the pair's force moves, (m,) [kg].
        damping, friction: [s/m], [-].
        where: ends of the segments and their middle now, (n, 9) [m]; working memory.
    """

    body: NDArray[np.int64]
    start: FloatArray
    end: FloatArray
    radius: FloatArray
    semi_axes: FloatArray
    reach: FloatArray
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    overlap: FloatArray
    stiffness: FloatArray
    thickness: FloatArray
    straight: FloatArray
    mass: FloatArray
    damping: float
    friction: float
    where: FloatArray


@inlined
def locate(parts: SelfContact, motion: Motion) -> None:
    """Where every part is now."""
    where, bodies, starts, ends = parts.where, parts.body, parts.start, parts.end
    for i in range(len(bodies)):
        turn, at = matrix(motion.rotation, bodies[i]), row(motion.position, bodies[i])
        p = add(at, turned(turn, row(starts, i)))
        q = add(at, turned(turn, row(ends, i)))
        for k in range(3):
            where[i, k] = p[k]
            where[i, 3 + k] = q[k]
            where[i, 6 + k] = 0.5 * (p[k] + q[k])


@inlined
def is_near(where: FloatArray, reach: FloatArray, a: int, b: int) -> bool:
    """Whether the spheres about two parts meet."""
    x, y, z = where[a, 6] - where[b, 6], where[a, 7] - where[b, 7], where[a, 8] - where[b, 8]
    far = reach[a] + reach[b]
    near: bool = x * x + y * y + z * z < far * far
    return near


@compiled
def closest_on_segments(p: Vec, q: Vec, r: Vec, s: Vec) -> tuple[Vec, Vec]:
    """The points of two segments that are closest to each other (Ericson, Real-Time Collision
    Detection, 2005, sec. 5.1.9)."""
    u, v, w = sub(q, p), sub(s, r), sub(p, r)
    a, e, f = dot(u, u), dot(v, v), dot(v, w)
    c, b = dot(u, w), dot(u, v)
    det = a * e - b * b
    t = 0.0
    if det > TINY * TINY:
        t = min(1.0, max(0.0, (b * f - c * e) / det))
    along = (b * t + f) / e if e > TINY * TINY else 0.0
    if along < 0.0 or along > 1.0 or e <= TINY * TINY:
        along = min(1.0, max(0.0, along))
        t = min(1.0, max(0.0, (b * along - c) / a)) if a > TINY * TINY else 0.0
    return add(p, scaled(u, t)), add(r, scaled(v, along))


@inlined
def closest_in(p: Vec, q: Vec, ax: float, ay: float, az: float) -> Vec:
    """The point of a segment that lies on the smallest of all similar ellipsoids."""
    u = sub(q, p)
    x, y, z = ax**-2, ay**-2, az**-2
    length = u[0] * u[0] * x + u[1] * u[1] * y + u[2] * u[2] * z
    t = 0.0
    if length > TINY:
        t = -(p[0] * u[0] * x + p[1] * u[1] * y + p[2] * u[2] * z) / length
    return add(p, scaled(u, min(1.0, max(0.0, t))))


@compiled
def above_ellipsoid(
    semi_axes: tuple[float, float, float, float], p: Vec, q: Vec
) -> tuple[float, Vec, Vec]:
    """Distance of a segment from an ellipsoid about the origin to first order [m], the segment's
    point there, and the ellipsoid's normal."""
    ax, ay, az = semi_axes[0], semi_axes[1], semi_axes[3]
    c = closest_in(p, q, ax, ay, az)
    if c[2] > 0.0:
        az = semi_axes[2]
        c = closest_in(p, q, ax, ay, az)
    az = semi_axes[2] if c[2] > 0.0 else semi_axes[3]
    level = ((c[0] / ax) ** 2 + (c[1] / ay) ** 2 + (c[2] / az) ** 2) ** 0.5
    if level < 1e-6:
        return -min(ax, ay, az), c, (1.0, 0.0, 0.0)
    g = (c[0] / ax**2, c[1] / ay**2, c[2] / az**2)
    slope = norm(g)
    return (level - 1.0) * level / slope, c, scaled(g, 1.0 / slope)


@compiled
def between_capsules(
    p: Vec, q: Vec, radius: float, r: Vec, s: Vec, other: float
) -> tuple[float, Vec, Vec]:
    """:func:`approach` of two capsules, by the ends of their segments and their radii [m]."""
    c, d = closest_on_segments(p, q, r, s)
    apart = sub(d, c)
    distance = norm(apart)
    normal = (0.0, 0.0, 1.0)
    if distance > TINY:
        normal = scaled(apart, 1.0 / distance)
    gap = distance - radius - other
    return gap, add(c, scaled(normal, radius + 0.5 * gap)), normal


@inlined
def approach(
    where: FloatArray,
    radius: FloatArray,
    semi_axes: FloatArray,
    rotation: FloatArray,
    a: int,
    b: int,
) -> tuple[float, Vec, Vec]:
    """Gap between two parts [m], below 0 where they overlap; where it is, and the normal from the
    first to the second, world axes. ``rotation``: of the first part's body, (9,)."""
    r = (where[b, 0], where[b, 1], where[b, 2])
    s = (where[b, 3], where[b, 4], where[b, 5])
    if radius[a] > 0.0:
        p = (where[a, 0], where[a, 1], where[a, 2])
        q = (where[a, 3], where[a, 4], where[a, 5])
        return between_capsules(p, q, radius[a], r, s, radius[b])
    m = rotation
    turn: Mat = (m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8])
    center = (where[a, 6], where[a, 7], where[a, 8])
    axes = (semi_axes[a, 0], semi_axes[a, 1], semi_axes[a, 2], semi_axes[a, 3])
    distance, c, normal = above_ellipsoid(
        axes, turned_back(turn, sub(r, center)), turned_back(turn, sub(s, center))
    )
    normal = turned(turn, normal)
    at = add(add(center, turned(turn, c)), scaled(normal, -radius[b]))
    return distance - radius[b], at, normal


@compiled
def gap_of(parts: SelfContact, motion: Motion, j: int) -> tuple[float, Vec, Vec]:
    """:func:`approach` of pair j where the parts are now."""
    a = parts.first[j]
    return approach(
        parts.where, parts.radius, parts.semi_axes, motion.rotation[parts.body[a]], a,
        parts.second[j],
    )  # fmt: skip


@compiled
def apply(parts: SelfContact, step: float, motion: Motion, loads: Loads) -> None:
    """Add the forces between all parts; ``step`` [s]."""
    locate(parts, motion)
    first, second, where, reach = parts.first, parts.second, parts.where, parts.reach
    radius, semi_axes, overlap = parts.radius, parts.semi_axes, parts.overlap
    bodies, rotation = parts.body, motion.rotation
    for j in range(len(first)):
        a, b = first[j], second[j]
        if not is_near(where, reach, a, b):
            overlap[j] = 0.0
            continue
        gap, point, normal = approach(where, radius, semi_axes, rotation[bodies[a]], a, b)
        depth = -gap - overlap[j]
        if depth > 0.0:
            press(parts, j, depth, point, normal, step, motion, loads)
        else:
            overlap[j] = max(0.0, -gap)


@compiled
def press(
    parts: SelfContact,
    j: int,
    depth: float,
    point: Vec,
    normal: Vec,
    step: float,
    motion: Motion,
    loads: Loads,
) -> None:
    """Add the force between the parts of pair j that overlap by ``depth`` [m]."""
    a, b, mass = parts.body[parts.first[j]], parts.body[parts.second[j]], parts.mass[j]
    velocity = sub(
        velocity_at(rigid(motion, b), point), velocity_at(rigid(motion, a), point)
    )  # fmt: skip
    elastic = elastic_force(parts.stiffness[j], parts.thickness[j], parts.straight[j], depth)
    pressed = resisting(elastic, parts.damping, -dot(velocity, normal), step, mass)
    slip = across(velocity, normal)
    rubbing = parts.friction * pressed / max(norm(slip), SLOW)
    force = add(scaled(normal, pressed), scaled(slip, -rubbing / (1.0 + rubbing * step / mass)))
    push(motion, loads, b, point, force)
    push(motion, loads, a, point, scaled(force, -1.0))


@allocating
def depths(parts: SelfContact, motion: Motion) -> FloatArray:
    """Overlap of every pair beyond that of the start [m], below 0 where they are apart."""
    locate(parts, motion)
    found = np.empty(len(parts.first))
    for j in range(len(found)):
        found[j] = -gap_of(parts, motion, j)[0] - parts.overlap[j]
    return found


def started(parts: SelfContact, motion: Motion) -> SelfContact:
    """The same with a state of its own, at the start."""
    parts = parts._replace(
        where=np.zeros_like(parts.where), overlap=np.zeros_like(parts.overlap)
    )  # fmt: skip
    return parts._replace(overlap=np.maximum(0.0, depths(parts, motion)))


@compiled
def stored_energy(parts: SelfContact, motion: Motion) -> float:
    """Elastic energy of all pairs [J]."""
    energy = 0.0
    overlaps = depths(parts, motion)
    for j in range(len(overlaps)):
        if overlaps[j] > 0.0:
            energy += elastic_energy(
                parts.stiffness[j], parts.thickness[j], parts.straight[j], overlaps[j]
            )
    return energy
