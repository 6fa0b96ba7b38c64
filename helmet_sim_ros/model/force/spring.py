"""The coupling spring between head and shell: exponential loading, exponential unloading.

Loading follows F = A (exp(B d) - 1) (Hyncik & Bonkowski, section 2.2). Below the largest
compression d_m so far, unloading and reloading follow F = F_m (exp(C d) - 1) / (exp(C d_m) - 1),
with C such that the area under it is (1 - energy_loss) of the loading energy. In three dimensions d
is the length of the displacement and the force lies along it; each axis contributes its law with
the square of the direction's cosine, so that along an axis its own law holds, and equal laws make
an isotropic spring.

What follows makes the spring that of a liner. Nothing of it is fitted, and a helmet that bears at a
point has none of it. A displacement across the pressure counts as much less as foam is softer in
shear. A shell that rolls leaves crushed liner behind and comes down on fresh liner: it bears over
the patch in which the shell of local radius R = a b c / (a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2) (from
the Gaussian curvature of its ellipsoid) lies d below the plane, of radius sqrt(2 R d). Strips of
equal area across the roll, each an equal part of the spring with a memory of its own, are lowered
before the middle and raised behind it by the roll at their centroids. Where they bear unevenly the
force of the surface moves forward and brakes the roll.
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
from helmet_sim_ros.model.force.foam import POISSON
from helmet_sim_ros.model.force.vector import Vec, cross, dot, norm, row3, scaled, sub, turned_back
from helmet_sim_ros.model.helmet import Spring

#: Which law acts for each sense of the helmet's displacement in the head frame: -x +x -y +y -z +z.
SIDES = ("front", "back", "side", "side", "top", "strap")
#: Columns of ``CouplingSpring.law``.
SCALE, EXPONENT = 0, 1
#: A displacement across the pressure counts by this: a layer of foam is as stiff in shear as its
#: secant modulus over 2 (1 + nu) says, see :mod:`helmet_sim_ros.model.force.liner`.
SHEAR = (2.0 * (1.0 + POISSON)) ** -0.5
#: Strips that bear less unevenly than this lie across whatever roll there is; else they stay.
EVEN = 0.01
STRIPS = 8  # of the patch, from the trailing to the leading edge


def strips_of_disc(count: int) -> tuple[FloatArray, FloatArray]:
    """Strips of equal area across a disc of radius 1: centroids, and means of x^2, (count,)."""
    shares, low, high = np.linspace(0.0, 1.0, count + 1), -np.ones(count + 1), np.ones(count + 1)
    for _ in range(60):  # bisection: a worker loads nothing of SciPy that has a better one
        x = 0.5 * (low + high)
        below = (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / math.pi + 0.5 < shares
        low, high = np.where(below, x, low), np.where(below, high, x)
    x = 0.5 * (low + high)
    first = -2.0 / 3.0 * (1.0 - x * x) ** 1.5
    second = 0.25 * (np.arcsin(x) - x * np.sqrt(1.0 - x * x) * (1.0 - 2.0 * x * x))
    return np.diff(first) * count / math.pi, np.diff(second) * count / math.pi


#: Of each strip: centroid over the patch's radius, and the most that rolling alone can leave it
#: behind over the compression, the mean of x^2 / (2 R) in a patch of radius sqrt(2 R d).
PLACE, LEFT_BEHIND = strips_of_disc(STRIPS)


class CouplingSpring(NamedTuple):
    """The spring of one helmet; rows of ``law`` belong to ``SIDES``.

    Attributes:
        slide: index of its first slide in the generalised positions and, behind it, velocities;
            negative: a foam helmet, which has none.
        helmet: MuJoCo's index of the helmet body.
        law: A [N], B [1/m], (6, 2).
        energy_loss: share of the loading energy that is not given back [-].
        semi_axes: of the shell's ellipsoid [m]; all 0: it bears at a point.
        shear: of a displacement across the pressure, how much counts [-].
        past: largest compression so far, and the last one, (2,) [m]; state.
        behind: how far each strip of the patch is below its own largest compression, (strips,)
            [m]; state.
        along: direction of the roll across which the strips lie, world axes, all 0: none yet, (3,);
            state.
        forward: how far before the middle of the patch it bears, over its radius, (1,); state.
        normal: of what pressed the shell last, helmet frame, all 0: nothing yet, (3,); state.
    """

    slide: int
    slide_velocity: int
    helmet: int
    law: FloatArray
    energy_loss: float
    semi_axes: Vec
    shear: float
    past: FloatArray
    behind: FloatArray
    along: FloatArray
    forward: FloatArray
    normal: FloatArray


def law_table(spring: Spring) -> FloatArray:
    """Rows A [N], B [1/m] per side in the order of ``SIDES``, shape (6, 2)."""
    return np.array([[getattr(spring, side).A, getattr(spring, side).B] for side in SIDES])


def shear_of(spring: Spring) -> float:
    """How much of a displacement across the pressure counts [-]."""
    return 1.0 if spring.bears == "point" else SHEAR


def compressions(spring: Spring, displacement: FloatArray, pressed: FloatArray) -> FloatArray:
    """What a spring counts as its compression, (n,) [m].

    Args:
        displacement: helmet against head, helmet frame, (n, 3) [m].
        pressed: force of the surface across it, helmet frame, (n, 3); its last direction counts
            where there is none.
    """
    size = np.linalg.norm(pressed, axis=1)
    last = np.maximum.accumulate(np.where(size > 0.0, np.arange(len(size)), -1))
    known = last >= 0
    normal = np.where(known[:, None], pressed[last], 0.0)
    normal /= np.where(known, size[last], 1.0)[:, None]
    whole, along = (displacement**2).sum(axis=1), (normal * displacement).sum(axis=1) ** 2
    shear = np.where(known, shear_of(spring) ** 2, 1.0)
    counted: FloatArray = np.sqrt(along + shear * (whole - along))
    return counted


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
        shear_of(spring),
        np.zeros(2), np.zeros(STRIPS), np.zeros(3), np.zeros(1), np.zeros(3),
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
    if share < 0.05:  # the root of 1/u - exp(-u), to 1e-13
        return (1.0 - math.exp(-1.0 / share) / share) / (share * compression)
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
    """Carry on what each strip of the patch remembers.

    Args:
        spring: its state is changed in place.
        compression: at present [m].
        rolled: how much roll has lowered the leading edge of the patch, and raised the trailing
            one, since the last call [m].
    """
    past, behind = spring.past, spring.behind
    risen = past[1] - compression
    past[0], past[1] = max(past[0], compression), compression
    for i in range(STRIPS):
        most = past[0] - compression + LEFT_BEHIND[i] * compression
        behind[i] = min(max(0.0, behind[i] + risen - PLACE[i] * rolled), most)


@compiled
def counting(spring: CouplingSpring, vector: FloatArray) -> Vec:
    """A displacement or a force with what shear lets count of it across the pressure."""
    x, y, z = vector[0], vector[1], vector[2]
    n = spring.normal
    over = (1.0 - spring.shear) * (x * n[0] + y * n[1] + z * n[2])
    if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
        return x, y, z
    return (
        spring.shear * x + over * n[0], spring.shear * y + over * n[1],
        spring.shear * z + over * n[2],
    )  # fmt: skip


@compiled
def force_behind(
    spring: CouplingSpring, displacement: Vec, compression: float, behind: float
) -> float:
    """Force of a spring that is ``behind`` [m] its largest compression [N]."""
    force, peak = 0.0, compression + behind
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
        How far the middle of what the strips bear lies before that of the patch, over its radius.
    """
    counted = counting(spring, displacement)
    compression = norm(counted)
    force[:] = 0.0
    follow(spring, compression, rolled)
    if compression == 0.0:
        return 0.0
    total, forward, here, last = 0.0, 0.0, 0.0, -1.0
    for i in range(STRIPS):
        if spring.behind[i] != last:  # most strips are new to their compression, or all alike
            last = spring.behind[i]
            here = force_behind(spring, counted, compression, last) / STRIPS
        total += here
        forward += here * PLACE[i]
    for axis in range(3):
        force[axis] = -total * counted[axis] / compression
    force[0], force[1], force[2] = counting(spring, force)
    # As many strips lie before the middle as behind it: what bears alike adds up to rounding.
    return forward / total if abs(forward) > 1e-12 * total else 0.0


