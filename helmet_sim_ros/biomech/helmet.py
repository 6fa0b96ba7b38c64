"""Criteria of the helmet: ground force, friction, compression of the coupling."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import FloatArray, finite_array, magnitude


def ground_components(ground_force: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Normal and tangential amount of the ground force, each (n,) [N].

    Args:
        ground_force: force of the ground on the helmet, world axes (z up), shape (n, 3) [N].

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    force = finite_array("ground_force", ground_force, 3)
    return np.maximum(force[:, 2], 0.0), np.hypot(force[:, 0], force[:, 1])


def peak_force_ratio(ground_force: ArrayLike) -> float:
    """Ratio of the peak tangential to the peak normal ground force.

    The two peaks need not coincide in time (Hyncik & Bonkowski, Table 1).

    Args:
        ground_force: force of the ground on the helmet, world axes, shape (n, 3) [N].

    Returns:
        max F_t / max F_n [-]; 0 where the helmet never touches.

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    normal, tangential = ground_components(ground_force)
    peak = float(normal.max())
    return float(tangential.max()) / peak if peak > 0.0 else 0.0


def compression(coupling_displacement: ArrayLike) -> FloatArray:
    """Amount of the displacement of the helmet against the head, shape (n,) [m].

    Args:
        coupling_displacement: signed per head axis, shape (n, 3) [m].

    Raises:
        PulseError: wrong shape, or a value that is not finite.
    """
    return magnitude(finite_array("coupling_displacement", coupling_displacement, 3))
