"""The rider as URDF, from the compiled model: what RViz, Foxglove and kinematics tools read.

Links have the names of the bodies, joints those of ``joint_states``. A hinge is a revolute joint, a
slide a prismatic one; ball joints and the free joint of the whole are ``floating``, since URDF has
no ball joint and three hinges in a row are not one: their place comes from transforms. A body
without joint is fixed. An ellipsoid is drawn as the sphere of the same volume (URDF has none), a
capsule as a cylinder with a sphere at each end; the ``scene`` topic shows the exact shapes.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray

#: Root link: the frame of the world.
WORLD = "world"
#: Limits that URDF demands and the model has not: effort [N m, N], velocity [rad/s, m/s].
_EFFORT, _VELOCITY = 1e6, 1e3
_MOVING = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
}


def urdf(model: mujoco.MjModel, name: str = "rider") -> str:
    """The model's bodies and joints as URDF text.

    Args:
        model: compiled.
        name: of the robot.
    """
    robot = Element("robot", name=name)
    SubElement(robot, "link", name=WORLD)
    for index in range(1, model.nbody):
        _body(robot, model, index)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=False)


def _body(robot: Element, model: mujoco.MjModel, index: int) -> None:
    """The link of a body, and what joins it to its parent."""
    body = model.body(index)
    _link(robot, model, index)
    parent = WORLD if int(body.parentid[0]) == 0 else model.body(int(body.parentid[0])).name
    joints = [int(body.jntadr[0]) + i for i in range(int(body.jntnum[0]))]
    position, turn = np.array(body.pos), np.array(body.quat)
    if not joints:
        _joint(robot, f"{body.name}_mount", "fixed", parent, body.name, position, turn)
        return
    if any(int(model.jnt_type[j]) not in _MOVING for j in joints):
        # Its place is told as a whole, whatever else moves it.
        name = model.joint(joints[0]).name or f"{body.name}_free"
        _joint(robot, name, "floating", parent, body.name, position, turn)
        return
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, turn)
    anchor = np.zeros(3)  # of the last joint, in the body's axes
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    for place, j in enumerate(joints):
        at = np.array(model.jnt_pos[j])
        step = at - anchor
        origin = position + rotation.reshape(3, 3) @ step if place == 0 else step
        last = place == len(joints) - 1 and not at.any()
        child = body.name if last else f"{body.name}_at_{model.joint(j).name}"
        if not last:
            SubElement(robot, "link", name=child)
        joint = _joint(
            robot, model.joint(j).name, _MOVING[int(model.jnt_type[j])], parent, child, origin,
            turn if place == 0 else upright,
        )  # fmt: skip
        _limits(joint, model, j)
        parent, anchor = child, at
    if parent != body.name:
        _joint(robot, f"{body.name}_mount", "fixed", parent, body.name, -anchor, upright)


def _joint(
    robot: Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    position: FloatArray,
    quaternion: FloatArray,
) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    _origin(joint, position, quaternion)
    return joint


def _limits(joint: Element, model: mujoco.MjModel, j: int) -> None:
    low, high = (float(v) for v in model.jnt_range[j])
    if not model.jnt_limited[j]:  # its stops are forces, not limits
        reach = math.pi if joint.get("type") == "revolute" else 1.0
        low, high = -reach, reach
    SubElement(joint, "axis", xyz=_text(model.jnt_axis[j]))
    SubElement(joint, "limit", lower=f"{low:.9g}", upper=f"{high:.9g}",
               effort=f"{_EFFORT:g}", velocity=f"{_VELOCITY:g}")  # fmt: skip


def _link(robot: Element, model: mujoco.MjModel, index: int) -> None:
    body = model.body(index)
    link = SubElement(robot, "link", name=body.name)
    if float(body.mass[0]) > 0.0:
        inertial = SubElement(link, "inertial")
        _origin(inertial, body.ipos, body.iquat)
        SubElement(inertial, "mass", value=f"{float(body.mass[0]):.9g}")
        xx, yy, zz = (f"{float(v):.9g}" for v in body.inertia)
        SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    first = int(body.geomadr[0])
    for g in range(first, first + int(body.geomnum[0])):
        _visuals(link, model, g)


def _visuals(link: Element, model: mujoco.MjModel, g: int) -> None:
    size, kind = [float(v) for v in model.geom_size[g]], int(model.geom_type[g])
    position, turn = np.array(model.geom_pos[g]), np.array(model.geom_quat[g])
    kinds = mujoco.mjtGeom
    if kind == int(kinds.mjGEOM_CAPSULE):
        shapes = [("cylinder", {"radius": size[0], "length": 2.0 * size[1]}, 0.0)]
        shapes += [("sphere", {"radius": size[0]}, end * size[1]) for end in (-1.0, 1.0)]
    elif kind == int(kinds.mjGEOM_ELLIPSOID):
        shapes = [("sphere", {"radius": float(np.prod(size)) ** (1.0 / 3.0)}, 0.0)]
    elif kind == int(kinds.mjGEOM_SPHERE):
        shapes = [("sphere", {"radius": size[0]}, 0.0)]
    elif kind == int(kinds.mjGEOM_CYLINDER):
        shapes = [("cylinder", {"radius": size[0], "length": 2.0 * size[1]}, 0.0)]
    else:
        return
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, turn)
    along = rotation.reshape(3, 3)[:, 2]
    for shape, values, offset in shapes:
        visual = SubElement(link, "visual")
        _origin(visual, position + offset * along, turn)
        geometry = SubElement(visual, "geometry")
        SubElement(geometry, shape, {key: f"{value:.9g}" for key, value in values.items()})
        material = SubElement(visual, "material", name=f"{link.get('name')}_color")
        SubElement(material, "color", rgba=_text(model.geom_rgba[g]))


def _origin(element: Element, position: FloatArray, quaternion: FloatArray) -> None:
    """URDF's roll, pitch and yaw turn about the fixed axes x, y, z in this order."""
    w, x, y, z = (float(v) for v in quaternion)
    sine = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
    if abs(sine) > 1.0 - 1e-12:  # straight up or down: roll and yaw turn about one axis
        roll, yaw = 0.0, -math.copysign(2.0, sine) * math.atan2(x, w)
    else:
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    angles = np.array([roll, math.asin(sine), yaw])
    SubElement(element, "origin", xyz=_text(position), rpy=_text(angles))


def _text(values: FloatArray) -> str:
    return " ".join(f"{float(v):.9g}" for v in values)
