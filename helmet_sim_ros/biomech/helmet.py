"""Criteria of the helmet: ground force, friction, compression of the coupling, rebound."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import (
    FloatArray,
    finite_array,
    magnitude,
    positive,
    real_number,
    same_length,
)
from helmet_sim_ros.biomech.record import HORIZONTAL

#: Share of the peak normal force below which no instantaneous force ratio is formed: at first
#: touch and lift-off both forces vanish and their quotient says nothing.
CONTACT_LEVEL = 0.05


class Energy(NamedTuple):
    """Work done on the coupling [J]: the most it held, and what it kept to the end."""

    peak: float
    absorbed: float


def ground_components(
    ground_force: ArrayLike, ground_friction: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Normal and tangential amount of the ground force, each (n,) [N].

    Args:
        ground_force: force of the surface on the helmet, world axes (z up), shape (n, 3) [N].
        ground_friction: its part along the surface, shape (n, 3) [N]; unset: the ground is flat,
            and that part is x and y.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return normal_and_tangential(*_parts(ground_force, ground_friction))


def _parts(
    ground_force: ArrayLike, ground_friction: ArrayLike | None
) -> tuple[FloatArray, FloatArray]:
    """The force normal to the surface and along it, each (n, 3) [N]; flat ground cannot pull."""
    force = finite_array("ground_force", ground_force, 3)
    if ground_friction is None:
        friction = force * HORIZONTAL
        return np.maximum(force - friction, 0.0), friction
    friction = finite_array("ground_friction", ground_friction, 3)
    return force - friction, friction


def normal_and_tangential(
    normal: FloatArray, friction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The amounts of both parts of a force, (n, 3) each."""
    return magnitude(normal), magnitude(friction)


def peak_force_ratio(ground_force: ArrayLike, ground_friction: ArrayLike | None = None) -> float:
    """Ratio of the peak tangential to the peak normal ground force.

    The two peaks need not coincide in time (Hyncik & Bonkowski, Table 1).

    Args:
        ground_force, ground_friction: see :func:`ground_components`.

    Returns:
        max F_t / max F_n [-]; 0 where the helmet never touches.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return ratio_of_peaks(*ground_components(ground_force, ground_friction))


def instant_force_ratio(
    ground_force: ArrayLike, ground_friction: ArrayLike | None = None
) -> tuple[float, int]:
    """Largest F_t / F_n [-] at one instant, and its sample; 0 where the helmet never touches.

    Only while the normal force is above ``CONTACT_LEVEL`` of its peak.

    Args:
        ground_force, ground_friction: see :func:`ground_components`.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return largest_ratio(*ground_components(ground_force, ground_friction))


def impulse_ratio(ground_force: ArrayLike, ground_friction: ArrayLike | None = None) -> float:
    """Amount of the tangential over the normal impulse of the ground [-]; 0 without contact.

    Both are integrated as vectors, so a reversal of friction counts.

    Args:
        ground_force, ground_friction: see :func:`ground_components`; uniform in time.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return ratio_of_impulses(*_parts(ground_force, ground_friction))


def ratio_of_peaks(normal: FloatArray, tangential: FloatArray) -> float:
    """:func:`peak_force_ratio` of the two amounts, each (n,)."""
    peak = float(normal.max())
    return float(tangential.max()) / peak if peak > 0.0 else 0.0


def largest_ratio(normal: FloatArray, tangential: FloatArray) -> tuple[float, int]:
    """:func:`instant_force_ratio` of the two amounts, each (n,)."""
    pressed = normal > CONTACT_LEVEL * normal.max()
    ratio = np.divide(tangential, normal, out=np.zeros_like(normal), where=pressed)
    i = int(ratio.argmax())
    return float(ratio[i]), i


def ratio_of_impulses(normal: FloatArray, friction: FloatArray) -> float:
    """:func:`impulse_ratio` of the two parts, (n, 3) each."""
    pressed = math.hypot(*_impulse(normal))
    return math.hypot(*_impulse(friction)) / pressed if pressed > 0.0 else 0.0


def contact_normal(normal: FloatArray) -> FloatArray:
    """The direction of the normal impulse, shape (3,); upwards where nothing touches.

    Args:
        normal: force normal to the surface, shape (n, 3) [N].
    """
    impulse = _impulse(normal)
    amount = math.hypot(*impulse)
    return np.divide(impulse, amount) if amount > 0.0 else np.array([0.0, 0.0, 1.0])


def _impulse(force: FloatArray) -> list[float]:
    """By the trapezoidal rule, in time steps, (3,)."""
    total: list[float] = (force.sum(axis=0) - 0.5 * (force[0] + force[-1])).tolist()
    return total


def compression(coupling_displacement: ArrayLike) -> FloatArray:
    """Amount of the displacement of the helmet against the head, shape (n,) [m].

    Args:
        coupling_displacement: signed per head axis, shape (n, 3) [m].

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return magnitude(finite_array("coupling_displacement", coupling_displacement, 3))


def bottoming(peak_compression: float, thickness: float) -> float:
    """Share of the liner's thickness that the peak compression uses up [-].

    EPS densifies from a share of about 0.6 to 0.7 on (general literature value).

    Raises:
        PulseError: not a number, or a thickness that is not above 0.
    """
    return real_number("peak_compression", peak_compression) / positive("thickness", thickness, "m")


def coupling_energy(coupling_force: ArrayLike, coupling_displacement: ArrayLike) -> Energy:
    """Work of the compression on the coupling, the integral of F dd.

    Args:
        coupling_force: force of the helmet on the head, head axes, shape (n, 3) [N].
        coupling_displacement: helmet against head, head axes, shape (n, 3) [m].

    Returns:
        The largest value on the way and the value at the last sample [J]. The latter is what the
        coupling has absorbed once it is unloaded.

    Raises:
        PulseError: wrong or different shapes, or a value that is not finite.
    """
    force = finite_array("coupling_force", coupling_force, 3)
    displacement = finite_array("coupling_displacement", coupling_displacement, 3)
    same_length(coupling_force=force, coupling_displacement=displacement)
    return work(force, displacement)


def work(force: FloatArray, displacement: FloatArray) -> Energy:
    """:func:`coupling_energy` of checked signals, each (n, 3)."""
    path = displacement[1:] - displacement[:-1]
    steps = 0.5 * (force[1:] + force[:-1]) * path
    done = np.cumsum(steps[:, 0] + steps[:, 1] + steps[:, 2])
    return Energy(max(float(done.max()), 0.0), float(done[-1]))


def restitution(normal_velocity: ArrayLike) -> float | None:
    """Speed of rebound over speed of approach of the head, along the ground's normal [-].

    Args:
        normal_velocity: velocity away from the ground, shape (n,) [m/s].

    Returns:
        Largest rebound speed over the first sample's approach speed; None if the head does not
        approach at first, or has not turned back by the end.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return rebound_ratio(finite_array("normal_velocity", normal_velocity))


def rebound_ratio(speed: FloatArray) -> float | None:
    """:func:`restitution` of a checked velocity, (n,)."""
    approach, rebound = -float(speed[0]), float(speed.max())
    return rebound / approach if approach > 0.0 and rebound > 0.0 else None
