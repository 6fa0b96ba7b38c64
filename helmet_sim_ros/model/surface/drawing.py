"""What a surface looks like: simple solids, and the same as MuJoCo geoms without contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.parts import (
    Box,
    Capsule,
    Disc,
    Ellipsoid,
    HalfSpace,
    Part,
    Sphere,
    Vector,
    Wedge,
)

GROUND = "ground"  # name of the geom of flat ground
PLATE = 0.002  # m, thickness of the drawn faces of a wedge

_GEOMS = {
    "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
}


@dataclass(frozen=True)
class Primitive:
    """One solid to draw, in the conventions of MuJoCo's geoms.

    Attributes:
        kind: ``plane`` (endless, normal z), ``sphere``, ``capsule`` and ``cylinder`` (along z),
            ``box`` or ``ellipsoid``.
        size: [m]; radius; radius and half length of the straight part; half sizes; semi-axes.
        position: world axes, (3,) [m].
        rotation: its axes to world, (3, 3).
    """

    kind: str
    size: Vector
    position: FloatArray
    rotation: FloatArray


def drawn(surface: SurfaceConfig, time: float = 0.0) -> list[Primitive]:
    """The solids that show a surface at a time [s] after the start; panels are drawn undented.
    Rounded edges of boxes and discs are drawn sharp."""
    places = surface.moving(None, time).position
    return [
        solid
        for part, place in zip(surface.shapes, places, strict=True)
        for solid in _solids(part, place.copy())
    ]


def add_geoms(
    spec: mujoco.MjSpec, surface: SurfaceConfig, rgba: tuple[float, float, float, float]
) -> None:
    """Add the solids to the world body, as geoms that touch nothing.

    They are called ``surface_0``, ``surface_1``, ...; the plane of flat ground alone ``ground``.
    """
    for index, solid in enumerate(drawn(surface)):
        geom = spec.worldbody.add_geom(
            name=GROUND if surface.is_flat_ground else f"surface_{index}",
            type=_GEOMS[solid.kind], size=list(solid.size), pos=solid.position, rgba=list(rgba),
            contype=0, conaffinity=0,
        )  # fmt: skip
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, solid.rotation.flatten())
        geom.quat = quaternion


def _solids(part: Part, position: FloatArray) -> list[Primitive]:
    rotation = part.rotation
    if isinstance(part, HalfSpace):
        return [Primitive("plane", (0.0, 0.0, 1.0), position, rotation)]
    if isinstance(part, Sphere):
        return [Primitive("sphere", (part.radius, 0.0, 0.0), position, rotation)]
    if isinstance(part, Capsule):
        straight = 0.5 * part.length - part.radius
        return [Primitive("capsule", (part.radius, straight, 0.0), position, rotation)]
    if isinstance(part, Box):
        return [Primitive("box", part.half_sizes, position, rotation)]
    if isinstance(part, Disc):
        return [Primitive("cylinder", (part.radius, 0.5 * part.height, 0.0), position, rotation)]
    if isinstance(part, Ellipsoid):
        return [Primitive("ellipsoid", part.semi_axes, position, rotation)]
    return _wedge(part, position, rotation)


def _wedge(part: Wedge, position: FloatArray, rotation: FloatArray) -> list[Primitive]:
    """The two faces as plates, and the edge as a capsule."""
    r, angle = part.edge_radius, math.radians(part.half_angle_deg)
    sine, cosine = math.sin(angle), math.cos(angle)
    slope = (part.height - r * (1.0 - sine)) / cosine  # length of a plane face
    solids = []
    for side in (1.0, -1.0):
        normal = np.array([0.0, side * cosine, sine])
        down = np.array([0.0, side * sine, -cosine])
        axes = np.column_stack([np.cross(down, normal), down, normal])
        middle = np.array([0.0, 0.0, -r]) + (r - 0.5 * PLATE) * normal + 0.5 * slope * down
        solids.append(
            Primitive(
                "box",
                (0.5 * part.length, 0.5 * slope, 0.5 * PLATE),
                position + rotation @ middle,
                rotation @ axes,
            )
        )
    if r > 0.0:
        along_x = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
        solids.append(
            Primitive(
                "capsule",
                (r, 0.5 * part.length - r, 0.0),
                position + rotation @ np.array([0.0, 0.0, -r]),
                rotation @ along_x,
            )
        )
    return solids
