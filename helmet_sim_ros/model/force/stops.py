"""Joint stops: beyond its range a joint meets a stiff, damped ligament.

The torque beyond the limit by e is -K e (1 + c e'), never pulling back into the stop; K is
``STIFFENING`` times the joint's passive stiffness. The constants are design choices: soft enough
not to shake the head, stiff enough that a joint exceeds its range by a few degrees only. MuJoCo's
own limits are constraints; while one is active a step costs half as much again.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.force.friction import normal_force

STIFFENING = {"hinge": 20.0, "slide": 3.0}
DAMPING = 0.05  # s/rad (s/m for a sliding joint)


class Stops(NamedTuple):
    """Joints with a stop; row i belongs to joint i.

    Attributes:
        qpos, qvel: index of the joint in the generalised positions and velocities, (n,).
        low, high: range, (n,) [rad or m].
        stiffness: beyond it, (n,) [N m/rad or N/m].
    """

    qpos: NDArray[np.int64]
    qvel: NDArray[np.int64]
    low: FloatArray
    high: FloatArray
    stiffness: FloatArray


def joint_stops(model: mujoco.MjModel) -> Stops:
    """The stops of every limited joint of a model."""
    joints = np.flatnonzero(model.jnt_limited)
    slides = model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    factor = np.where(slides, STIFFENING["slide"], STIFFENING["hinge"])
    low, high = (np.ascontiguousarray(limit) for limit in model.jnt_range[joints].T)
    return Stops(
        model.jnt_qposadr[joints].astype(np.int64), model.jnt_dofadr[joints].astype(np.int64),
        low, high, factor * model.jnt_stiffness[joints],
    )  # fmt: skip


@inlined
def apply(stops: Stops, motion: Motion, loads: Loads) -> None:
    """Add the stops' torques [N m] (forces [N]) to the generalised forces."""
    for i in range(len(stops.qpos)):
        q, v = motion.qpos[stops.qpos[i]], motion.qvel[stops.qvel[i]]
        if q > stops.high[i]:
            pressed = normal_force(stops.stiffness[i], DAMPING, q - stops.high[i], v)
            loads.generalised[stops.qvel[i]] -= pressed
        elif q < stops.low[i]:
            pressed = normal_force(stops.stiffness[i], DAMPING, stops.low[i] - q, -v)
            loads.generalised[stops.qvel[i]] += pressed
