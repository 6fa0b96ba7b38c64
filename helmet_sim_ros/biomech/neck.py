"""Loads of the neck. Head axes: x forward, y left, z up; force of the torso ON the head."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import FloatArray, finite_array, same_length


class NeckLoads(NamedTuple):
    """Amounts, each of shape (n,).

    Attributes:
        compression: axial force pressing the neck together, 0 in tension [N].
        tension: axial force pulling the neck, 0 in compression [N].
        shear: force across the neck [N].
        bending: moment about axes across the neck [N m].
        torsion: moment about the neck's axis [N m].
    """

    compression: FloatArray
    tension: FloatArray
    shear: FloatArray
    bending: FloatArray
    torsion: FloatArray


def neck_loads(neck_force: ArrayLike, neck_torque: ArrayLike) -> NeckLoads:
    """The loads of the neck by kind.

    Args:
        neck_force: shape (n, 3) [N]. A compressed neck pushes the head up, z > 0.
        neck_torque: moment about the head-neck joint, shape (n, 3) [N m].

    Raises:
        PulseError: wrong or different shapes, or a value that is not finite.
    """
    force = finite_array("neck_force", neck_force, 3)
    torque = finite_array("neck_torque", neck_torque, 3)
    same_length(neck_force=force, neck_torque=torque)
    return NeckLoads(
        compression(force), tension(force), across(force), across(torque), torsion(torque)
    )


def compression(force: FloatArray) -> FloatArray:
    """Axial force pressing the neck together, (n,), of a checked force, (n, 3)."""
    return np.maximum(force[:, 2], 0.0)


def tension(force: FloatArray) -> FloatArray:
    """Axial force pulling the neck, (n,), of a checked force, (n, 3)."""
    return np.maximum(-force[:, 2], 0.0)


def across(load: FloatArray) -> FloatArray:
    """Shear of a checked force, or bending of a checked moment, (n, 3) -> (n,)."""
    return np.hypot(load[:, 0], load[:, 1])


def torsion(torque: FloatArray) -> FloatArray:
    """Amount of the moment about the neck's axis, (n,), of a checked moment, (n, 3)."""
    return np.abs(torque[:, 2])
