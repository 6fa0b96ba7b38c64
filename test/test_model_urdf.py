"""The URDF of the rider moves as the compiled model does."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.urdf import WORLD, _origin, urdf

MOVING = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def frame(position, rotation) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def numbers(element, name, default="0 0 0") -> np.ndarray:
    return np.array((element.get(name) if element is not None else default).split(), float)


def link_poses(text: str, values: dict[str, float], floating: dict[str, np.ndarray]):
    """Pose of every link in the world, by URDF's own rules."""
    robot = ElementTree.fromstring(text)
    links = {link.get("name") for link in robot.iter("link")}
    poses, joints = {WORLD: np.eye(4)}, list(robot.iter("joint"))
    while joints:
        joint = next(j for j in joints if j.find("parent").get("link") in poses)
        joints.remove(joint)
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        origin, kind, name = joint.find("origin"), joint.get("type"), joint.get("name")
        turn = Rotation.from_euler("xyz", numbers(origin, "rpy")).as_matrix()
        pose = poses[parent] @ frame(numbers(origin, "xyz"), turn)
        if kind == "floating":
            pose = floating[child]
        elif kind != "fixed":
            axis = numbers(joint.find("axis"), "xyz")
            moved = values[name] * axis
            rotation = Rotation.from_rotvec(moved).as_matrix()
            slides = kind == "prismatic"
            pose = pose @ (frame(moved, np.eye(3)) if slides else frame(np.zeros(3), rotation))
        assert child not in poses, f"{child} has two parents"
        poses[child] = pose
    assert set(poses) == links
    return poses


@pytest.mark.parametrize(
    "setup",
    [
        ImpactSetup(),
        ImpactSetup(overrides={"helmet.coupling": "foam"}),
        ImpactSetup(rig="headform"),
    ],
    ids=["rider", "foam", "headform"],
)
def test_every_link_is_where_the_model_has_its_body(setup):
    model = Impact(setup).model
    data, random = mujoco.MjData(model), np.random.default_rng(7)
    data.qpos = random.uniform(-0.4, 0.4, model.nq)
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    bodies = {
        model.body(b).name: frame(data.xpos[b], data.xmat[b].reshape(3, 3))
        for b in range(1, model.nbody)
    }
    values = {
        model.joint(j).name: float(data.qpos[model.jnt_qposadr[j]])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in MOVING
    }
    poses = link_poses(urdf(model), values, bodies)
    for name, pose in bodies.items():
        assert np.allclose(poses[name], pose, atol=1e-6), name


def test_masses_add_up_and_limbs_are_drawn():
    model = Impact(ImpactSetup()).model
    robot = ElementTree.fromstring(urdf(model))
    masses = [float(mass.get("value")) for mass in robot.iter("mass")]
    assert sum(masses) == pytest.approx(float(model.body_mass.sum()), rel=1e-6)
    thigh = next(link for link in robot.iter("link") if link.get("name") == "thigh_left")
    assert [v.find("geometry")[0].tag for v in thigh.iter("visual")] == [
        "cylinder", "sphere", "sphere",
    ]  # fmt: skip
    revolute = [j.get("name") for j in robot.iter("joint") if j.get("type") == "revolute"]
    assert revolute and set(revolute) <= set(Impact(ImpactSetup()).record().joint_names)


def test_transforms_are_where_the_scene_draws_the_bodies():
    pytest.importorskip("rclpy", reason="transforms are ROS messages")
    from helmet_sim_ros import simulate
    from helmet_sim_ros.model.scene import Scene
    from helmet_sim_ros.nodes.robot_description import transforms

    setup = ImpactSetup(duration=0.01)
    record, scene = simulate(setup), Scene(setup)
    scene.pose(record, 100)
    found = {one.child_frame_id: one for one in transforms(scene, 1_500_000_000)}
    links = {link.get("name") for link in ElementTree.fromstring(urdf(scene.model)).iter("link")}
    assert set(found) <= links
    head = found["head"]
    assert (head.header.frame_id, head.header.stamp.sec) == (WORLD, 1)
    place, turn = head.transform.translation, head.transform.rotation
    assert np.allclose([place.x, place.y, place.z], record.head_position[100], atol=1e-9)
    given = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
    logged = Rotation.from_quat(record.head_orientation[100])
    assert (given * logged.inv()).magnitude() < 1e-6


@pytest.mark.parametrize("pitch", [-90.0, -60.0, 0.0, 89.9, 90.0])
def test_roll_pitch_and_yaw_turn_as_the_quaternion_does(pitch: float) -> None:
    """Also straight up and down, where roll and yaw turn about one axis."""
    for roll, yaw in ((0.0, 0.0), (20.0, -70.0), (-150.0, 130.0)):
        turn = Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=True)
        element = Element("visual")
        _origin(element, np.array([1.0, 2.0, 3.0]), turn.as_quat(scalar_first=True))
        origin = element.find("origin")
        assert origin is not None and origin.get("xyz") == "1 2 3"
        angles = [float(text) for text in str(origin.get("rpy")).split()]
        again = Rotation.from_euler("xyz", angles)
        assert (again.inv() * turn).magnitude() < 1e-5  # rad
