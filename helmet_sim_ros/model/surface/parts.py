"""The shapes of a surface as a user writes them: kind, pose and sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.surface import compiled
from helmet_sim_ros.model.surface.compiled import Size
from helmet_sim_ros.schema import Config, quantity

Vector = tuple[float, float, float]


class Panel(Config):
    """What gives way behind the face of a shape: an effective mass on a spring and damper."""

    stiffness: float = quantity("of the panel under the face", "N/m", ge=1e3, le=1e8)
    mass: float = quantity("effective, of the struck part of the panel", "kg", ge=0.1, le=100.0)
    damping_ratio: float = quantity("of panel and spring", "-", 0.1, ge=0.0, le=2.0)
    returned: float = quantity(
        "share of the elastic energy that the panel gives back", "-", 0.2, ge=0.02, le=1.0
    )
    source: str = Field("", description="where its numbers come from")

    @property
    def damping(self) -> float:
        """Of the panel [N s/m]."""
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness * self.mass)


class _Part(Config):
    """Pose and friction of any shape; its kind gives the sizes."""

    name: str = Field("", description="what a report calls the shape; unset: its kind")

    position: Vector = quantity("origin of the shape, world axes", "m", (0.0, 0.0, 0.0))
    tilt_deg: float = quantity(
        "turn about the world x axis that lowers the +y side: normal (0, sin, cos) of a level face",
        "deg", 0.0, ge=-180.0, le=180.0,
    )  # fmt: skip
    rotation_deg: Vector | None = quantity(
        "turn about the world axes x, then y, then z; instead of tilt_deg", "deg", None
    )
    friction: float | None = quantity(
        "of a shell on this shape; unset: the surface's", "-", None, ge=0.0, le=2.0
    )
    panel: Panel | None = Field(None, description="what gives way behind it; unset: it is rigid")
    velocity: Vector = quantity("of what carries the shape, at the start", "m/s", (0.0, 0.0, 0.0))
    braking: float = quantity(
        "deceleration of what carries it, until it stands", "m/s^2", 0.0, ge=0.0, le=1000.0
    )

    @model_validator(mode="after")
    def _one_turn(self) -> _Part:
        if self.rotation_deg is not None and "tilt_deg" in self.model_fields_set:
            raise SetupError.of(
                "rotation_deg", self.rotation_deg, "must not be given beside tilt_deg"
            )
        return self

    @property
    def is_carried(self) -> bool:
        """Whether it moves or gives way."""
        return self.panel is not None or any(self.velocity)

    @property
    def rotation(self) -> FloatArray:
        """Shape axes to world, (3, 3)."""
        x, y, z = (-self.tilt_deg, 0.0, 0.0) if self.rotation_deg is None else self.rotation_deg
        return _turn(2, z) @ _turn(1, y) @ _turn(0, x)


class HalfSpace(_Part):
    """Everything below a plane: road, ground, inclined plane. ``position`` is a point of it."""

    kind: Literal["half_space"]

    @property
    def size(self) -> Size:
        """Size row, see :class:`.compiled.Surface`; so in all classes below."""
        return 0.0, 0.0, 0.0, 0.0, 0.0

    @property
    def half_thickness(self) -> float:
        """Greatest depth inside [m]: no distance inside is greater; so in all classes below."""
        return math.inf


class Sphere(_Part):
    """A ball, or the cap of one that a helmet can reach. ``position`` is its centre."""

    kind: Literal["sphere"]
    radius: float = quantity("radius", "m", gt=0.0, le=100.0)

    @property
    def size(self) -> Size:
        return self.radius, 0.0, 0.0, 0.0, 0.0

    @property
    def half_thickness(self) -> float:
        return self.radius


class Capsule(_Part):
    """A bar or post with round ends along its z axis. ``position`` is its middle."""

    kind: Literal["capsule"]
    radius: float = quantity("radius", "m", gt=0.0, le=100.0)
    length: float = quantity("from end to end", "m", gt=0.0, le=1000.0)

    @model_validator(mode="after")
    def _long_enough(self) -> Capsule:
        if self.length < 2.0 * self.radius:
            raise SetupError.of(
                "length", self.length, f"must be at least twice the radius, {2 * self.radius:g} m"
            )
        return self

    @property
    def size(self) -> Size:
        return self.radius, 0.5 * self.length - self.radius, 0.0, 0.0, 0.0

    @property
    def half_thickness(self) -> float:
        return self.radius


class Box(_Part):
    """A box with rounded edges and corners. ``position`` is its centre."""

    kind: Literal["box"]
    half_sizes: Vector = quantity("half the outer lengths along x, y, z", "m")
    edge_radius: float = quantity("of all edges and corners", "m", 0.0, ge=0.0, le=100.0)

    @model_validator(mode="after")
    def _rounded(self) -> Box:
        _positive("half_sizes", self.half_sizes)
        _fits(self.edge_radius, min(self.half_sizes), "the smallest half size")
        return self

    @property
    def size(self) -> Size:
        x, y, z = (half - self.edge_radius for half in self.half_sizes)
        return self.edge_radius, x, y, z, 0.0

    @property
    def half_thickness(self) -> float:
        return min(self.half_sizes)


class Disc(_Part):
    """A flat round plate with rounded rims across its z axis. ``position`` is its centre."""

    kind: Literal["disc"]
    radius: float = quantity("outer radius", "m", gt=0.0, le=100.0)
    height: float = quantity("thickness", "m", gt=0.0, le=100.0)
    edge_radius: float = quantity("of both rims", "m", 0.0, ge=0.0, le=100.0)

    @model_validator(mode="after")
    def _rounded(self) -> Disc:
        _fits(self.edge_radius, min(self.radius, 0.5 * self.height), "radius and half the height")
        return self

    @property
    def size(self) -> Size:
        r = self.edge_radius
        return r, self.radius - r, 0.5 * self.height - r, 0.0, 0.0

    @property
    def half_thickness(self) -> float:
        return min(self.radius, 0.5 * self.height)


class Wedge(_Part):
    """Two plane faces that meet in a rounded edge along x; ``position`` is the middle of its crest.

    The faces fall from the crest to both sides of y, plane down to ``height`` below it; what lies
    deeper, and the ends, is rounded like the edge.
    """

    kind: Literal["wedge"]
    half_angle_deg: float = quantity("of each face to the vertical", "deg", ge=5.0, le=85.0)
    edge_radius: float = quantity("of the edge between the faces", "m", ge=0.0, le=100.0)
    length: float = quantity("along the edge, round ends included", "m", gt=0.0, le=1000.0)
    height: float = quantity("crest to the foot of the plane faces", "m", gt=0.0, le=100.0)

    @model_validator(mode="after")
    def _rounded(self) -> Wedge:
        _fits(self.edge_radius, 0.5 * self.length, "half the length")
        rounding = self.edge_radius * (1.0 - math.sin(math.radians(self.half_angle_deg)))
        if self.height <= rounding:
            raise SetupError.of(
                "height", self.height, f"must be above the height of the rounding, {rounding:.4g} m"
            )
        return self

    @property
    def size(self) -> Size:
        angle, r = math.radians(self.half_angle_deg), self.edge_radius
        sine, cosine = math.sin(angle), math.cos(angle)
        return r, 0.5 * self.length - r, self.height - r * (1.0 - sine), sine, cosine

    @property
    def half_thickness(self) -> float:
        r, half, height, sine, _ = self.size
        return r + min(half, height * sine / (1.0 + sine))  # of the core: circle in the triangle


class Ellipsoid(_Part):
    """An ellipsoid. ``position`` is its centre."""

    kind: Literal["ellipsoid"]
    semi_axes: Vector = quantity("semi-axes x, y, z", "m")

    @model_validator(mode="after")
    def _solid(self) -> Ellipsoid:
        _positive("semi_axes", self.semi_axes)
        return self

    @property
    def size(self) -> Size:
        return 0.0, *self.semi_axes, 0.0

    @property
    def half_thickness(self) -> float:
        return min(self.semi_axes)


Part = HalfSpace | Sphere | Capsule | Box | Disc | Wedge | Ellipsoid

#: Kind as written -> class and compiled kind.
KINDS: dict[str, tuple[type[Part], int]] = {
    "half_space": (HalfSpace, compiled.HALF_SPACE),
    "sphere": (Sphere, compiled.SPHERE),
    "capsule": (Capsule, compiled.CAPSULE),
    "box": (Box, compiled.BOX),
    "disc": (Disc, compiled.DISC),
    "wedge": (Wedge, compiled.WEDGE),
    "ellipsoid": (Ellipsoid, compiled.ELLIPSOID),
}


class Target(Config):
    """The point of the surface that the chosen part of the helmet meets first."""

    point: Vector = quantity("world axes", "m", (0.0, 0.0, 0.0))
    tilt_deg: float = quantity(
        "normal (0, sin, cos): as the tilt of an inclined plane", "deg", 0.0, ge=-180.0, le=180.0
    )
    normal: Vector | None = quantity(
        "outward normal of the surface at the point, any length; instead of tilt_deg", "-", None
    )
    x_axis: Vector = quantity(
        "heading 0 of the tangential speed, any length; its part along the normal does not count",
        "-", (1.0, 0.0, 0.0),
    )  # fmt: skip

    @model_validator(mode="after")
    def _a_frame(self) -> Target:
        if self.normal is not None:
            if "tilt_deg" in self.model_fields_set:
                raise SetupError.of("normal", self.normal, "must not be given beside tilt_deg")
            if not np.linalg.norm(self.normal) > 1e-6:
                raise SetupError.of("normal", self.normal, "must be longer than 1e-6")
        x = np.array(self.x_axis)
        if not np.linalg.norm(np.cross(self.unit_normal, x)) > 1e-3 * np.linalg.norm(x):
            raise SetupError.of(
                "x_axis", self.x_axis, "must not be zero or point along the normal of the target"
            )
        return self

    @property
    def is_level(self) -> bool:
        """Whether the normal points straight up."""
        return bool(self.unit_normal[2] == 1.0)

    @property
    def unit_normal(self) -> FloatArray:
        """Outward normal, (3,)."""
        if self.normal is None:
            tilt = math.radians(self.tilt_deg)
            return np.array([0.0, math.sin(tilt), math.cos(tilt)])
        normal: FloatArray = np.array(self.normal)
        return normal / float(np.linalg.norm(normal))

    @property
    def rotation(self) -> FloatArray:
        """Local axes to world, (3, 3): heading 0, heading 90 deg, normal."""
        normal = self.unit_normal
        x = np.array(self.x_axis)
        x = x - (x @ normal) * normal
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(normal, x), normal])


def part_of(data: object, key: str) -> Part:
    """One shape from what a file says; ``key`` is what an error calls it (``shapes[0]``).

    Raises:
        SetupError: unknown kind, unknown, missing or refused value.
    """
    if isinstance(data, _Part):
        return data  # type: ignore[return-value]
    if not isinstance(data, Mapping):
        raise SetupError.of(key, data, "must be a mapping of keys to values")
    kind = data.get("kind")
    if kind not in KINDS:
        raise SetupError.of(f"{key}.kind", kind, "must be one of " + ", ".join(KINDS))
    try:
        part: Part = KINDS[kind][0].from_mapping(data)
    except SetupError as error:
        raise SetupError(
            [Problem(f"{key}.{p.key}", p.value, p.allowed) for p in error.problems]
        ) from None
    return part


def _turn(axis: int, angle_deg: float) -> FloatArray:
    """Rotation about one of the axes, (3, 3)."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[j, j], turn[j, k], turn[k, j], turn[k, k] = c, -s, s, c
    return turn


def _positive(key: str, values: Vector) -> None:
    if not all(0.0 < value <= 100.0 for value in values):
        raise SetupError.of(key, values, "each must be above 0 and at most 100 m")


def _fits(edge_radius: float, most: float, what: str) -> None:
    if edge_radius > most:
        raise SetupError.of("edge_radius", edge_radius, f"must not exceed {what}, {most:g} m")
