"""Joint stops and what else a joint resists with, beside its spring and damper.

Beyond its range a joint meets a ligament that hardens, and hardly throws back.

The torque beyond the limit by e is K e (1 + (e / e0)^2 + (e / e0)^4), damped as soft tissue is: it
never pulls back into the stop, and the joint leaves it at 1 / ``DAMPING`` at most. Ligaments of
joints are sized for what swings on them: K follows the inertia behind the joint. MuJoCo's own
limits are constraints; while one is active a step costs half as much again.

Limbs also resist with a friction that holds them against a share of gravity: muscles of a conscious
man are never slack. Dummies' limbs are set to hold against the whole of it (49 CFR 572, "1 g").
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.force.tissue import resisting
from helmet_sim_ros.model.rest import AtRest

STIFFENS = math.radians(4.0)  # e0; choice, as the neck's
FREQUENCY = 250.0  # rad/s, of what hangs on a joint at its stop: 110 rad/s pass it by 0.14 rad
LEAST = 0.05  # kg m^2, of hand and foot: what they are part of turns, where they are held
DAMPING = 0.5  # s/rad; choice
HELD = 0.3  # of its weight, that a limb holds; choice
GIVES = 0.03  # rad, on which that friction builds up; choice
RELAXATION = 0.02  # s, its damping over stiffness while it sticks; choice
TRUNK = ("lumbar", "thoracic")  # joints that springs hold


class Stops(NamedTuple):
    """Joints with a stop; row i belongs to joint i.

    Attributes:
        qpos, qvel: index of the joint in the generalised positions and velocities, (n,).
        low, high: range, (n,) [rad].
        stiffness: beyond it, (n,) [N m/rad].
        inertia: that moves least against the joint, at rest, (n,) [kg m^2].
        friction: (n,) [N m]; ``stick``: its elastic deflection, (n,) [rad]; state.
    """

    qpos: NDArray[np.int64]
    qvel: NDArray[np.int64]
    low: FloatArray
    high: FloatArray
    stiffness: FloatArray
    inertia: FloatArray
    friction: FloatArray
    stick: FloatArray

    def fresh(self) -> Stops:
        """The same with a state of its own, at the start."""
        return self._replace(stick=np.zeros_like(self.friction))


def joint_stops(model: mujoco.MjModel, rest: AtRest) -> Stops:
    """The stops of every limited hinge of a model."""
    joints = np.flatnonzero(model.jnt_limited)
    low, high = (np.ascontiguousarray(limit) for limit in model.jnt_range[joints].T)
    dofs = model.jnt_dofadr[joints].astype(np.int64)
    inertia = rest.joint_inertia()[dofs]
    # The trunk's joints are held by springs.
    limb = np.array([not model.joint(j).name.startswith(TRUNK) for j in joints], dtype=bool)
    return Stops(
        model.jnt_qposadr[joints].astype(np.int64), dofs, low, high,
        FREQUENCY**2 * np.maximum(inertia, LEAST), inertia, HELD * limb * rest.weights(joints),
        np.zeros(len(joints)),
    )  # fmt: skip


@inlined
def excess_of(stops: Stops, i: int, q: float) -> float:
    """How far joint i is beyond its range [rad], negative below it."""
    excess: float = max(0.0, q - stops.high[i]) + min(0.0, q - stops.low[i])
    return excess


@inlined
def held_torque(stops: Stops, i: int, speed: float, step: float) -> float:
    """Friction of joint i [N m]: elastic while it sticks, then constant (Cundall & Strack 1979, as
    the contacts'); its deflection is carried on."""
    limit = stops.friction[i]
    stiffness = limit / GIVES
    stick = min(GIVES, max(-GIVES, stops.stick[i] + step * speed))
    stops.stick[i] = stick
    torque: float = min(limit, max(-limit, stiffness * (stick + RELAXATION * speed)))
    return torque


@compiled
def apply(stops: Stops, step: float, motion: Motion, loads: Loads) -> None:
    """Add the stops' and the friction's torques [N m] to the generalised forces; ``step`` [s]."""
    for i in range(len(stops.qpos)):
        dof = stops.qvel[i]
        speed = motion.qvel[dof]
        loads.generalised[dof] -= held_torque(stops, i, speed, step)
        excess = excess_of(stops, i, motion.qpos[stops.qpos[i]])
        if excess != 0.0:
            sense = 1.0 if excess > 0.0 else -1.0
            square = (excess / STIFFENS) ** 2
            elastic = stops.stiffness[i] * abs(excess) * (1.0 + square + square * square)
            loads.generalised[dof] -= sense * resisting(
                elastic, DAMPING, sense * speed, step, stops.inertia[i]
            )


@compiled
def stored_energy(stops: Stops, qpos: FloatArray) -> float:
    """Elastic energy of stops and friction [J]."""
    energy = 0.0
    for i in range(len(stops.qpos)):
        square = (excess_of(stops, i, qpos[stops.qpos[i]]) / STIFFENS) ** 2
        work = square * (0.5 + square * (0.25 + square / 6.0))
        energy += stops.stiffness[i] * STIFFENS**2 * work
        energy += 0.5 * stops.friction[i] / GIVES * stops.stick[i] ** 2
    return energy
