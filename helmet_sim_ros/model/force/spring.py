"""The coupling spring between head and shell: exponential loading, exponential unloading.

Loading follows F = A (exp(B d) - 1) (Hyncik & Bonkowski, section 2.2). Below the largest
compression d_m so far, unloading and reloading follow F = F_m (exp(C d) - 1) / (exp(C d_m) - 1),
with C such that the area under it is (1 - energy_loss) of the loading energy. In three dimensions d
is the length of the displacement and the force lies along it; each axis contributes its law with
the square of the direction's cosine, so that along an axis its own law holds, and equal laws make
an isotropic spring.

A shell that rolls leaves crushed liner behind and comes down on fresh liner. The spring bears over
the patch in which the shell of local radius R = a b c / (a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2) (from
the Gaussian curvature of its ellipsoid) lies d below the plane, of radius sqrt(2 R d). Its leading
and its trailing half, each half of the spring with a memory of its own, are lowered and raised by
the roll at the centroid of half a disc. Where they bear unevenly the force of the surface moves
forward and brakes the roll. Nothing here is fitted; a helmet that bears at a point has neither.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force.bodies import (
    FORCE,
    FRICTION,
    HELMET,
    Loads,
    Motion,
    count_surface,
    load,
    rigid,
)
from helmet_sim_ros.model.force.vector import Vec, cross, dot, norm, scaled, sub, turned_back
from helmet_sim_ros.model.helmet import Spring

#: Which law acts for each sense of the helmet's displacement in the head frame: -x +x -y +y -z +z.
SIDES = ("front", "back", "side", "side", "top", "strap")
#: Columns of ``CouplingSpring.law``.
SCALE, EXPONENT = 0, 1
#: Halves of the patch: rows of ``CouplingSpring.behind``.
TRAILING, LEADING = 0, 1
CENTROID = 4.0 / (3.0 * math.pi)  # of half a disc, over its radius
#: Largest that rolling alone can leave a half behind, over the compression: the mean of
#: x^2 / (2 R) over a patch of radius sqrt(2 R d).
LEFT_BEHIND = 1.0 / 3.0


class CouplingSpring(NamedTuple):
    """The spring of one helmet; rows of ``law`` belong to ``SIDES``.

    Attributes:
        slide: index of its first slide in the generalised positions and, behind it, velocities;
            negative: a foam helmet, which has none.
        helmet: MuJoCo's index of the helmet body.
        law: A [N], B [1/m], (6, 2).
        energy_loss: share of the loading energy that is not given back [-].
        semi_axes: of the shell's ellipsoid [m]; all 0: it bears at a point.
        past: largest compression so far, and the last one, (2,) [m]; state.
        behind: how far each half of the patch is below its own largest compression, (2,) [m];
            state.
        along: direction of the last roll, world axes, (3,); state.
    """

    slide: int
    slide_velocity: int
    helmet: int
    law: FloatArray
    energy_loss: float
    semi_axes: Vec
    past: FloatArray
    behind: FloatArray
    along: FloatArray


def law_table(spring: Spring) -> FloatArray:
    """Rows A [N], B [1/m] per side in the order of ``SIDES``, shape (6, 2)."""
    return np.array([[getattr(spring, side).A, getattr(spring, side).B] for side in SIDES])


def coupling_spring(
    spring: Spring,
    semi_axes: Vec = (0.0, 0.0, 0.0),
    slide: int = 0,
    slide_velocity: int = 0,
    helmet: int = 0,
) -> CouplingSpring:
    """The virgin spring of a configuration; ``semi_axes``: of the shell it belongs to [m]."""
    if spring.bears == "point":
        semi_axes = (0.0, 0.0, 0.0)
    return CouplingSpring(
        slide, slide_velocity, helmet, law_table(spring), spring.energy_loss, semi_axes,
        np.zeros(2), np.zeros(2), np.zeros(3),
    )  # fmt: skip


@compiled
def loading_force(scale: float, exponent: float, compression: float) -> float:
    """F = A (exp(B d) - 1) [N]."""
    return scale * math.expm1(exponent * compression)


@compiled
def exponential_share(u: float) -> float:
    """Area under (exp(u s) - 1) / (exp(u) - 1) for s from 0 to 1: 1/u - 1/(exp(u) - 1)."""
    if u < 1e-2:  # the difference of two large numbers; series to u^3, error below 1e-13
        return 0.5 - u / 12.0 + u**3 / 720.0
    return 1.0 / u - math.exp(-u) / -math.expm1(-u)


@compiled
def unloading_exponent(exponent: float, compression: float, energy_loss: float) -> float:
    """C [1/m] of the unloading path from ``compression`` that gives back 1 - energy_loss."""
    share = (1.0 - energy_loss) * exponential_share(exponent * compression)
    # Below the root: the share is convex, so Newton's steps rise to it without passing it.
    u = max(1e-9, 12.0 * (0.5 - share))
    if share < 0.32:
        u = 1.0 / share - 2.0 * math.exp(-1.0 / share) / (share * share)
    for _ in range(50):
        if u < 1e-2:
            slope = -1.0 / 12.0 + u * u / 240.0
        else:
            slope = math.exp(-u) / math.expm1(-u) ** 2 - 1.0 / (u * u)
        rise = (share - exponential_share(u)) / slope
        u += rise
        if rise <= 1e-8 * u:  # of second order: the next rise would be 1e-16 u
            break
    return u / compression


@compiled
def deepest(scale: float, exponent: float, energy: float) -> tuple[float, float]:
    """Compression [m] and force [N] at which the loading path has taken up an energy [J].

    The energy up to d is A ((exp(B d) - 1) / B - d).
    """
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        x = exponent * middle
        taken = scale / exponent * (math.expm1(x) - x) if x < 700.0 else math.inf
        if taken < energy:
            low = middle
        else:
            high = middle
    return high, loading_force(scale, exponent, high)


@compiled
def unloading_force(peak: float, force: float, exponent: float, compression: float) -> float:
    """Force [N] on the unloading path through (peak [m], force [N]); stable for any exponent."""
    return (
        force
        * math.exp(exponent * (compression - peak))
        * math.expm1(-exponent * compression)
        / math.expm1(-exponent * peak)
    )


@compiled
def follow(spring: CouplingSpring, compression: float, rolled: float) -> None:
    """Carry on what each half of the patch remembers.

    Args:
        spring: its state is changed in place.
        compression: at present [m].
        rolled: how much roll has lowered the leading half, and raised the trailing one, since the
            last call [m].
    """
    past, behind = spring.past, spring.behind
    risen = past[1] - compression
    past[0], past[1] = max(past[0], compression), compression
    most = past[0] - compression + LEFT_BEHIND * compression
    behind[TRAILING] = min(max(0.0, behind[TRAILING] + risen + rolled), most)
    behind[LEADING] = min(max(0.0, behind[LEADING] + risen - rolled), most)


@compiled
def force_of_half(
    spring: CouplingSpring, displacement: FloatArray, compression: float, half: int
) -> float:
    """Force of a whole spring with the memory of one half [N]."""
    behind, force = spring.behind[half], 0.0
    peak = compression + behind
    for axis in range(3):
        share = (displacement[axis] / compression) ** 2
        side = 2 * axis if displacement[axis] < 0.0 else 2 * axis + 1
        scale, exponent = spring.law[side, SCALE], spring.law[side, EXPONENT]
        if share == 0.0:
            continue
        if behind == 0.0:
            force += share * loading_force(scale, exponent, compression)
        else:
            path = unloading_exponent(exponent, peak, spring.energy_loss)
            force += share * unloading_force(
                peak, loading_force(scale, exponent, peak), path, compression
            )
    return force


@compiled
def spring_force(
    spring: CouplingSpring, displacement: FloatArray, rolled: float, force: FloatArray
) -> float:
    """Force on the shell, against its displacement.

    Args:
        spring: its state is changed in place.
        displacement: helmet against head, head axes, shape (3,) [m].
        rolled: see :func:`follow` [m].
        force: shape (3,) [N]; written.

    Returns:
        How much more the leading half bears than the trailing one, over their sum [-].
    """
    x, y, z = displacement[0], displacement[1], displacement[2]
    compression = (x * x + y * y + z * z) ** 0.5
    force[:] = 0.0
    follow(spring, compression, rolled)
    if compression == 0.0:
        return 0.0
    trailing = force_of_half(spring, displacement, compression, TRAILING)
    leading = trailing
    if spring.behind[LEADING] != spring.behind[TRAILING]:
        leading = force_of_half(spring, displacement, compression, LEADING)
    both = trailing + leading
    for axis in range(3):
        force[axis] = -0.5 * both * displacement[axis] / compression
    return (leading - trailing) / both if both > 0.0 else 0.0


@compiled
def lever(spring: CouplingSpring, normal: Vec, compression: float) -> float:
    """Distance of a half's centroid from the middle of the patch [m].

    Args:
        spring: constants.
        normal: of the struck surface, helmet frame.
        compression: [m].
    """
    a, b, c = spring.semi_axes
    stretched = (a * normal[0]) ** 2 + (b * normal[1]) ** 2 + (c * normal[2]) ** 2
    return CENTROID * float((2.0 * a * b * c / stretched * compression) ** 0.5)


@compiled
def apply(spring: CouplingSpring, step: float, motion: Motion, loads: Loads) -> None:
    """Add the spring's force to the slides of the shell against the head, and move what the
    surface does to the helmet, which is in the loads already, to where the patch bears; nothing for
    a bare head.

    Args:
        spring: constants and state; the state is changed in place.
        step: since the last call [s].
        motion, loads: of the bodies.
    """
    if spring.slide < 0:
        return
    displacement = motion.qpos[spring.slide : spring.slide + 3]
    struck = loads.surface[HELMET]
    pressed = sub(
        (struck[FORCE], struck[FORCE + 1], struck[FORCE + 2]),
        (struck[FRICTION], struck[FRICTION + 1], struck[FRICTION + 2]),
    )
    size, arm, rate, along = norm(pressed), 0.0, 0.0, (0.0, 0.0, 0.0)
    if size > 0.0 and spring.semi_axes[0] > 0.0:
        helmet = rigid(motion, spring.helmet)
        normal = scaled(pressed, 1.0 / size)
        x, y, z = displacement[0], displacement[1], displacement[2]
        arm = lever(spring, turned_back(helmet.rotation, normal), (x * x + y * y + z * z) ** 0.5)
        along = cross(helmet.spin, normal)
        rate = norm(along)
        if dot(along, (spring.along[0], spring.along[1], spring.along[2])) < 0.0:  # rolls back
            behind = spring.behind
            behind[TRAILING], behind[LEADING] = behind[LEADING], behind[TRAILING]
        spring.along[0], spring.along[1], spring.along[2] = along
    uneven = spring_force(spring, displacement, arm * rate * step, loads.spring)
    if uneven != 0.0 and rate > 0.0:
        couple = cross(scaled(along, arm * uneven / rate), pressed)
        load(loads, spring.helmet, (0.0, 0.0, 0.0), couple)
        count_surface(loads, HELMET, (0.0, 0.0, 0.0), couple, (0.0, 0.0, 0.0))
    for k in range(3):
        loads.generalised[spring.slide_velocity + k] += loads.spring[k]


@compiled
def recoverable_energy(spring: CouplingSpring, displacement: FloatArray) -> float:
    """Energy that the spring would still give back at a displacement (3,) [m] in its present
    state [J]: the area under the halves' unloading paths from 0 to the present compression."""
    compression, energy = 0.0, 0.0
    for axis in range(3):
        compression += displacement[axis] ** 2
    compression = compression**0.5
    for axis in range(3):
        if displacement[axis] == 0.0:
            continue
        side = 2 * axis if displacement[axis] < 0.0 else 2 * axis + 1
        scale, exponent = spring.law[side, SCALE], spring.law[side, EXPONENT]
        share = 0.5 * (displacement[axis] / compression) ** 2
        for behind in spring.behind:
            peak = compression + behind
            path = unloading_exponent(exponent, peak, spring.energy_loss)
            force = unloading_force(peak, loading_force(scale, exponent, peak), path, compression)
            energy += share * force * compression * exponential_share(path * compression)
    return energy
