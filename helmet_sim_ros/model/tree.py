"""Forces on bodies: from them to generalised forces, along MuJoCo's kinematic tree.

The same as MuJoCo does with ``xfrc_applied``, without a dense Jacobian per body.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray

WORLD_ORIGIN = np.zeros(3)  # m

#: The last degree of freedom that moves each body, shape (bodies,), and the one that each
#: degree of freedom hangs on, shape (nv,); -1: none.
Chains = tuple[NDArray[np.int64], NDArray[np.int64]]


def chains(model: mujoco.MjModel) -> Chains:
    """The chains of degrees of freedom of a model."""
    last = np.full(model.nbody, -1, dtype=np.int64)
    first, count, parents = model.body_dofadr, model.body_dofnum, model.body_parentid
    for body in range(1, model.nbody):  # parents come first
        moves = count[body] > 0
        last[body] = first[body] + count[body] - 1 if moves else last[parents[body]]
    return last, model.dof_parentid.astype(np.int64)


@njit(cache=True, nogil=True)
def add_force(
    wrench: FloatArray,
    about: FloatArray,
    px: float,
    py: float,
    pz: float,
    fx: float,
    fy: float,
    fz: float,
) -> None:
    """Add a force at a point to a force and its moment (6,) about ``about``, world axes."""
    ax, ay, az = px - about[0], py - about[1], pz - about[2]
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += fz
    wrench[3] += ay * fz - az * fy
    wrench[4] += az * fx - ax * fz
    wrench[5] += ax * fy - ay * fx


@njit(cache=True, nogil=True)
def add_generalised(
    wrenches: FloatArray,
    last: NDArray[np.int64],
    parent: NDArray[np.int64],
    cdof: FloatArray,
    generalised: FloatArray,
) -> None:
    """Add what the wrenches do along each degree of freedom.

    Args:
        wrenches: force and moment on each body about the tree's centre of mass, (bodies, 6).
        last, parent: see :data:`Chains`.
        cdof: MuJoCo's axes of motion about that point, rotation first, (nv, 6).
        generalised: (nv,); added to.
    """
    for body in range(len(wrenches)):
        fx, fy, fz, mx, my, mz = wrenches[body]
        if fx == 0.0 and fy == 0.0 and fz == 0.0 and mx == 0.0 and my == 0.0 and mz == 0.0:
            continue
        dof = last[body]
        while dof >= 0:
            c = cdof[dof]
            generalised[dof] += (
                c[0] * mx + c[1] * my + c[2] * mz + c[3] * fx + c[4] * fy + c[5] * fz
            )
            dof = parent[dof]


@njit(cache=True, nogil=True)
def about_mass_centers(
    wrenches: FloatArray, origin: FloatArray, xipos: FloatArray, moved: FloatArray
) -> None:
    """The wrenches about ``origin`` as ``xfrc_applied``, which MuJoCo's force sensors read.

    Args:
        wrenches: force and moment on each body about ``origin``, (bodies, 6).
        origin: (3,) [m].
        xipos: the bodies' mass centres, (bodies, 3) [m].
        moved: the same wrenches about those, (bodies, 6); written.
    """
    moved[:] = 0.0
    for body in range(len(wrenches)):
        fx, fy, fz, mx, my, mz = wrenches[body]
        moved[body, 3:] = mx, my, mz
        add_force(moved[body], xipos[body], origin[0], origin[1], origin[2], fx, fy, fz)
