"""The one stepping loop: coupling and contact forces in, samples out; compiled by numba.

``mj_step`` is taken in its two halves, so that the forces see the present positions and
velocities and not those of the step before. The loop calls MuJoCo's C functions directly and
works on numpy views of MuJoCo's arrays, so it costs hardly more than ``mj_step`` itself and
releases the interpreter lock.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model import contact, coupling, foam, liner, stops
from helmet_sim_ros.model.contact import ground_contact
from helmet_sim_ros.model.coupling import spring_force
from helmet_sim_ros.model.liner import crush, head_friction
from helmet_sim_ros.model.stops import stop_torques


def _link_mujoco() -> None:
    """Make MuJoCo's C functions known to compiled code by name (so that it can be cached)."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(folder.glob("libmujoco.*")) or sorted(folder.glob("mujoco.dll"))
    if not libraries:
        raise ImportError(f"no MuJoCo library in {folder}")
    llvmlite.binding.load_library_permanently(str(libraries[0]))
    if mujoco.get_mju_user_warning() is None:
        # A diverged state is reported as DivergedError; MuJoCo would also leave MUJOCO_LOG.TXT.
        mujoco.set_mju_user_warning(logging.getLogger(__name__).debug)


_link_mujoco()
_signature: Any = types.void(types.intp, types.intp)
_mj_step1: Any = types.ExternalFunction("mj_step1", _signature)
_mj_step2: Any = types.ExternalFunction("mj_step2", _signature)


@njit(cache=True, nogil=True)
def advance(
    model: int,
    data: int,
    step: float,
    substeps: int,
    first: int,
    last: int,
    states: tuple[FloatArray, ...],
    frames: tuple[FloatArray, ...],
    forces: tuple[FloatArray, FloatArray],
    slides: tuple[int, int, int, int],
    spring: tuple[FloatArray, float, FloatArray],
    shapes: tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray, FloatArray],
    foam_liner: tuple[
        FloatArray, FloatArray, float, FloatArray, FloatArray, FloatArray, FloatArray
    ],
    joint_stops: tuple[NDArray[np.int64], FloatArray],
    samples: tuple[FloatArray, ...],
) -> int:
    """Step from sample ``first`` up to ``last``; each row is the state before its step.

    Args:
        model, data: addresses of mjModel and mjData.
        step: integration step [s].
        substeps: integration steps per sample.
        states: views of qpos, qvel, qacc, sensordata.
        frames: views of xpos, xmat, xipos, cvel and the row of subtree_com of the tree's root.
        forces: views of qfrc_applied and xfrc_applied.
        slides: index of the first coupling slide in qpos and in qvel (negative: a foam helmet,
            which has none), and the bodies of helmet and head.
        spring: law table, energy loss, state; see :mod:`helmet_sim_ros.model.coupling`.
        shapes: body, centre, semi-axes, law, stick; see :mod:`helmet_sim_ros.model.contact`.
        foam_liner: geometry, foam, friction, largest strains and stick of the foam columns (no rows
            for a spring helmet); constants of the padding, stick of the head in it. See
            :mod:`helmet_sim_ros.model.liner`.
        joint_stops: joint addresses and laws; see :mod:`helmet_sim_ros.model.stops`.
        samples: rows of qpos, qvel, sensordata, the spring's force on the shell (3) and the
            ground's two wrenches (2, 6) to write.

    Returns:
        ``last``, or the index of the first sample whose acceleration is not finite.
    """
    qpos, qvel, qacc, sensors = states
    xpos, xmat, xipos, cvel, center_of_mass = frames
    generalised, cartesian = forces
    law, energy_loss, spring_state = spring
    body, center, semi_axes, contact_law, stick = shapes
    q_rows, v_rows, sensor_rows, spring_rows, wrench_rows = samples
    columns, foam_rows, friction, largest, shear, padding, slip = foam_liner
    q0, v0, helmet, head = slides
    scratch_force, scratch_wrench = np.zeros(3), np.zeros((2, 6))
    for i in range(first, last):
        for substep in range(substeps):
            sampled = substep == 0
            force = spring_rows[i] if sampled else scratch_force
            wrench = wrench_rows[i] if sampled else scratch_wrench
            _mj_step1(model, data)
            if q0 >= 0:
                spring_force(qpos[q0 : q0 + 3], law, energy_loss, spring_state, force)
                generalised[v0 : v0 + 3] = force
            stop_torques(joint_stops[0], joint_stops[1], qpos, qvel, generalised)
            cartesian[:] = 0.0
            ground_contact(
                helmet, body, center, semi_axes, contact_law, stick, step,
                xpos, xmat, xipos, cvel, center_of_mass, cartesian, wrench,
            )  # fmt: skip
            if q0 < 0:
                crush(
                    columns, foam_rows, friction, step, largest, shear, xpos[helmet], xmat[helmet],
                    cvel[helmet], center_of_mass, xipos[helmet], cartesian[helmet], wrench[0],
                )  # fmt: skip
                head_friction(
                    padding[0], padding[1], padding[2], padding[3], wrench[0, 2], step, slip,
                    xpos[head], cvel[helmet], cvel[head], xipos[helmet], cartesian[helmet],
                    cartesian[head],
                )  # fmt: skip
            if sampled:
                q_rows[i] = qpos
                v_rows[i] = qvel
            _mj_step2(model, data)
            if sampled:
                sensor_rows[i] = sensors
            if not abs(qacc.sum()) < 1e12:  # also true for NaN
                return i
    return last


def _forget_stale_code() -> None:
    """Drop cached machine code older than any of the functions it was built from.

    Numba compares the cache with this file only, not with the files of the functions it calls.
    """
    cache = Path(str(advance.stats.cache_path))
    sources = [str(module.__file__) for module in (contact, coupling, foam, liner, stops)]
    changed = max(Path(source).stat().st_mtime for source in sources)
    for file in cache.glob(f"{Path(__file__).stem}.advance-*"):
        if file.stat().st_mtime < changed:
            file.unlink(missing_ok=True)


_forget_stale_code()
