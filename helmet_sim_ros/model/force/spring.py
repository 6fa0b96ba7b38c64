"""The coupling spring between head and shell: exponential loading, exponential unloading.

Loading follows F = A (exp(B d) - 1) (Hyncik & Bonkowski, section 2.2). Below the largest
compression d_m so far, unloading and reloading follow F = F_m (exp(C d) - 1) / (exp(C d_m) - 1),
with C such that the area under it is (1 - energy_loss) of the loading energy. In three dimensions d
is the length of the displacement and the force lies along it; each axis contributes its law with
the square of the direction's cosine, so that along an axis its own law holds, and equal laws make
an isotropic spring.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.helmet import Spring

#: Which law acts for each sense of the helmet's displacement in the head frame: -x +x -y +y -z +z.
SIDES = ("front", "back", "side", "side", "top", "strap")


class CouplingSpring(NamedTuple):
    """The spring of one helmet; rows of the arrays belong to ``SIDES``.

    Attributes:
        slide: index of its first slide in the generalised positions and, behind it, velocities;
            negative: a foam helmet, which has none.
        law: A [N], B [1/m], (6, 2).
        energy_loss: share of the loading energy that is not given back [-].
        largest: largest compression so far in any direction, (1,) [m]; state.
        path: of each side: that compression [m] when the rest was found, its force [N], the
            unloading exponent C [1/m], (6, 3); state.
    """

    slide: int
    slide_velocity: int
    law: FloatArray
    energy_loss: float
    largest: FloatArray
    path: FloatArray


#: Columns of ``CouplingSpring.law`` and ``CouplingSpring.path``.
SCALE, EXPONENT = 0, 1
LARGEST, LARGEST_FORCE, UNLOADING = 0, 1, 2


def law_table(spring: Spring) -> FloatArray:
    """Rows A [N], B [1/m] per side in the order of ``SIDES``, shape (6, 2)."""
    return np.array([[getattr(spring, side).A, getattr(spring, side).B] for side in SIDES])


def coupling_spring(spring: Spring, slide: int = 0, slide_velocity: int = 0) -> CouplingSpring:
    """The virgin spring of a configuration."""
    path = np.zeros((len(SIDES), 3))
    return CouplingSpring(
        slide, slide_velocity, law_table(spring), spring.energy_loss, np.zeros(1), path
    )


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
    low = exponent * compression
    high = 1.0 / share + low  # exponential_share(u) < 1/u
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if exponential_share(middle) > share:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high) / compression


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
def spring_force(spring: CouplingSpring, displacement: FloatArray, force: FloatArray) -> None:
    """Force on the shell, against its displacement.

    Args:
        spring: its state is changed in place.
        displacement: helmet against head, head axes, shape (3,) [m].
        force: shape (3,) [N]; written.
    """
    x, y, z = displacement[0], displacement[1], displacement[2]
    compression = (x * x + y * y + z * z) ** 0.5
    force[:] = 0.0
    if compression == 0.0:
        return
    law, path = spring.law, spring.path
    loading = compression >= spring.largest[0]
    if loading:
        spring.largest[0] = compression
    largest = spring.largest[0]
    value = 0.0
    for axis in range(3):
        share = displacement[axis] / compression
        side = 2 * axis if share < 0.0 else 2 * axis + 1
        scale, exponent = law[side, SCALE], law[side, EXPONENT]
        if loading:
            value += share * share * loading_force(scale, exponent, compression)
            continue
        if path[side, LARGEST] != largest:  # first time below this peak on this side
            path[side, LARGEST] = largest
            path[side, LARGEST_FORCE] = loading_force(scale, exponent, largest)
            path[side, UNLOADING] = unloading_exponent(exponent, largest, spring.energy_loss)
        value += (
            share
            * share
            * unloading_force(
                largest, path[side, LARGEST_FORCE], path[side, UNLOADING], compression
            )
        )
    for axis in range(3):
        force[axis] = -value * displacement[axis] / compression


@inlined
def apply(spring: CouplingSpring, motion: Motion, loads: Loads) -> None:
    """Add the spring's force to the slides of the shell against the head."""
    spring_force(spring, motion.qpos[spring.slide : spring.slide + 3], loads.spring)
    for k in range(3):
        loads.generalised[spring.slide_velocity + k] += loads.spring[k]


@compiled
def held_energy(spring: CouplingSpring, displacement: FloatArray) -> float:
    """What the spring would give back now [J], see :func:`recoverable_energy`."""
    compression, energy = 0.0, 0.0
    for k in range(3):
        compression += displacement[k] ** 2
    compression = compression**0.5
    if compression == 0.0:
        return 0.0
    largest = max(spring.largest[0], compression)
    for axis in range(3):
        share = displacement[axis] / compression
        side = 2 * axis if share < 0.0 else 2 * axis + 1
        scale, exponent = spring.law[side, SCALE], spring.law[side, EXPONENT]
        c = unloading_exponent(exponent, largest, spring.energy_loss)
        force = unloading_force(largest, loading_force(scale, exponent, largest), c, compression)
        energy += share**2 * force * compression * exponential_share(c * compression)
    return energy


def recoverable_energy(displacement: FloatArray, spring: Spring) -> FloatArray:
    """Energy that the spring would still give back at each sample.

    Args:
        displacement: history from the virgin spring, head axes, shape (n, 3) [m].

    Returns:
        Shape (n,) [J]: the area under the unloading path from 0 to the present compression.
    """
    law = law_table(spring)
    energy = np.zeros(len(displacement))
    compression = np.linalg.norm(displacement, axis=1)
    peak = np.maximum.accumulate(compression)
    for side in range(6):
        sense = -1.0 if side % 2 == 0 else 1.0
        along = np.maximum(sense * displacement[:, side // 2], 0.0)
        scale, exponent = law[side]
        for i in np.flatnonzero(along > 0.0):
            c = unloading_exponent(exponent, peak[i], spring.energy_loss)
            force = unloading_force(
                peak[i], loading_force(scale, exponent, peak[i]), c, compression[i]
            )
            share = (along[i] / compression[i]) ** 2
            energy[i] += share * force * compression[i] * exponential_share(c * compression[i])
    return energy
