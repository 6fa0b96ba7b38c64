"""The multibody rider as a tree with the pelvis as its root and the head as a leaf.

The root must be heavy and turn slowly: the integrator's error in momentum grows with the mass
that hangs on a fast turning root (rooted at the head it reached 5 % at a step of 50 us).
Every segment frame has its origin at the segment's upper end, the head's at its centre of gravity;
all frames are parallel (x forward, y left, z up) when the rider stands upright.

Joint ranges, stiffnesses and damping outside the neck are general literature values of passive
human joints; they hold the posture during the few hundredths of a second of an impact and hardly
act on the head's response.
"""

from __future__ import annotations

import math

import mujoco

from helmet_sim_ros.model.rider.anthropometry import Anthropometry, Segment
from helmet_sim_ros.model.rider.neck import add_neck
from helmet_sim_ros.model.rider.properties import Posture, Rider

Vector = tuple[float, float, float]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
FORWARD = (0.0, -1.0, 0.0)  # a positive angle swings what hangs below the joint forwards

BODY_COLOR = (0.75, 0.62, 0.55, 1.0)


def add_body(world: mujoco.MjsBody, rider: Rider, body: Anthropometry) -> mujoco.MjsBody:
    """Build pelvis, trunk, neck, arms and legs.

    Args:
        world: what they stand in.
        rider: neck properties and posture.
        body: the rider's segments.

    Returns:
        The body ``head``, still without mass, jointed to the neck.
    """
    s, k = body.segments, body.scale
    pelvis = world.add_body(name="pelvis")
    pelvis.add_freejoint(name="root")
    _mass(pelvis, s["lower_trunk"])
    half = 0.5 * s["lower_trunk"].length
    _ellipsoid(pelvis, (0.105 * k, 0.165 * k, 1.3 * half), -half)

    abdomen = _upwards(pelvis, "abdomen", s["middle_trunk"].length)
    _mass(abdomen, s["middle_trunk"])
    _trunk_joints(abdomen, "lumbar", s["middle_trunk"].length, 200.0, 12.0)
    half = 0.5 * s["middle_trunk"].length
    _ellipsoid(abdomen, (0.10 * k, 0.135 * k, 1.1 * half), -half)

    thorax = _upwards(abdomen, "thorax", s["upper_trunk"].length)
    _mass(thorax, s["upper_trunk"])
    _trunk_joints(thorax, "thoracic", s["upper_trunk"].length, 250.0, 12.0)
    half = 0.5 * s["upper_trunk"].length
    _ellipsoid(thorax, (0.11 * k, 0.145 * k, half), -half)

    head = add_neck(thorax, rider.neck, body)

    for side, sense in (("left", 1.0), ("right", -1.0)):
        _arm(thorax, side, sense, body, rider.posture)
        _leg(pelvis, side, sense, body, rider.posture)
    return head


def _arm(
    thorax: mujoco.MjsBody, side: str, sense: float, body: Anthropometry, posture: Posture
) -> None:
    s = body.segments
    at = (0.0, sense * body.shoulder_half_width, -body.shoulder_depth)
    upper = _segment(thorax, f"upper_arm_{side}", at, s["upper_arm"])
    _joint(upper, f"shoulder_flexion_{side}", FORWARD, _rad(-60, 180), 10.0, 1.5,
           math.radians(posture.shoulder_flexion_deg))  # fmt: skip
    _joint(upper, f"shoulder_abduction_{side}", (sense, 0.0, 0.0), _rad(-40, 150), 10.0, 1.5)
    _joint(upper, f"shoulder_rotation_{side}", (0.0, 0.0, sense), _rad(-90, 90), 5.0, 0.5)
    _capsule(upper, 0.045 * body.scale, s["upper_arm"].length)
    forearm = _segment(upper, f"forearm_{side}", (0, 0, -s["upper_arm"].length), s["forearm"])
    _joint(forearm, f"elbow_flexion_{side}", FORWARD, _rad(0, 145), 5.0, 0.8,
           math.radians(posture.elbow_flexion_deg))  # fmt: skip
    _capsule(forearm, 0.037 * body.scale, s["forearm"].length)
    hand = _segment(forearm, f"hand_{side}", (0, 0, -s["forearm"].length), s["hand"])
    _joint(hand, f"wrist_flexion_{side}", FORWARD, _rad(-70, 70), 2.0, 0.2)
    _capsule(hand, 0.030 * body.scale, s["hand"].length)


