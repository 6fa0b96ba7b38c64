"""Where the rider is at the first touch: the helmet on the surface, all moving as one."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.biomech.rotation import matrices, quaternions
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force import contact as contacts
from helmet_sim_ros.model.force.bodies import motion_of
from helmet_sim_ros.model.force.columns import first_touch
from helmet_sim_ros.model.force.contact import Contact
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.layout import Layout
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.state import State, read_state
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.shapes import nearest, tangent

LIFTS = 100  # steps along the target's normal until nothing overlaps
OVERLAP = 1e-9  # m, that is left
EARLIEST = 0.05  # s, a state is taken back by at most, on straight lines


def place(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    contact: Contact,
    surface: Surface,
    setup: ImpactSetup,
    helmet: Helmet,
) -> tuple[str, ...]:
    """Set pose and velocity: helmet just touching the surface's target, all moving as one.

    Args:
        model: compiled.
        data: new or reset; its qpos and qvel are set.
        contact: what may touch the surface besides a foam liner.
        surface: what is struck.
        setup: of the impact.
        helmet: of the setup, in the form that is simulated.

    Returns:
        What a user should know about the pose, in words.

    Raises:
        SetupError: the helmet cannot reach the target before something overlaps the surface.
    """
    target, frame = setup.surface_config.frame
    rotation = frame @ head_in_frame(setup)
    normal = frame[:, 2]
    # All joints at rest: posture and neck flexion are the springs' reference angles.
    data.qpos[7:] = model.qpos_spring[7:]
    touch = first_touch(helmet, rotation.T @ -normal)
    place_head(model, data, target - rotation @ touch, rotation)
    heading = math.radians(setup.tangential_heading_deg)
    along = setup.tangential_velocity * np.array([math.cos(heading), math.sin(heading), 0.0])
    data.qvel[0:3] = frame @ (along - [0.0, 0.0, setup.normal_velocity])
    return _lift(model, data, contact, surface, setup, normal)


def resume(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    layout: Layout,
    surface: Surface,
    setup: ImpactSetup,
    helmet: Helmet | None,
) -> tuple[str, ...]:
    """Set pose and velocities of a setup's state; the whole rider is sped up or slowed down alike
    so that the head has the setup's normal and tangential speed over the struck shape.

    A helmet that would lie in what it strikes, being larger than the one that the state was taken
    with, meets it earlier: the rider is taken back along his motion until it touches.

    Args:
        model, data, layout: see :func:`place`; qpos and qvel of ``data`` are set.
        surface: as it is at the state's time.
        setup: of the impact, with a state.
        helmet: as it is simulated; None: it keeps its place, as one that is dented already must.

    Returns:
        What a user should know about the pose, in words.

    Raises:
        SetupError: a state of another body.
    """
    assert setup.state is not None
    state = read_state(setup.state)
    if len(state.joint_positions) != len(layout.joints):
        raise SetupError.of(
            "impact.state", f"{len(state.joint_positions)} joint coordinates",
            f"must be of this body, which has {len(layout.joints)}",
        )  # fmt: skip
    layout.pose(data.qpos, layout.joints, state.joint_positions)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, state.orientation[[3, 0, 1, 2]])
    place_head(model, data, state.position, turn.reshape(3, 3))
    _put_on(data.qpos, layout, state)
    struck = nearest(surface, *state.point)[0]
    relative = state.velocity - surface.velocity[struck]
    along = relative - (relative @ state.normal) * state.normal
    length = float(np.linalg.norm(along))
    heading = along / length if length > 0.0 else np.array(tangent(*state.normal))
    velocity = surface.velocity[struck] + setup.tangential_velocity * heading
    velocity = velocity - setup.normal_velocity * state.normal
    data.qvel[:] = 0.0
    data.qvel[layout.qvel] = state.joint_velocities
    first, slide = layout.fit_velocity, layout.slide_velocity
    if first >= 0:  # a ball joint's velocity is in the axes of the child
        back = matrices(quaternions(state.turn[None]))[0].T
        data.qvel[first : first + 3] = state.shift_rate
        data.qvel[first + 3 : first + 6] = back @ state.turn_rate
    if slide >= 0:
        data.qvel[slide : slide + 3] = state.shell_rate
    move_head(model, data, velocity, state.angular_velocity)
    if helmet is None:
        return ()
    notes = _take_back(model, data, surface.velocity[struck], setup, helmet, state)
    if notes:
        move_head(model, data, velocity, state.angular_velocity)
    return notes


def _take_back(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    carried: FloatArray,
    setup: ImpactSetup,
    helmet: Helmet,
    state: State,
) -> tuple[str, ...]:
    """Go back in time until the helmet does not reach behind the struck point any more, seen from
    the struck shape, which moves with ``carried`` [m/s]; where that is long ago, away from it."""
    worn = data.body("head" if helmet.coupling == "none" else "helmet")

    def depth() -> float:
        turn = worn.xmat.reshape(3, 3)
        touch = worn.xpos + turn @ first_touch(helmet, turn.T @ -state.normal)
        return float((state.point - touch) @ state.normal)

    mujoco.mj_kinematics(model, data)
    first, earlier, lifted = depth(), 0.0, 0.0
    while (deep := depth()) > OVERLAP:
        back = max(deep / setup.normal_velocity, 1e-6)
        if earlier + back <= EARLIEST:
            earlier += back
            mujoco.mj_integratePos(model, data.qpos, data.qvel, -back)
            data.qpos[:3] += back * carried
        else:  # so slow that straight lines would lead nowhere
            lifted += deep
            data.qpos[:3] += deep * state.normal
        mujoco.mj_kinematics(model, data)
    if first <= OVERLAP:
        return ()
    how = f"{earlier * 1e3:.2f} ms earlier" if earlier else ""
    how += " and " if earlier and lifted else ""
    how += f"{lifted * 1e3:.1f} mm farther away" if lifted else ""
    return (
        f"the helmet reaches {first * 1e3:.1f} mm farther than the one that the state was taken "
        f"with: it starts {how}",
    )


def _put_on(qpos: FloatArray, layout: Layout, state: State) -> None:
    """The helmet as far from its place on the head as the state says."""
    first, slide = layout.fit, layout.slide
    if first >= 0:
        qpos[first : first + 3] = state.shift
        qpos[first + 3 : first + 7] = quaternions(state.turn[None])[0][[3, 0, 1, 2]]
    if slide >= 0:
        qpos[slide : slide + 3] = state.shell


def move_head(
    model: mujoco.MjModel, data: mujoco.MjData, velocity: FloatArray, spin: FloatArray
) -> None:
    """Set the root's velocity, joints as they move, so that the head's centre of gravity has the
    given velocity (3,) [m/s] and the head the given angular velocity (3,) [rad/s], world axes."""
    data.qvel[:6] = 0.0
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    own, head = np.empty(6), int(model.body("head").id)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, head, own, 0)
    turning = spin - own[:3]
    arm = data.xpos[head] - data.qpos[:3]
    data.qvel[:3] = velocity - own[3:] - np.cross(turning, arm)
    root = data.xmat[1].reshape(3, 3)
    data.qvel[3:6] = root.T @ turning  # of a free joint: in the axes of its body


def _lift(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    contact: Contact,
    surface: Surface,
    setup: ImpactSetup,
    normal: FloatArray,
) -> tuple[str, ...]:
    """Move everything along the target's normal until nothing overlaps the surface."""
    lifted, first = 0.0, -1
    for _ in range(LIFTS):
        which, shape, depth = contacts.deepest(contact, surface, motion_of(data))
        if depth <= OVERLAP:
            break
        first = which
        data.qpos[0:3] += depth * normal
        lifted += depth
        mujoco.mj_kinematics(model, data)
    else:
        raise SetupError.of(
            "impact.surface", setup.surface,
            f"{model.body(contact.body[first]).name} lies {depth * 1e3:.1f} mm in shape {shape} of "
            "it wherever the helmet strikes; choose another surface, direction or body_angle_deg",
        )  # fmt: skip
    if first < 0:
        return ()
    return (
        f"{model.body(contact.body[first]).name} touches the ground first, the helmet starts "
        f"{lifted * 1e3:.1f} mm above it; a larger body_angle_deg lets the helmet strike first",
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


def head_in_frame(setup: ImpactSetup) -> FloatArray:
    """Rotation matrix from the head to the frame of the surface's target at the first touch,
    shape (3, 3).

    That frame has z along the outward normal; on flat ground it is the world's. A headform
    strikes with the axis of ``direction``, or the one of azimuth and elevation, straight down; the
    way to the crown points along x. A rider lies with the body axis (feet
    to head) along x, inclined head down by ``body_angle_deg``, turned about it so that the side
    named by ``direction`` faces the surface (``top``: prone), and the head is bent towards the
    chest by the neck flexion.
    """
    down = np.array([0.0, 0.0, -1.0])
    if setup.rig != "rider":
        forward = np.array([1.0, 0.0, 0.0])
        if setup.azimuth_deg is not None or setup.elevation_deg is not None:
            return _struck_at(*site_deg(setup))
        if setup.direction == "top":
            return _frame("front", forward, down)
        return _frame(setup.direction, down, forward)  # the crown points along x
    beta = math.radians(setup.body_angle_deg)
    up = np.array([math.cos(beta), 0.0, -math.sin(beta)])
    facing = np.array([-math.sin(beta), 0.0, -math.cos(beta)])
    direction = "front" if setup.direction == "top" else setup.direction
    flexion = math.radians(setup.resolved_neck_flexion_deg)
    c, s = math.cos(flexion), math.sin(flexion)
    nod = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rotation: FloatArray = _frame(direction, facing, up) @ nod
    return rotation


#: Azimuth and elevation of each direction [deg].
SITES = {"front": (0.0, 0.0), "back": (180.0, 0.0), "left": (90.0, 0.0), "right": (-90.0, 0.0),
         "top": (0.0, 90.0)}  # fmt: skip


def site_deg(setup: ImpactSetup) -> tuple[float, float]:
    """Azimuth and elevation [deg] of the struck point's direction from the head's centre."""
    azimuth, elevation = SITES[setup.direction]
    if setup.azimuth_deg is not None:
        azimuth = setup.azimuth_deg
    if setup.elevation_deg is not None:
        elevation = setup.elevation_deg
    return azimuth, elevation


def _struck_at(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """Head axes with the struck direction straight down and the way to the crown along x."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    struck = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    crown = np.array([-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)])
    beside = np.cross(-struck, crown)
    rotation: FloatArray = np.array([crown, beside, -struck])
    return rotation


def _frame(direction: str, facing: FloatArray, up: FloatArray) -> FloatArray:
    """Head axes, the named side along ``facing``, z along ``up``."""
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
