"""Joint stops and what else a joint resists with, beside its spring and damper.

Beyond its range a joint meets a ligament that hardens, and hardly throws back.

The torque beyond the limit by e is K e (1 + (e / e0)^2), damped as soft tissue is: it never pulls
back into the stop, and the joint leaves it at 1 / ``DAMPING`` at most. Ligaments of joints are
sized for what swings on them: K follows the inertia behind the joint. MuJoCo's own limits are
constraints; while one is active a step costs half as much again.

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

STIFFENS = math.radians(4.0)  # e0; choice, as the neck's
FREQUENCY = 250.0  # rad/s, of what hangs on a joint at its stop: 60 rad/s pass it by 0.14 rad
LEAST = 0.05  # kg m^2, of hand and foot: what they are part of turns, where they are held
DAMPING = 0.5  # s/rad; choice
HELD = 0.25  # of gravity, against which a limb holds itself; choice
SLOW = 0.5  # rad/s, below which that friction fades to a damper; choice
TRUNK = ("lumbar", "thoracic")  # joints that springs hold


class Stops(NamedTuple):
    """Joints with a stop; row i belongs to joint i.

    Attributes:
        qpos, qvel: index of the joint in the generalised positions and velocities, (n,).
        low, high: range, (n,) [rad].
        stiffness: beyond it, (n,) [N m/rad].
        inertia: that moves least against the joint, at rest, (n,) [kg m^2].
        friction: (n,) [N m].
    """

    qpos: NDArray[np.int64]
    qvel: NDArray[np.int64]
    low: FloatArray
    high: FloatArray
    stiffness: FloatArray
    inertia: FloatArray
    friction: FloatArray


def joint_stops(model: mujoco.MjModel) -> Stops:
    """The stops of every limited hinge of a model."""
    joints = np.flatnonzero(model.jnt_limited)
    low, high = (np.ascontiguousarray(limit) for limit in model.jnt_range[joints].T)
    dofs = model.jnt_dofadr[joints].astype(np.int64)
    inertia = joint_inertia(model)[dofs]
    return Stops(
        model.jnt_qposadr[joints].astype(np.int64), dofs, low, high,
        FREQUENCY**2 * np.maximum(inertia, LEAST), inertia, HELD * weights(model, joints),
    )  # fmt: skip


def joint_inertia(model: mujoco.MjModel) -> FloatArray:
    """What a torque on each degree of freedom alone accelerates, in the rest posture, (nv,)."""
    data = mujoco.MjData(model)
    data.qpos[7:] = model.qpos_spring[7:]
    mujoco.mj_fwdPosition(model, data)
    inverse = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    inertia: FloatArray = 1.0 / np.diag(inverse)
    return inertia


def weights(model: mujoco.MjModel, joints: NDArray[np.int64]) -> FloatArray:
    """The most that the weight of what hangs on a joint turns it in the rest posture, 0 for the
    trunk, (n,) [N m]."""
    data = mujoco.MjData(model)
    data.qpos[7:] = model.qpos_spring[7:]
    mujoco.mj_fwdPosition(model, data)
    turning = np.zeros(len(joints))
    for i, joint in enumerate(joints):
        if not model.joint(joint).name.startswith(TRUNK):
            body = model.jnt_bodyid[joint]
            arm = np.cross(data.xaxis[joint], data.subtree_com[body] - data.xanchor[joint])
            turning[i] = model.body_subtreemass[body] * 9.80665 * float(np.linalg.norm(arm))
    return turning


@inlined
def excess_of(stops: Stops, i: int, q: float) -> float:
    """How far joint i is beyond its range [rad], negative below it."""
    return max(0.0, q - stops.high[i]) + min(0.0, q - stops.low[i])


@compiled
def apply(stops: Stops, step: float, motion: Motion, loads: Loads) -> None:
    """Add the stops' and the friction's torques [N m] to the generalised forces; ``step`` [s]."""
    for i in range(len(stops.qpos)):
        dof = stops.qvel[i]
        speed = motion.qvel[dof]
        viscous = stops.friction[i] / max(abs(speed), SLOW)
        loads.generalised[dof] -= viscous * speed / (1.0 + viscous * step / stops.inertia[i])
        excess = excess_of(stops, i, motion.qpos[stops.qpos[i]])
        if excess != 0.0:
            sense = 1.0 if excess > 0.0 else -1.0
            elastic = stops.stiffness[i] * abs(excess) * (1.0 + (excess / STIFFENS) ** 2)
            loads.generalised[dof] -= sense * resisting(
                elastic, DAMPING, sense * speed, step, stops.inertia[i]
            )


@compiled
def stored_energy(stops: Stops, qpos: FloatArray) -> float:
    """Elastic energy of the stops [J]."""
    energy = 0.0
    for i in range(len(stops.qpos)):
        square = excess_of(stops, i, qpos[stops.qpos[i]]) ** 2
        energy += stops.stiffness[i] * square * (0.5 + 0.25 * square / STIFFENS**2)
    return energy
