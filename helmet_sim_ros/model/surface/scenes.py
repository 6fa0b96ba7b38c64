"""Scenes: what surrounds a fall, composed of surfaces in their places; ``config/scenes``.

A scene is a surface of many shapes, some of which move. The rider starts over the origin and
heads along x (heading 0).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.surface.config import SurfaceConfig, load_surface
from helmet_sim_ros.model.surface.parts import HalfSpace, Part, Vector
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.yaml_file import read_yaml


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
    braking: float = quantity("its deceleration", "m/s^2", 0.0, ge=0.0, le=1000.0)

    def shapes(self) -> tuple[Part, ...]:
        """Its shapes, moved and turned."""
        angle = math.radians(self.heading_deg)
        c, s = math.cos(angle), math.sin(angle)
        placed = []
        surface = load_surface(self.surface)
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


@lru_cache(maxsize=32)
def _load(path: Path, _mtime_ns: int, key: str) -> SceneConfig:
    return SceneConfig.from_mapping(read_yaml(path, key), str(path))  # type: ignore[no-any-return]


def load_scene(name_or_path: str, key: str = "fall.scene") -> SceneConfig:
    """The scene of ``config/scenes/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    path = find_config("scenes", name_or_path, key)
    return _load(path, path.stat().st_mtime_ns, key)
