"""The coupling spring between head and shell: exponential loading, exponential unloading.

Loading follows F = A (exp(B d) - 1) (Hyncik & Bonkowski, section 2.2). Below the largest
compression d_m so far, unloading and reloading follow F = F_m (exp(C d) - 1) / (exp(C d_m) - 1),
with C such that the area under it is (1 - energy_loss) of the loading energy.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.helmet import Spring

#: Which law acts for each sense of the helmet's displacement in the head frame: -x +x -y +y -z +z.
SIDES = ("front", "back", "side", "side", "top", "strap")


def law_table(spring: Spring) -> FloatArray:
    """Rows A [N], B [1/m] per side in the order of ``SIDES``, shape (6, 2)."""
    return np.array([[getattr(spring, side).A, getattr(spring, side).B] for side in SIDES])


def new_state() -> FloatArray:
    """Virgin spring: per side the largest compression [m], its force [N], the unloading
    exponent C [1/m] (0: not yet known); shape (6, 3)."""
    return np.zeros((6, 3))


@njit(cache=True, nogil=True)
def loading_force(scale: float, exponent: float, compression: float) -> float:
    """F = A (exp(B d) - 1) [N]."""
    return scale * math.expm1(exponent * compression)


@njit(cache=True, nogil=True)
def exponential_share(u: float) -> float:
    """Area under (exp(u s) - 1) / (exp(u) - 1) for s from 0 to 1: 1/u - 1/(exp(u) - 1)."""
    if u < 1e-2:  # the difference of two large numbers; series to u^3, error below 1e-13
        return 0.5 - u / 12.0 + u**3 / 720.0
    return 1.0 / u - math.exp(-u) / -math.expm1(-u)


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def unloading_force(peak: float, force: float, exponent: float, compression: float) -> float:
    """Force [N] on the unloading path through (peak [m], force [N]); stable for any exponent."""
    return (
        force
        * math.exp(exponent * (compression - peak))
        * math.expm1(-exponent * compression)
        / math.expm1(-exponent * peak)
    )


@njit(cache=True, nogil=True)
def spring_force(
    displacement: FloatArray,
    law: FloatArray,
    energy_loss: float,
    state: FloatArray,
    force: FloatArray,
) -> None:
    """Force on the shell, against its displacement, axis by axis; updates ``state``.

    Args:
        displacement: helmet against head, head axes, shape (3,) [m].
        law: see :func:`law_table`.
        energy_loss: share of the loading energy not given back.
        state: see :func:`new_state`; changed in place.
        force: shape (3,) [N]; written.
    """
    for axis in range(3):
        backwards = displacement[axis] < 0.0
        side = 2 * axis if backwards else 2 * axis + 1
        compression = abs(displacement[axis])
        if compression >= state[side, 0]:
            value = loading_force(law[side, 0], law[side, 1], compression)
            state[side, 0] = compression
            state[side, 1] = value
            state[side, 2] = 0.0
        else:
            if state[side, 2] == 0.0:
                state[side, 2] = unloading_exponent(law[side, 1], state[side, 0], energy_loss)
            value = unloading_force(state[side, 0], state[side, 1], state[side, 2], compression)
        force[axis] = value if backwards else -value


def recoverable_energy(displacement: FloatArray, spring: Spring) -> FloatArray:
    """Energy that the spring would still give back at each sample.

    Args:
        displacement: history from the virgin spring, head axes, shape (n, 3) [m].

    Returns:
        Shape (n,) [J]: the area under the unloading path from 0 to the present compression.
    """
    law = law_table(spring)
    energy = np.zeros(len(displacement))
    for side in range(6):
        sense = -1.0 if side % 2 == 0 else 1.0
        compression = np.maximum(sense * displacement[:, side // 2], 0.0)
        peak = np.maximum.accumulate(compression)
        for i in np.flatnonzero(compression > 0.0):
            c = unloading_exponent(law[side, 1], peak[i], spring.energy_loss)
            force = unloading_force(
                peak[i], loading_force(law[side, 0], law[side, 1], peak[i]), c, compression[i]
            )
            energy[i] += force * compression[i] * exponential_share(c * compression[i])
    return energy
