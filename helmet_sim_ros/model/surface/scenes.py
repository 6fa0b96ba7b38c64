"""Surfaces and scenes by name; ``config/surfaces``, ``config/scenes``.

A scene is what surrounds a fall, composed of surfaces in their places: a surface of many shapes,
some of which move. The rider starts over the origin and heads along x (heading 0).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from pydantic import Field, model_validator

from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.parts import HalfSpace, Part, Vector
from helmet_sim_ros.schema import Config, quantity

SCENE = "scene:"  # begins the name of a surface that is a scene


class Placed(Config):
    """A surface in its place in a scene."""

    surface: str = Field(description="name in config/surfaces, or path to a YAML file")
    name: str = Field("", description="begins the names of its shapes; unset: nothing")
    position: Vector = quantity("of the surface's origin", "m", (0.0, 0.0, 0.0))
    heading_deg: float = quantity(
        "turn about the vertical, counter-clockwise from above",
        "deg", 0.0, ge=-360.0, le=360.0,
    )  # fmt: skip
    speed: float = quantity(
        "at which it moves along its own x axis at the start", "m/s", 0.0, ge=0.0, le=60.0
    )
    with_rider: bool = Field(
        False, description="the rider's own vehicle: moves as fast as he does at the start"
    )
    braking: float = quantity("its deceleration", "m/s^2", 0.0, ge=0.0, le=1000.0)

    def shapes(self) -> tuple[Part, ...]:
        """Its shapes, moved and turned."""
        angle = math.radians(self.heading_deg)
        c, s = math.cos(angle), math.sin(angle)
        placed = []
        surface = load_config(SurfaceConfig, "surfaces", self.surface, "surface")
        for part in surface.shapes:
            x, y, z = part.position
            position = (
                self.position[0] + c * x - s * y, self.position[1] + s * x + c * y,
                self.position[2] + z,
            )  # fmt: skip
            turn = (-part.tilt_deg, 0.0, 0.0) if part.rotation_deg is None else part.rotation_deg
            changes = {
                "name": " ".join(filter(None, (self.name, part.name))),
                "position": position,
                "rotation_deg": (turn[0], turn[1], turn[2] + self.heading_deg),
                "friction": surface.friction if part.friction is None else part.friction,
                "velocity": (self.speed * c, self.speed * s, 0.0),
                "braking": self.braking,
            }
            given = {name: getattr(part, name) for name in type(part).model_fields}
            del given["tilt_deg"]
            placed.append(type(part)(**(given | changes)))
        return tuple(placed)


class SceneConfig(SurfaceConfig):
    """A scene: ``parts`` of the file become ``shapes``, beside which it may have its own."""

    shapes: tuple[Part, ...] = Field((), description="shapes beside those of the parts")
    parts: tuple[Placed, ...] = Field((), description="surfaces in their places")

    @model_validator(mode="before")
    @classmethod
    def _compose(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("parts"), list | tuple):
            return data
        placed = [
            item if isinstance(item, Placed) else Placed.from_mapping(item)
            for item in data["parts"]
        ]
        shapes = [shape for item in placed for shape in item.shapes()]
        return {**data, "parts": tuple(placed), "shapes": (*shapes, *data.get("shapes", ()))}

    @model_validator(mode="after")
    def _target_on_surface(self) -> SceneConfig:
        """A scene has no target; it needs a ground instead."""
        level = [s for s in self.shapes if isinstance(s, HalfSpace) and s.rotation[2, 2] > 0.5]
        if not level:
            raise SetupError.of(
                "parts", [item.surface for item in self.parts],
                "must hold a ground (a half_space that faces up): without it nothing ends a fall",
            )  # fmt: skip
        return self

    @property
    def is_carried(self) -> bool:
        """As if something moved, wherever there is more than one shape: the plate of a helmet's
        shell, made for one blow, is left out of scenes."""
        return len(self.shapes) > 1 or super().is_carried

    @property
    def has_traffic(self) -> bool:
        """Whether anything moves that is not the rider's own."""
        return any(part.speed > 0.0 and not part.with_rider for part in self.parts)

    @property
    def has_own_vehicle(self) -> bool:
        """Whether the rider's own vehicle is there."""
        return any(part.with_rider for part in self.parts)


class Drive(NamedTuple):
    """How fast what moves in a scene moves, where it is not as the scene says.

    Attributes:
        own: speed of the rider's own vehicle [m/s].
        traffic: speed of all else that moves [m/s]; ``braking``: its deceleration [m/s^2].
    """

    own: float = 0.0
    traffic: float | None = None
    braking: float | None = None

    def text(self) -> str:
        """As it stands behind a scene's name."""
        return ",".join("" if value is None else repr(float(value)) for value in self)

    @classmethod
    def read(cls, text: str, key: str) -> Drive:
        """The inverse of :meth:`text`.

        Raises:
            SetupError: not three numbers from 0 on.
        """
        try:
            values = [float(word) if word else None for word in text.split(",")]
            own, traffic, braking = values
        except ValueError:
            raise SetupError.of(key, text, "must be three numbers OWN,TRAFFIC,BRAKING") from None
        if any(v is not None and not 0.0 <= v <= 1000.0 for v in values):
            raise SetupError.of(key, text, "each must be from 0 to 1000")
        return cls(own or 0.0, traffic, braking)

    def of(self, part: Placed) -> Placed:
        """A part at this speed."""
        if part.with_rider:
            return part.model_copy(update={"speed": self.own})
        if part.speed == 0.0:
            return part
        speed = part.speed if self.traffic is None else self.traffic
        braking = part.braking if self.braking is None else self.braking
        return part.model_copy(update={"speed": speed, "braking": braking})


@lru_cache(maxsize=256)
def driven(scene: SceneConfig, drive: Drive) -> SceneConfig:
    """A scene with what moves in it moving otherwise."""
    parts = tuple(drive.of(part) for part in scene.parts)
    placed = sum(len(part.shapes()) for part in parts)
    return scene.model_copy(
        update={
            "parts": parts,
            "shapes": (*(s for part in parts for s in part.shapes()), *scene.shapes[placed:]),
        }
    )


def load_surface(name_or_path: str) -> SurfaceConfig:
    """The surface of ``config/surfaces/NAME.yaml``, or of any YAML file by path; ``scene:NAME`` is
    the scene of ``config/scenes/NAME.yaml`` as one surface.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    if name_or_path.startswith(SCENE):
        return load_scene(name_or_path.removeprefix(SCENE), "impact.surface")
    return load_config(SurfaceConfig, "surfaces", name_or_path, "impact.surface")


def load_scene(name_or_path: str, key: str = "fall.scene") -> SceneConfig:
    """The scene of ``config/scenes/NAME.yaml``, or of any YAML file by path; behind ``@`` how what
    moves in it is driven, see :class:`Drive`.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    name_or_path, at, text = name_or_path.partition("@")
    scene = load_config(SceneConfig, "scenes", name_or_path, key)
    return driven(scene, Drive.read(text, key)) if at else scene
