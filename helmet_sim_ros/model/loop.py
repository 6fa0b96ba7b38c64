"""The one stepping loop: coupling and contact forces in, samples out; compiled by numba.

``mj_step`` is taken apart, so that the forces see the present positions and velocities and not
those of the step before. Left out is what this model has no use for (collisions, constraints,
actuators) and, between samples, the present acceleration and the sensors. The integrator is
MuJoCo's Euler, implicit in the joints' damping D: (M + h D) a = F, v += h a, q += h v.

The loop calls MuJoCo's C functions directly and works on numpy views of MuJoCo's arrays; with all
forces it costs about as much as ``mj_step`` alone, and it releases the interpreter lock.
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
from helmet_sim_ros.model import contact, coupling, foam, liner, stops, tree
from helmet_sim_ros.model.contact import ground_contact
from helmet_sim_ros.model.coupling import spring_force
from helmet_sim_ros.model.liner import crush, head_friction
from helmet_sim_ros.model.stops import stop_torques
from helmet_sim_ros.model.tree import about_mass_centers, add_generalised


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


def _mujoco_function(name: str) -> Any:
    """A C function of model and data."""
    return types.ExternalFunction(name, types.void(types.intp, types.intp))


_kinematics, _com_pos = _mujoco_function("mj_kinematics"), _mujoco_function("mj_comPos")
_make_m, _factor_m = _mujoco_function("mj_makeM"), _mujoco_function("mj_factorM")
_velocity = _mujoco_function("mj_fwdVelocity")
_acceleration = _mujoco_function("mj_fwdAcceleration")
_rne_post = _mujoco_function("mj_rnePostConstraint")
_sensor_pos, _sensor_vel = _mujoco_function("mj_sensorPos"), _mujoco_function("mj_sensorVel")
_sensor_acc = _mujoco_function("mj_sensorAcc")
_integrate_pos: Any = types.ExternalFunction(
    "mj_integratePos", types.void(types.intp, types.intp, types.intp, types.double)
)


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
    inertia: tuple[FloatArray, NDArray[np.int64], FloatArray],
    chains: tuple[NDArray[np.int64], NDArray[np.int64]],
    slides: tuple[int, int, int, int],
    spring: tuple[FloatArray, float, FloatArray],
    shapes: tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray, FloatArray],
    foam_liner: tuple[
        FloatArray, FloatArray, float, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
    ],
    near: tuple[NDArray[np.int64], FloatArray],
    joint_stops: tuple[NDArray[np.int64], FloatArray],
    samples: tuple[FloatArray, ...],
) -> int:
    """Step from sample ``first`` up to ``last``; each row is the state before its step.

    Args:
        model, data: addresses of mjModel and mjData.
        step: integration step [s].
        substeps: integration steps per sample.
        states: views of qpos, qvel, qacc, qacc_smooth, sensordata.
        frames: views of xpos, xmat, xipos, cvel, cdof and the row of subtree_com of the tree's
            root.
        forces: views of qfrc_applied and xfrc_applied.
        inertia: view of M, index of its diagonal, what the joints' damping adds there.
        chains: see :mod:`helmet_sim_ros.model.tree`.
        slides: index of the first coupling slide in qpos and in qvel (negative: a foam helmet,
            which has none), and the bodies of helmet and head.
        spring: law table, energy loss, state; see :mod:`helmet_sim_ros.model.coupling`.
        shapes: body, centre, semi-axes, law, stick; see :mod:`helmet_sim_ros.model.contact`.
        foam_liner: geometry, foam, friction, largest and residual strains and stick of the foam
            columns (no rows for a spring helmet); constants of the padding, stick of the head in
            it. See :mod:`helmet_sim_ros.model.liner`.
        near: which columns may touch the ground; see there.
        joint_stops: joint addresses and laws; see :mod:`helmet_sim_ros.model.stops`.
        samples: rows of qpos, qvel, sensordata, the spring's force on the shell (3) and the
            ground's two wrenches (2, 6) to write.

    Returns:
        ``last``, or the index of the first sample at or after which the acceleration is not finite.
    """
    qpos, qvel, qacc, acceleration, sensors = states
    xpos, xmat, xipos, cvel, cdof, center_of_mass = frames
    generalised, cartesian = forces
    mass, diagonal, damping = inertia
    law, energy_loss, spring_state = spring
    body, center, semi_axes, contact_law, stick = shapes
    q_rows, v_rows, sensor_rows, spring_rows, wrench_rows = samples
    columns, foam_rows, friction, largest, rest, shear, padding, slip = foam_liner
    q0, v0, helmet, head = slides
    damped = damping.any()
    scratch_force, scratch_wrench = np.zeros(3), np.zeros((2, 6))
    wrenches = np.zeros(cartesian.shape)
    for i in range(first, last):
        for substep in range(substeps):
            sampled = substep == 0
            force = spring_rows[i] if sampled else scratch_force
            wrench = wrench_rows[i] if sampled else scratch_wrench
            _kinematics(model, data)
            _com_pos(model, data)
            _make_m(model, data)
            _velocity(model, data)

            generalised[:] = 0.0
            if q0 >= 0:
                spring_force(qpos[q0 : q0 + 3], law, energy_loss, spring_state, force)
                generalised[v0 : v0 + 3] = force
            stop_torques(joint_stops[0], joint_stops[1], qpos, qvel, generalised)
            wrenches[:] = 0.0
            ground_contact(
                helmet, body, center, semi_axes, contact_law, stick, step,
                xpos, xmat, cvel, center_of_mass, wrenches, wrench,
            )  # fmt: skip
            if q0 < 0:
                crush(
                    columns, foam_rows, friction, step, near[0], near[1], largest, rest,
                    shear, xpos[helmet], xmat[helmet], cvel[helmet], center_of_mass,
                    wrenches[helmet], wrench[0],
                )  # fmt: skip
                head_friction(
                    padding[0], padding[1], padding[2], padding[3], wrench[0, 2], step, slip,
                    xpos[head], cvel[helmet], cvel[head], center_of_mass, wrenches[helmet],
                    wrenches[head],
                )  # fmt: skip
            add_generalised(wrenches, chains[0], chains[1], cdof, generalised)

            if sampled:
                _factor_m(model, data)
                _acceleration(model, data)
                qacc[:] = acceleration
                _sensor_pos(model, data)
                _sensor_vel(model, data)
                about_mass_centers(wrenches, center_of_mass, xipos, cartesian)
                _rne_post(model, data)
                _sensor_acc(model, data)
                cartesian[:] = 0.0  # the generalised forces have them already
                q_rows[i] = qpos
                v_rows[i] = qvel
                sensor_rows[i] = sensors
            if damped or not sampled:
                for k in range(len(diagonal)):
                    mass[diagonal[k]] += damping[k]
                _factor_m(model, data)
                _acceleration(model, data)
            if not abs(acceleration.sum()) < 1e12:  # also true for NaN
                return i
            for k in range(len(qvel)):
                qvel[k] += step * acceleration[k]
            _integrate_pos(model, qpos.ctypes.data, qvel.ctypes.data, step)
    return last


def _forget_stale_code() -> None:
    """Drop cached machine code older than any of the functions it was built from.

    Numba compares the cache with this file only, not with the files of the functions it calls.
    """
    cache = Path(str(advance.stats.cache_path))
    sources = [str(module.__file__) for module in (contact, coupling, foam, liner, stops, tree)]
    changed = max(Path(source).stat().st_mtime for source in sources)
    for file in cache.glob(f"{Path(__file__).stem}.advance-*"):
        if file.stat().st_mtime < changed:
            file.unlink(missing_ok=True)


_forget_stale_code()
