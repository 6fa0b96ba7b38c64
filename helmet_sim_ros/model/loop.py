"""The one stepping loop: every force in, samples out; compiled by numba.

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
from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force import (
    contact,
    fit,
    laying,
    liner,
    neck,
    self_contact,
    shell,
    spring,
    stops,
)
from helmet_sim_ros.model.force.bodies import (
    Chains,
    Loads,
    Motion,
    about_mass_centers,
    add_generalised,
    clear,
)
from helmet_sim_ros.model.force.vector import write
from helmet_sim_ros.model.surface.carrier import carry
from helmet_sim_ros.model.surface.compiled import Surface


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


def mujoco_function(name: str) -> Any:
    """A C function of model and data."""
    return types.ExternalFunction(name, types.void(types.intp, types.intp))


kinematics, com_pos = mujoco_function("mj_kinematics"), mujoco_function("mj_comPos")
make_m, factor_m = mujoco_function("mj_makeM"), mujoco_function("mj_factorM")
velocity_ = mujoco_function("mj_fwdVelocity")
acceleration_ = mujoco_function("mj_fwdAcceleration")
_rne_post = mujoco_function("mj_rnePostConstraint")
_sensor_pos, _sensor_vel = mujoco_function("mj_sensorPos"), mujoco_function("mj_sensorVel")
_sensor_acc = mujoco_function("mj_sensorAcc")
energy_vel = mujoco_function("mj_energyVel")
integrate_pos: Any = types.ExternalFunction(
    "mj_integratePos", types.void(types.intp, types.intp, types.intp, types.double)
)


WATCHED = 10  # samples from one look at the kinetic energy to the next


class Engine(NamedTuple):
    """MuJoCo's side of a step.

    Attributes:
        model, data: addresses of mjModel and mjData.
        acceleration: view of qacc_smooth; ``sampled_acceleration`` of qacc, which sensors read.
        cartesian: view of xfrc_applied, which sensors read.
        sensors: view of sensordata.
        mass: view of M; ``diagonal``: where its diagonal stands there.
        step: integration step [s].
        damping: what the joints' damping adds to the diagonal in an implicit step.
        chains: the kinematic tree.
        energy: view of MuJoCo's potential and kinetic energy [J].
    """

    model: int
    data: int
    acceleration: FloatArray
    sampled_acceleration: FloatArray
    cartesian: FloatArray
    sensors: FloatArray
    mass: FloatArray
    diagonal: NDArray[np.int64]
    step: float
    damping: FloatArray
    chains: Chains
    energy: FloatArray


class Forces(NamedTuple):
    """Every force of the model with its state, and what is struck.

    ``contact`` is of all ellipsoids; ``landing`` of the body alone and ``outside`` of a spring
    helmet's shell are views of it.
    """

    surface: Surface
    spring: spring.CouplingSpring
    stops: stops.Stops
    neck: neck.CervicalSpine
    contact: contact.Contact
    landing: contact.Contact
    outside: contact.Contact
    liner: liner.CrushingLiner
    shell: laying.Shell
    fit: fit.Fit
    own: self_contact.SelfContact


class Rows(NamedTuple):
    """Samples to write, one row each.

    Attributes:
        qpos, qvel, sensors: MuJoCo's.
        coupling, spring, surface: see :class:`helmet_sim_ros.model.force.bodies.Loads`.
        crush: of a foam helmet: depth of the undeformed shell [m] times the outward normal.
    """

    qpos: FloatArray
    qvel: FloatArray
    sensors: FloatArray
    coupling: FloatArray
    spring: FloatArray
    surface: FloatArray
    crush: FloatArray


class Clock(NamedTuple):
    """Integration step [s], and how many of them make a sample.

    Attributes:
        energy: the most kinetic energy that can be, at the start [J]; ``power``: what gravity can
            add to it [W], ``growth`` its rate of change [W/s].
    """

    step: float
    substeps: int
    energy: float
    power: float
    growth: float


class Simulation(NamedTuple):
    """What the stepping loops work on: one impact or fall as it is now.

    Attributes:
        engine, motion: MuJoCo's side of it.
        loads: of one step; MuJoCo's applied forces are a view of them.
        forces: their states are changed in place.
        clock: integration step and steps per sample.
    """

    engine: Engine
    motion: Motion
    loads: Loads
    forces: Forces
    clock: Clock


@inlined
def sample(engine: Engine, motion: Motion, loads: Loads, rows: Rows, i: int) -> None:
    """Write the present state, its sensors and loads into row i.

    The acceleration is that of the step which begins: with it a record's velocities are what its
    accelerations add up to, and peaks come closer to those of much finer steps than with that of
    the explicit equations (HIC 0.1 % from them, not 0.3), which would need the mass matrix twice.
    """
    write(engine.sampled_acceleration, engine.acceleration)
    _sensor_pos(engine.model, engine.data)
    _sensor_vel(engine.model, engine.data)
    about_mass_centers(motion, loads, engine.cartesian)
    _rne_post(engine.model, engine.data)
    _sensor_acc(engine.model, engine.data)
    engine.cartesian[:] = 0.0  # the generalised forces have them already
    write(rows.qpos[i], motion.qpos)
    write(rows.qvel[i], motion.qvel)
    write(rows.sensors[i], engine.sensors)
    write(rows.coupling[i], loads.coupling)
    write(rows.spring[i], loads.spring)
    write(rows.surface[i, 0], loads.surface[0])
    write(rows.surface[i, 1], loads.surface[1])


@inlined
def slow_forces(forces: Forces, step: float, motion: Motion, loads: Loads) -> None:
    """Add what acts on the body; ``step``: time since the last call [s]."""
    stops.apply(forces.stops, step, motion, loads)
    neck.apply(forces.neck, motion, loads)
    contact.apply(forces.landing, forces.surface, step, motion, loads)
    self_contact.apply(forces.own, step, motion, loads)


@inlined
def has_foam(forces: Forces) -> bool:
    """Whether a crushing liner takes the place of the coupling spring."""
    return len(forces.liner.columns.area) > 0


@inlined
def fast_forces(
    forces: Forces, foam: bool, bends: bool, step: float, motion: Motion, loads: Loads
) -> None:
    """Add what acts on head and helmet.

    Args:
        foam: whether there is a liner; ``bends``: whether its shell spreads the load.
        step: time since the last call [s].
    """
    fit.apply(forces.fit, step, motion, loads)
    if foam:
        if bends:
            shell.apply(forces.shell, forces.liner, forces.surface, step, motion, loads)
        else:
            liner.apply(forces.liner, forces.surface, step, motion, loads)
    else:
        contact.apply(forces.outside, forces.surface, step, motion, loads)
        spring.apply(forces.spring, step, motion, loads)


@compiled
def advance(simulation: Simulation, rows: Rows, first: int, last: int) -> int:
    """Step from sample ``first`` up to ``last``; each row is the state before its step.

    Args:
        simulation: at sample ``first``.
        rows: samples to write.

    Returns:
        ``last``, or the index of the first sample at or after which the state has left physics: the
        acceleration is not finite, or there is more kinetic energy than there can be.
    """
    engine, motion, loads, forces, clock = simulation
    model, data, step = engine.model, engine.data, clock.step
    mass, diagonal, damping = engine.mass, engine.diagonal, engine.damping
    acceleration, qpos, qvel = engine.acceleration, motion.qpos, motion.qvel
    foam, bends = has_foam(forces), shell.spreads(forces.shell, forces.surface)
    for i in range(first, last):
        for substep in range(clock.substeps):
            kinematics(model, data)
            com_pos(model, data)
            make_m(model, data)
            velocity_(model, data)

            clear(loads)
            slow_forces(forces, step, motion, loads)
            fast_forces(forces, foam, bends, step, motion, loads)
            add_generalised(motion, loads, engine.chains)

            if substep == 0 and i % WATCHED == 0:
                energy_vel(model, data)
                since = i * step * clock.substeps
                if engine.energy[1] > clock.energy + since * (clock.power + since * clock.growth):
                    return i
            for k in range(len(diagonal)):
                mass[diagonal[k]] += damping[k]
            factor_m(model, data)
            acceleration_(model, data)
            if not abs(acceleration.sum()) < 1e12:  # also true for NaN
                return i
            if substep == 0:
                sample(engine, motion, loads, rows, i)
                if foam:
                    liner.crush(forces.liner, forces.surface, motion, rows.crush[i])
            for k in range(len(qvel)):
                qvel[k] += step * acceleration[k]
            integrate_pos(model, qpos.ctypes.data, qvel.ctypes.data, step)
            carry(forces.surface, step)
    return last
