"""Loads of the neck. Head axes: x forward, y left, z up; force of the torso ON the head."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import FloatArray, finite_array


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
        PulseError: wrong shape, or a value that is not finite.
    """
    fx, fy, fz = finite_array("neck_force", neck_force, 3).T
    mx, my, mz = finite_array("neck_torque", neck_torque, 3).T
    return NeckLoads(
        compression=np.maximum(fz, 0.0),
        tension=np.maximum(-fz, 0.0),
        shear=np.hypot(fx, fy),
        bending=np.hypot(mx, my),
        torsion=np.abs(mz),
    )
