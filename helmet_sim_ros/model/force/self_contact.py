"""The rider against himself: limbs on trunk and limbs, the helmet on shoulders, chest and arms.

Capsules (a segment and a radius) meet capsules and ellipsoids (trunk segments, the helmet). Pairs
are listed once; of each, spheres about both are compared first. Two parts that overlap in the
rider's posture at rest are tissue that is displaced already: their depth counts from there.
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import NDArray
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
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
        overlap: of the pair in the rider's posture at rest, (m,) [m].
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
    return x * x + y * y + z * z < far * far


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
def above_ellipsoid(semi_axes: FloatArray, p: Vec, q: Vec) -> tuple[float, Vec, Vec]:
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
def approach(parts: SelfContact, motion: Motion, a: int, b: int) -> tuple[float, Vec, Vec]:
    """Gap between two parts [m], below 0 where they overlap; where it is, and the normal from the
    first to the second, world axes. The places of the parts are those of :func:`locate`."""
    w = parts.where
    r, s = (w[b, 0], w[b, 1], w[b, 2]), (w[b, 3], w[b, 4], w[b, 5])
    if parts.radius[a] > 0.0:
        p, q = (w[a, 0], w[a, 1], w[a, 2]), (w[a, 3], w[a, 4], w[a, 5])
        c, d = closest_on_segments(p, q, r, s)
        apart = sub(d, c)
        distance = norm(apart)
        normal = (0.0, 0.0, 1.0)
        if distance > TINY:
            normal = scaled(apart, 1.0 / distance)
        gap = distance - parts.radius[a] - parts.radius[b]
        return gap, add(c, scaled(normal, parts.radius[a] + 0.5 * gap)), normal
    turn: Mat = matrix(motion.rotation, parts.body[a])
    center = (w[a, 6], w[a, 7], w[a, 8])
    local = turned_back(turn, sub(r, center)), turned_back(turn, sub(s, center))
    distance, c, normal = above_ellipsoid(parts.semi_axes[a], local[0], local[1])
    normal = turned(turn, normal)
    at = add(add(center, turned(turn, c)), scaled(normal, -parts.radius[b]))
    return distance - parts.radius[b], at, normal


@inlined
def depth_of(parts: SelfContact, j: int, gap: float) -> float:
    """Overlap of a pair beyond that at rest [m]."""
    depth: float = -gap - parts.overlap[j]
    return depth


@compiled
def apply(parts: SelfContact, step: float, motion: Motion, loads: Loads) -> None:
    """Add the forces between all parts; ``step`` [s]."""
    locate(parts, motion)
    first, second, where, reach = parts.first, parts.second, parts.where, parts.reach
    for j in range(len(first)):
        if is_near(where, reach, first[j], second[j]):
            press(parts, j, step, motion, loads)


@compiled
def press(parts: SelfContact, j: int, step: float, motion: Motion, loads: Loads) -> None:
    """Add the force between the parts of pair j."""
    a, b = parts.first[j], parts.second[j]
    gap, point, normal = approach(parts, motion, a, b)
    depth = depth_of(parts, j, gap)
    if depth <= 0.0:
        return
    a, b, mass = parts.body[a], parts.body[b], parts.mass[j]
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


@compiled
def deepest(parts: SelfContact, motion: Motion) -> float:
    """The deepest overlap beyond that at rest [m], 0: none."""
    locate(parts, motion)
    most = 0.0
    for j in range(len(parts.first)):
        if is_near(parts.where, parts.reach, parts.first[j], parts.second[j]):
            most = max(most, depth_of(
                parts, j, approach(parts, motion, parts.first[j], parts.second[j])[0]
            ))  # fmt: skip
    return most


@compiled
def stored_energy(parts: SelfContact, motion: Motion) -> float:
    """Elastic energy of all pairs [J]."""
    locate(parts, motion)
    energy = 0.0
    for j in range(len(parts.first)):
        if is_near(parts.where, parts.reach, parts.first[j], parts.second[j]):
            gap = approach(parts, motion, parts.first[j], parts.second[j])[0]
            depth = depth_of(parts, j, gap)
            if depth > 0.0:
                energy += elastic_energy(
                    parts.stiffness[j], parts.thickness[j], parts.straight[j], depth
                )
    return energy