@compiled
def patch_radius(spring: CouplingSpring, compression: float) -> float:
    """Radius of the patch on which the shell bears at a compression [m], [m]."""
    (a, b, c), normal = spring.semi_axes, spring.normal
    stretched = (a * normal[0]) ** 2 + (b * normal[1]) ** 2 + (c * normal[2]) ** 2
    return float((2.0 * a * b * c / stretched * compression) ** 0.5)


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
    whole = row3(struck, FORCE)
    pressed = sub(whole, row3(struck, FRICTION))
    size, radius, rolled, along = norm(pressed), 0.0, 0.0, row3(spring.along, 0)
    if size > 0.0 and spring.semi_axes[0] > 0.0:
        helmet = rigid(motion, spring.helmet)
        normal = scaled(pressed, 1.0 / size)
        before = norm(counting(spring, displacement))
        spring.normal[0], spring.normal[1], spring.normal[2] = turned_back(helmet.rotation, normal)
        compression = norm(counting(spring, displacement))
        for k in range(2):  # where the pressure turns, nothing is crushed and nothing let go
            spring.past[k] = max(0.0, spring.past[k] + compression - before)
        radius = patch_radius(spring, compression)
        roll = cross(helmet.spin, normal)
        rate = norm(roll)
        if abs(spring.forward[0]) < EVEN and rate > 0.0:
            along = scaled(roll, 1.0 / rate)
        spring.along[0], spring.along[1], spring.along[2] = along
        rolled = radius * dot(roll, along) * step
    forward = spring.forward[0] = spring_force(spring, displacement, rolled, loads.spring)
    if forward != 0.0 and radius > 0.0:
        couple = cross(scaled(along, radius * forward), whole)
        load(loads, spring.helmet, (0.0, 0.0, 0.0), couple)
        count_surface(loads, HELMET, (0.0, 0.0, 0.0), couple, (0.0, 0.0, 0.0))
    for k in range(3):
        loads.generalised[spring.slide_velocity + k] += loads.spring[k]


@compiled
def recoverable_energy(spring: CouplingSpring, displacement: FloatArray) -> float:
    """Energy that the spring would still give back at a displacement (3,) [m] in its present
    state [J]: the area under the strips' unloading paths from 0 to the present compression."""
    counted, energy = counting(spring, displacement), 0.0
    compression = norm(counted)
    for axis in range(3):
        if counted[axis] == 0.0:
            continue
        side = 2 * axis if counted[axis] < 0.0 else 2 * axis + 1
        scale, exponent = spring.law[side, SCALE], spring.law[side, EXPONENT]
        share = (counted[axis] / compression) ** 2 / STRIPS
        for behind in spring.behind:
            peak = compression + behind
            path = unloading_exponent(exponent, peak, spring.energy_loss)
            force = unloading_force(peak, loading_force(scale, exponent, peak), path, compression)
            energy += share * force * compression * exponential_share(path * compression)
    return energy
