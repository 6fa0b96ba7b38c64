"""Where the rider is at the first touch: the helmet on the ground, all moving as one."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.contact import Shapes
from helmet_sim_ros.model.setup import ImpactSetup


def place(
    model: mujoco.MjModel, data: mujoco.MjData, shapes: Shapes, setup: ImpactSetup
) -> tuple[str, ...]:
    """Set pose and velocity: helmet just touching at the world origin, all moving as one.

    Args:
        model: compiled.
        data: new or reset; its qpos and qvel are set.
        shapes: what may touch the ground besides a foam liner.
        setup: of the impact.

    Returns:
        What a user should know about the pose, in words.
    """
    rotation = head_to_world(setup)
    # A spring at rest: posture and neck flexion are the springs' reference angles.
    hinges = model.jnt_qposadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)]
    data.qpos[hinges] = model.qpos_spring[hinges]
    shell = setup.helmet_config.shell
    down = rotation.T @ np.array([0.0, 0.0, -1.0])
    axes = np.array(shell.semi_axes)
    touch = np.array(shell.center) + axes**2 * down / np.linalg.norm(axes * down)
    place_head(model, data, -rotation @ touch, rotation)
    heading = math.radians(setup.tangential_heading_deg)
    data.qvel[0] = setup.tangential_velocity * math.cos(heading)
    data.qvel[1] = setup.tangential_velocity * math.sin(heading)
    data.qvel[2] = -setup.normal_velocity
    name, lowest = _lowest_body_part(model, data, shapes)
    if lowest >= 0.0:
        return ()
    data.qpos[2] -= lowest
    return (
        f"{name} touches the ground first, the helmet starts {-lowest * 1e3:.1f} mm above it; "
        "a larger body_angle_deg lets the helmet strike first",
    )


def place_head(
    model: mujoco.MjModel, data: mujoco.MjData, position: FloatArray, rotation: FloatArray
) -> None:
    """Move the whole tree, joints as they are, so that the head frame has the given pose.

    Args:
        position: of the head's centre of gravity, shape (3,) [m].
        rotation: head to world, shape (3, 3).
    """
    data.qpos[0:7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    mujoco.mj_kinematics(model, data)
    head = data.body("head")
    root = rotation @ head.xmat.reshape(3, 3).T
    data.qpos[0:3] = position - root @ head.xpos
    mujoco.mju_mat2Quat(data.qpos[3:7], root.flatten())
    mujoco.mj_kinematics(model, data)


def _lowest_body_part(
    model: mujoco.MjModel, data: mujoco.MjData, shapes: Shapes
) -> tuple[str, float]:
    """Name and height [m] of the lowest point of the body, helmet left out."""
    heights = shapes.lowest_points(data.xpos, data.xmat)
    heights[shapes.body == model.body("helmet").id] = math.inf
    if not len(heights):
        return "", math.inf
    lowest = int(heights.argmin())
    return model.body(shapes.body[lowest]).name, float(heights[lowest])


def head_to_world(setup: ImpactSetup) -> FloatArray:
    """Rotation matrix head to world at the first touch, shape (3, 3).

    A headform strikes with the axis of ``direction`` straight down. A rider lies with the body
    axis (feet to head) along world x, inclined head down by ``body_angle_deg``, turned about it
    so that the side named by ``direction`` faces the ground (``top``: prone), and the head is
    bent towards the chest by the neck flexion.
    """
    down = np.array([0.0, 0.0, -1.0])
    if setup.rig == "headform":
        forward = np.array([1.0, 0.0, 0.0])
        if setup.direction == "top":
            return _frame("front", forward, down)
        return _frame(setup.direction, down, forward)  # the crown points along world x
    beta = math.radians(setup.body_angle_deg)
    up = np.array([math.cos(beta), 0.0, -math.sin(beta)])
    facing = np.array([-math.sin(beta), 0.0, -math.cos(beta)])
    direction = "front" if setup.direction == "top" else setup.direction
    flexion = math.radians(setup.resolved_neck_flexion_deg)
    c, s = math.cos(flexion), math.sin(flexion)
    nod = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rotation: FloatArray = _frame(direction, facing, up) @ nod
    return rotation


def _frame(direction: str, facing: FloatArray, up: FloatArray) -> FloatArray:
    """Head axes in world axes, the named side along ``facing``, z along ``up``."""
    beside = np.array(  # up x facing
        [
            up[1] * facing[2] - up[2] * facing[1],
            up[2] * facing[0] - up[0] * facing[2],
            up[0] * facing[1] - up[1] * facing[0],
        ]
    )
    x, y = {
        "front": (facing, beside),
        "back": (-facing, -beside),
        "left": (-beside, facing),
        "right": (beside, -facing),
    }[direction]
    return np.column_stack([x, y, up])
