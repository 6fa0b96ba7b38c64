"""Which parts of a rider can touch each other, made from the geoms of the compiled model."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from helmet_sim_ros.model.force.self_contact import SelfContact
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.rest import AtRest
from helmet_sim_ros.model.rider import tissue
from helmet_sim_ros.model.rider.anthropometry import Anthropometry

Vector = tuple[float, float, float]

FRICTION = 0.3  # of clothing on clothing (general literature value)
SIDES = ("left", "right")
ARM, LEG = ("upper_arm", "forearm", "hand"), ("thigh", "shank", "foot")
#: What the helmet meets of the trunk, at a height of 1.75 m: radius [m], distance from the
#: mid-plane to the ends of its segment [m], depth below the top of the thorax [m]. General anatomy:
#: acromion and clavicles, front and back of the chest.
SHOULDERS, CHEST = (0.050, 0.110, 0.088), (0.095, 0.050, 0.120)
#: How far the helmet reaches below the head's centre of gravity over the height of its shell: a
#: full-face helmet is open around the neck (choice).
RIM = 0.65
HARD = tissue.Region(np.inf, 0.0)


class Part(NamedTuple):
    """One part, see :class:`SelfContact`; ``name`` of a trunk's or limb's, or of the helmet."""

    name: str
    body: int
    start: Vector
    end: Vector
    radius: float
    semi_axes: tuple[float, float, float, float]


def self_contact(
    model: mujoco.MjModel, helmet: Helmet, body: Anthropometry, rest: AtRest
) -> SelfContact:
    """Parts and pairs of a rider; of a model without rider, none."""
    rider = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "thorax") >= 0
    parts = list(_parts(model, helmet, body.scale)) if rider else []
    index = {part.name: i for i, part in enumerate(parts)}
    pairs = [(index[a], index[b]) for a, b in _pairs()] if rider else []
    bodies = np.array([part.body for part in parts], dtype=np.int64)
    ends = np.array([(part.start, part.end) for part in parts]).reshape(-1, 2, 3)
    semi_axes = np.array([part.semi_axes for part in parts]).reshape(-1, 4)
    radius = np.array([part.radius for part in parts])
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    reach = np.where(radius > 0.0, half + radius, semi_axes.max(axis=1, initial=0.0))
    masses = np.minimum(*(rest.lightest_masses(bodies, end) for end in (ends[:, 0], ends[:, 1])))
    first, second = (np.array([pair[k] for pair in pairs], dtype=np.int64) for k in (0, 1))
    # Two tissues in series; the helmet is hard.
    regions = [
        HARD if part.name == "helmet" else tissue.region_of(part.name, body.scale) for part in parts
    ]
    soft, thick = np.array(regions).reshape(-1, 2).T
    stiffness = 1.0 / (1.0 / soft[first] + 1.0 / soft[second])
    thickness = thick[first] + thick[second]
    mass = 1.0 / (1.0 / masses[first] + 1.0 / masses[second])
    straight = tissue.straight_share(stiffness, mass, tissue.SELF_STEP)
    return SelfContact(
        bodies, np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1]), radius,
        semi_axes, reach, first, second, np.zeros(len(pairs)),
        stiffness, thickness, straight, mass, tissue.DAMPING, FRICTION, np.zeros((len(parts), 9)),
    )  # fmt: skip


def _parts(model: mujoco.MjModel, helmet: Helmet, scale: float) -> Iterator[Part]:
    for name in ("pelvis", "abdomen", "thorax"):
        body = model.body(name)
        geom = int(body.geomadr[0])
        at, size = _vector(model.geom_pos[geom]), model.geom_size[geom]
        yield Part(name, int(body.id), at, at, 0.0, (*_vector(size), float(size[2])))
    thorax, shell = int(model.body("thorax").id), helmet.shell
    for name, (radius, half, depth) in (("shoulders", SHOULDERS), ("chest", CHEST)):
        yield Part(
            f"thorax_{name}", thorax, (0.0, -scale * half, -scale * depth),
            (0.0, scale * half, -scale * depth), scale * radius, (0.0, 0.0, 0.0, 0.0),
        )  # fmt: skip
    worn = helmet.coupling != "none"
    yield Part(
        "helmet", int(model.body("helmet_rest" if worn else "head").id),
        shell.center, shell.center, 0.0,
        (*shell.semi_axes, (RIM if worn else 1.0) * shell.semi_axes[2]),
    )  # fmt: skip
    for limb, side in itertools.product((*ARM, *LEG), SIDES):
        body = model.body(f"{limb}_{side}")
        geom = int(body.geomadr[0])
        radius, half = model.geom_size[geom][:2]
        axis = np.zeros(9)
        mujoco.mju_quat2Mat(axis, model.geom_quat[geom])
        along = half * axis.reshape(3, 3)[:, 2]
        at = model.geom_pos[geom]
        yield Part(
            f"{limb}_{side}", int(body.id), _vector(at - along), _vector(at + along),
            float(radius), (0.0, 0.0, 0.0, 0.0),
        )  # fmt: skip


def _pairs() -> Iterator[tuple[str, str]]:
    """Names of the parts that can touch; what a joint joins is left out."""
    for part in ("thorax_shoulders", "thorax_chest"):
        yield "helmet", part
    for limb, side in itertools.product((*ARM, "thigh", "shank"), SIDES):
        yield "helmet", f"{limb}_{side}"
    for trunk, limbs in (
        ("thorax", ("forearm", "hand", *LEG)),
        ("abdomen", ("forearm", "hand", *LEG)),
        ("pelvis", ("forearm", "hand", "shank", "foot")),
    ):
        for limb, side in itertools.product(limbs, SIDES):
            yield trunk, f"{limb}_{side}"
    for both in (ARM, LEG):
        for a, b in itertools.product(both, both):
            yield f"{a}_left", f"{b}_right"
    for a, b in itertools.product(ARM[1:], LEG):
        for one, other in itertools.product(SIDES, SIDES):
            yield f"{a}_{one}", f"{b}_{other}"


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
