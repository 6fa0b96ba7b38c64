"""Joint stops: beyond its range a joint meets a stiff, damped ligament.

The torque beyond the limit by e is -K e (1 + c e'), never pulling back into the stop; K is
``STIFFENING`` times the joint's passive stiffness. The constants are design choices: soft enough
not to shake the head, stiff enough that a joint exceeds its range by a few degrees only. MuJoCo's
own limits are constraints; while one is active a step costs half as much again.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.contact import normal_force

STIFFENING = {"hinge": 20.0, "slide": 3.0}
DAMPING = 0.05  # s/rad (s/m for a sliding joint)

#: Joints with a stop: their index in qpos and in qvel, (n, 2), and lower limit, upper limit,
#: stiffness [N m/rad or N/m], (n, 3).
Stops = tuple[NDArray[np.int64], FloatArray]


def joint_stops(model: mujoco.MjModel) -> Stops:
    """The stops of every limited joint of a model."""
    joints = np.flatnonzero(model.jnt_limited)
    address = np.column_stack([model.jnt_qposadr[joints], model.jnt_dofadr[joints]])
    slides = model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    factor = np.where(slides, STIFFENING["slide"], STIFFENING["hinge"])
    law = np.column_stack([model.jnt_range[joints], factor * model.jnt_stiffness[joints]])
    return address.astype(np.int64), law


@njit(cache=True, nogil=True)
def stop_torques(
    address: NDArray[np.int64],
    law: FloatArray,
    qpos: FloatArray,
    qvel: FloatArray,
    applied: FloatArray,
) -> None:
    """Add the stops' torques [N m] (forces [N]) to the generalised forces."""
    for i in range(len(address)):
        q, v = qpos[address[i, 0]], qvel[address[i, 1]]
        low, high, stiffness = law[i]
        if q > high:
            applied[address[i, 1]] -= normal_force(stiffness, DAMPING, q - high, v)
        elif q < low:
            applied[address[i, 1]] += normal_force(stiffness, DAMPING, low - q, -v)