def _leg(
    pelvis: mujoco.MjsBody, side: str, sense: float, body: Anthropometry, posture: Posture
) -> None:
    s = body.segments
    at = (0.0, sense * body.hip_half_width, -s["lower_trunk"].length)
    thigh = _segment(pelvis, f"thigh_{side}", at, s["thigh"])
    _joint(thigh, f"hip_flexion_{side}", FORWARD, _rad(-20, 120), 20.0, 3.0,
           math.radians(posture.hip_flexion_deg))  # fmt: skip
    _joint(thigh, f"hip_abduction_{side}", (sense, 0.0, 0.0), _rad(-30, 50), 20.0, 3.0)
    _joint(thigh, f"hip_rotation_{side}", (0.0, 0.0, sense), _rad(-40, 40), 10.0, 1.0)
    _capsule(thigh, 0.075 * body.scale, s["thigh"].length)
    shank = _segment(thigh, f"shank_{side}", (0, 0, -s["thigh"].length), s["shank"])
    _joint(shank, f"knee_flexion_{side}", Y, _rad(0, 145), 10.0, 1.5,
           math.radians(posture.knee_flexion_deg))  # fmt: skip
    _capsule(shank, 0.050 * body.scale, s["shank"].length)
    foot = shank.add_body(name=f"foot_{side}", pos=[0.0, 0.0, -s["shank"].length])
    # De Leva's foot runs from heel to toe; the ankle stands over its hind quarter.
    segment, heel = s["foot"], -0.25 * s["foot"].length
    drop = -0.5 * body.ankle_height
    ixx, iyy, izz = segment.inertia[2], segment.inertia[1], segment.inertia[0]  # long axis is x
    _inertial(foot, segment.mass, (heel + segment.center, 0.0, drop), (ixx, iyy, izz))
    _joint(foot, f"ankle_flexion_{side}", FORWARD, _rad(-45, 30), 8.0, 1.0)
    foot.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.8 * body.ankle_height, 0, 0],
        fromto=[heel + 0.03, 0.0, drop, heel + segment.length - 0.03, 0.0, drop], mass=0.0,
        rgba=list(BODY_COLOR),
    )  # fmt: skip


def _trunk_joints(
    child: mujoco.MjsBody, name: str, length: float, stiffness: float, damping: float
) -> None:
    at = (0.0, 0.0, -length)
    _joint(child, f"{name}_flexion", Y, _rad(-25, 45), stiffness, damping, at=at)
    _joint(child, f"{name}_lateral", X, _rad(-25, 25), stiffness, damping, at=at)
    _joint(child, f"{name}_rotation", Z, _rad(-25, 25), stiffness, damping, at=at)


def _upwards(parent: mujoco.MjsBody, name: str, length: float) -> mujoco.MjsBody:
    """The next segment above; its frame stands ``length`` above the parent's."""
    return parent.add_body(name=name, pos=[0.0, 0.0, length])


def _mass(body: mujoco.MjsBody, segment: Segment) -> None:
    _inertial(body, segment.mass, (0.0, 0.0, -segment.center), segment.inertia)


def _segment(parent: mujoco.MjsBody, name: str, at: Vector, segment: Segment) -> mujoco.MjsBody:
    child = parent.add_body(name=name, pos=list(at))
    _mass(child, segment)
    return child


def _inertial(
    body: mujoco.MjsBody,
    mass: float,
    center: Vector,
    inertia: Vector,
) -> None:
    body.mass, body.ipos, body.inertia = mass, list(center), list(inertia)
    body.explicitinertial = True


def _joint(
    child: mujoco.MjsBody,
    name: str,
    axis: Vector,
    limits: tuple[float, float],
    stiffness: float,
    damping: float,
    rest: float = 0.0,
    at: Vector = (0.0, 0.0, 0.0),
) -> mujoco.MjsJoint:
    """A sprung, damped hinge, at rest in the posture of the first touch."""
    joint = child.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=list(axis), pos=list(at)
    )
    joint.range, joint.limited = list(limits), mujoco.mjtLimited.mjLIMITED_TRUE
    joint.stiffness, joint.damping = [stiffness, 0.0, 0.0], [damping, 0.0, 0.0]
    joint.springref = rest
    return joint


def _ellipsoid(body: mujoco.MjsBody, size: Vector, height: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=list(size),
        pos=[0, 0, height],
        mass=0.0,
        rgba=list(BODY_COLOR),
    )


def _capsule(body: mujoco.MjsBody, radius: float, length: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0],
        fromto=[0, 0, -0.5 * radius, 0, 0, -length + 0.5 * radius], mass=0.0,
        rgba=list(BODY_COLOR),
    )  # fmt: skip


def _rad(low: float, high: float) -> tuple[float, float]:
    return math.radians(low), math.radians(high)
