"""The neck: two links between three ball joints, the upper one telescoping along its axis.

The eight levels of the cervical spine (C0-C1 to C7-T1) stand for three joints: the upper for the
two levels above C2, the middle and the lower for three each, so that the neck can bow like a
buckling spine (Nightingale et al., J. Bone Joint Surg. 78-A, 1996: extension between C3 and C6,
flexion below). The compression of all levels acts in one slide. Shear is left out: eight levels of
about 120 N/mm (Moroney et al. 1988, general literature value) give 15 kN/m in series, four times
the 3 to 4 kN/m with which bending lets the head move across the neck.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.biomech.rotation import rotation_vectors
from helmet_sim_ros.model.force.neck import CervicalSpine, largest_excess
from helmet_sim_ros.model.rider.anthropometry import Anthropometry, Segment, cylinder
from helmet_sim_ros.model.rider.properties import Neck

LEVELS = 8
#: Joint, from the thorax upwards: levels, and range of motion [deg] in flexion, extension, to
#: either side and in torsion. White & Panjabi 1990 give the range of each level (general
#: literature values); they are scaled to the whole neck's 65 / 75 / 45 / 75 deg.
JOINTS: dict[str, tuple[int, tuple[float, float, float, float]]] = {
    "neck_lower": (3, (22.0, 25.0, 14.0, 15.0)),
    "neck_middle": (3, (21.5, 25.0, 23.5, 17.0)),
    "neck_upper": (2, (21.5, 25.0, 7.5, 43.0)),
}
HEAD_FORWARD = 0.020  # m, head's centre of gravity before the head-neck joint (general: 10 to 25)
#: How far the middle joint stands before the line of the others [m]: an arc of 94 mm and 45 deg,
#: the lordosis of an upright neck (general), has a rise of 9 mm.
BOW = 0.010
#: Shortening that cadavers' necks survived to be measured: 60 mm (Ivancic, J. Athl. Train. 47(4),
#: 2012). A neck that lost more is destroyed, and the record says so.
MEASURED_SHORTENING = 0.060  # m
TOLD_EXCESS = math.radians(10.0)  # beyond the range of motion, which the record tells; choice
#: Where skull and shoulders meet at the latest [m] and how stiff, over the neck's own stiffness
#: (choices: the plateau goes on through a crown drop at 5 m/s, and no head passes the chest).
BOTTOM, BOTTOM_STIFFENING = 0.170, 20.0
_HINGES = ("flexion", "lateral", "rotation")  # of a joint of version 0.1, about y, x and z
STOP_STIFFENING = 5.0  # stiffness of a ball joint's stop over the joint's; choice


def add_neck(thorax: mujoco.MjsBody, neck: Neck, body: Anthropometry) -> mujoco.MjsBody:
    """Add the neck's links and joints on top of the thorax.

    Returns:
        The body ``head``, still without mass, jointed to the neck.
    """
    whole = body.segments["neck"]
    half = cylinder(0.5 * whole.mass, 0.5 * whole.length, _radius(whole))
    bow = BOW * body.scale
    lower = _link(thorax, "neck_lower", half, bow)
    _ball(lower, "neck_lower", -half.length, neck)
    upper = _link(lower, "neck_upper", half, bow)
    _ball(upper, "neck_middle", -half.length, neck, bow)
    slide = upper.add_joint(
        name="neck_axial", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0]
    )
    slide.damping = [neck.axial_damping_per_level / LEVELS, 0.0, 0.0]
    forward, up = HEAD_FORWARD * body.scale, body.head_joint_depth - body.head_depth
    head = upper.add_body(name="head", pos=[forward, 0.0, up])
    _ball(head, "neck_upper", -up, neck, -forward)
    head.add_site(name="neck_load", pos=[-forward, 0.0, -up])
    return head


def set_rest(model: mujoco.MjModel, flexion: float) -> None:
    """Let the neck rest bent towards the chest by ``flexion`` [rad], shared like the range."""
    whole = sum(ranges[0] for _, ranges in JOINTS.values())
    for name, (_, ranges) in JOINTS.items():
        half_angle = 0.5 * flexion * ranges[0] / whole
        first = int(model.joint(name).qposadr[0])
        model.qpos_spring[first : first + 4] = math.cos(half_angle), 0.0, math.sin(half_angle), 0.0


def cervical_spine(model: mujoco.MjModel, neck: Neck) -> CervicalSpine:
    """What the neck's force needs to know; of a model without rider, a neck without joints."""
    names = [name for name in JOINTS if mujoco.mj_name2id(
        model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0]  # fmt: skip
    joints = [model.joint(name) for name in names]
    levels = np.array([JOINTS[name][0] for name in names], dtype=float)
    ranges = np.radians([JOINTS[name][1] for name in names]).reshape(-1, 4)
    per_level = np.array(
        [
            neck.flexion_per_level, neck.extension_per_level, neck.lateral_per_level,
            neck.torsion_per_level,
        ]
    )  # fmt: skip
    stiffness: FloatArray = per_level / levels[:, None]
    rest = np.array([model.qpos_spring[int(j.qposadr[0]) :][:4] for j in joints]).reshape(-1, 4)
    axial = model.joint("neck_axial") if names else None
    return CervicalSpine(
        qpos=np.array([int(j.qposadr[0]) for j in joints], dtype=np.int64),
        qvel=np.array([int(j.dofadr[0]) for j in joints], dtype=np.int64),
        slide=(int(axial.qposadr[0]), int(axial.dofadr[0])) if axial is not None else (-1, -1),
        rest=rest,
        stiffness=stiffness,
        ranges=ranges,
        stop_stiffness=np.ascontiguousarray(STOP_STIFFENING * stiffness[:, [0, 3]]),
        compression=neck.compression_per_level / LEVELS,
        tension=neck.tension_per_level / LEVELS,
        plateaus=(neck.compression_plateau, neck.tension_plateau),
        bottom=BOTTOM,
        bottom_stiffness=BOTTOM_STIFFENING * neck.compression_per_level / LEVELS,
        yielded=np.zeros(1),
    )


def named_today(
    joints: tuple[str, ...], positions: FloatArray
) -> tuple[tuple[str, ...], FloatArray]:
    """Joint coordinates of a record; the two triples of hinges of version 0.1 as ball joints.

    Args:
        joints: names of the record's coordinates, (m,).
        positions: their values in one sample, (m,) [rad, or m for a sliding joint].
    """
    old = {f"{name}_{turn}" for name in ("neck_lower", "neck_upper") for turn in _HINGES}
    if not old.issubset(joints):
        return joints, positions
    from scipy.spatial.transform import Rotation  # 20 MB that only a former log needs

    values = dict(zip(joints, positions, strict=True))
    named = {name: value for name, value in values.items() if name not in old}
    for name in ("neck_lower", "neck_upper"):
        angles = [values[f"{name}_{turn}"] for turn in _HINGES]
        turned = Rotation.from_euler("YXZ", angles).as_rotvec()
        named |= {f"{name}.{axis}": turned[i] for i, axis in enumerate("xyz")}
    return tuple(named), np.array(list(named.values()))


def overload(neck: CervicalSpine, positions: FloatArray) -> tuple[str, ...]:
    """What the neck suffered beyond what a neck has, in words.

    Args:
        positions: qpos of every sample since the first touch, (samples, nq).
    """
    if not len(neck.qpos) or not len(positions):
        return ()
    turns = [
        rotation_vectors(positions[:, [first + 1, first + 2, first + 3, first]])
        for first in neck.qpos
    ]
    return strained(neck, positions[:, neck.slide[0]], turns)


def strained(
    neck: CervicalSpine, lengths: FloatArray, turns: Sequence[FloatArray]
) -> tuple[str, ...]:
    """What a neck suffered beyond what a neck has, in words.

    Args:
        lengths: of the slide, against that at rest, (n,) [m].
        turns: rotation vectors of each of ``JOINTS``, (n, 3) [rad].
    """
    notes = []
    shortened = -float(lengths.min()) - neck.plateaus[0] / neck.compression
    if shortened > 0.0:
        beyond = ", more than was measured" if shortened > MEASURED_SHORTENING else ""
        notes.append(
            f"the neck yielded at {neck.plateaus[0] / 1e3:.2f} kN of compression and lost "
            f"{shortened * 1e3:.0f} mm of its length{beyond}"
        )
    if lengths.max() > neck.plateaus[1] / neck.tension:
        notes.append(f"the neck yielded at {neck.plateaus[1] / 1e3:.2f} kN of tension")
    for name, bent, ranges in zip(JOINTS, turns, neck.ranges, strict=True):
        excess = largest_excess(bent, ranges)
        if excess > TOLD_EXCESS:
            notes.append(f"{name} bent {math.degrees(excess):.0f} deg beyond its range of motion")
    return tuple(notes)


def _link(parent: mujoco.MjsBody, name: str, segment: Segment, bow: float) -> mujoco.MjsBody:
    link = parent.add_body(name=name, pos=[0.0, 0.0, segment.length])
    link.mass, link.inertia = segment.mass, list(segment.inertia)
    link.ipos, link.explicitinertial = [0.5 * bow, 0.0, -segment.center], True
    return link


def _ball(
    child: mujoco.MjsBody, name: str, height: float, neck: Neck, forward: float = 0.0
) -> None:
    joint = child.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL, pos=[forward, 0.0, height])
    joint.damping = [neck.rotation_damping_per_level / JOINTS[name][0], 0.0, 0.0]


def _radius(cylinder_: Segment) -> float:
    return math.sqrt(2.0 * cylinder_.inertia[2] / cylinder_.mass)
