"""Where a fall begins: the rider's pose and velocities over the scene."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.posture import hip_depth
from helmet_sim_ros.model.fall.values import FallValues
from helmet_sim_ros.model.force import contact as contacts
from helmet_sim_ros.model.force.bodies import motion_of
from helmet_sim_ros.model.force.contact import Contact
from helmet_sim_ros.model.surface.compiled import Surface

OVERLAP = 1e-3  # m, by which a rider may start inside: skin gives way by more


def start_fall(
    model: mujoco.MjModel, data: mujoco.MjData, contact: Contact, surface: Surface, fall: FallValues
) -> None:
    """Set pose and velocities of the start.

    Args:
        model: compiled, with the posing of the fall.
        data: new or reset; its qpos and qvel are set.
        contact: what may touch the scene.
        surface: the scene.
        fall: whose start it is.

    Raises:
        SetupError: the rider starts inside something.
    """
    data.qpos[7:] = model.qpos_spring[7:]
    for name, angle in fall.posing.starts:
        data.qpos[int(model.joint(name).qposadr[0])] = angle
    heading = math.radians(fall.heading_deg)
    turn = rotation(fall)
    hips = np.array([0.0, 0.0, -hip_depth(fall.rider)])  # in the pelvis
    height = (fall.posture.height or 0.0) if fall.height is None else fall.height
    at = np.array([fall.x, fall.y, height])
    mujoco.mju_mat2Quat(data.qpos[3:7], turn.flatten())
    data.qpos[:3] = at - turn @ hips
    mujoco.mj_kinematics(model, data)
    if (
        fall.height is None
    ):  # a tall rider's feet do not reach into the ground, and some stand on it
        below = lowest(model, data, contact)
        if below < 0.0 or fall.posture.height is None:
            data.qpos[2] -= below
            mujoco.mj_kinematics(model, data)
    forward = np.array([math.cos(heading), math.sin(heading), 0.0])
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    spin = np.array([0.0, 0.0, fall.spin]) + fall.pitch_rate * left + fall.roll_rate * forward
    velocity = fall.resolved_speed * forward + np.array([0.0, 0.0, fall.vertical_speed])
    data.qvel[:3] = velocity - np.cross(spin, turn @ hips)  # the hips have the velocity
    data.qvel[3:6] = turn.T @ spin
    which, shape, depth = contacts.deepest(contact, surface, motion_of(data))
    if depth > OVERLAP:
        name = model.body(contact.body[which]).name
        _refuse(fall, name, fall.surface_config.name_of(shape), depth, height)


def rotation(fall: FallValues) -> FloatArray:
    """Pelvis to world at the start, (3, 3): pitch, then roll, then heading."""
    heading, roll, pitch = (
        math.radians(angle)
        for angle in (fall.heading_deg, fall.roll_deg, fall.posture.pitch_deg + fall.pitch_deg)
    )
    c, s = math.cos(heading), math.sin(heading)
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    c, s = math.cos(roll), math.sin(roll)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    c, s = math.cos(pitch), math.sin(pitch)
    about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    turned: FloatArray = about_z @ about_x @ about_y
    return turned


def lowest(model: mujoco.MjModel, data: mujoco.MjData, contact: Contact) -> float:
    """Height of the lowest point of rider and helmet [m]."""
    heights = []
    for body, center, axes in zip(contact.body, contact.center, contact.semi_axes, strict=True):
        turn = data.xmat[body].reshape(3, 3)
        middle = data.xpos[body] + turn @ center
        heights.append(float(middle[2] - np.linalg.norm(turn[2] * axes)))
    return min(heights)


def _refuse(fall: FallValues, body: str, shape: str, depth: float, height: float) -> None:
    key, value = "height", height
    allowed = (
        f"{body} starts {depth * 1e3:.0f} mm inside the {shape}; height must be at least "
        f"{height + depth:.3g} m in this posture"
    )
    if shape not in ("road", "half space", "ground"):
        key, value = "x", fall.x
        allowed = (
            f"{body} starts {depth * 1e3:.0f} mm inside {shape} of scene {fall.scene}; choose "
            "another x, y or height"
        )
    raise SetupError.of(key, value, allowed)
