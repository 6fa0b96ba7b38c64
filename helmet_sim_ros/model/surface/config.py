"""Surface configuration: shapes and the point where the helmet meets them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.surface.compiled import (
    BRAKING,
    CARRIED,
    DAMPING,
    MASS,
    PLACE,
    RETURNED,
    SPEED,
    STIFFNESS,
    Surface,
    at_rest,
)
from helmet_sim_ros.model.surface.parts import KINDS, HalfSpace, Part, Target, part_of
from helmet_sim_ros.schema import Config, quantity

ON_SURFACE = 1e-6  # m, how far from the surface a target may be
PROBE = 1e-3  # m, along a normal; the distance grows as much, and only along a normal
SLACK = 1e-6  # of that growth; the normal may be off by 0.08 deg


class SurfaceConfig(Config):
    """What helmet and body strike: rigid shapes, and the point that the helmet meets first."""

    description: str = Field("", description="what it represents")
    source: str = Field("", description="where its numbers come from")
    verified: bool = Field(False, description="whether the primary source was read")
    friction: float = quantity("of a helmet shell on the surface", "-", 0.4, ge=0.0, le=2.0)
    shapes: tuple[Part, ...] = Field(description="convex shapes, see model/surface/parts.py")
    target: Target = Field(default_factory=Target)

    @model_validator(mode="before")
    @classmethod
    def _shapes_by_kind(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("shapes"), list | tuple):
            return data
        parts: list[Part] = []
        problems: list[Problem] = []
        for index, item in enumerate(data["shapes"]):
            try:
                parts.append(part_of(item, f"shapes[{index}]"))
            except SetupError as error:
                problems += error.problems
        if problems:
            raise SetupError(problems)
        return {**data, "shapes": tuple(parts)}

    @model_validator(mode="after")
    def _target_on_surface(self) -> SurfaceConfig:
        if not self.shapes:
            raise SetupError.of("shapes", [], "must hold at least one shape")
        if self.is_flat_ground and self.target.point == (0.0, 0.0, 0.0) and self.target.is_level:
            return self  # and the compiler need not be loaded
        from helmet_sim_ros.model.surface.shapes import signed_distance

        surface, target = self.compiled(), self.target
        point, normal = np.array(target.point), target.unit_normal
        distance = [signed_distance(surface, i, *point)[0] for i in range(len(self.shapes))]
        touched = [i for i, d in enumerate(distance) if abs(d) <= ON_SURFACE]
        nearest = int(np.argmin(np.abs(distance)))
        if not touched:
            raise SetupError.of(
                "target.point", target.point,
                f"must lie on the surface within {ON_SURFACE:g} m; it is "
                f"{abs(distance[nearest]):.3g} m {'inside' if distance[nearest] < 0 else 'off'} "
                f"{self._named(nearest)}",
            )  # fmt: skip
        deepest = int(np.argmin(distance))
        if distance[deepest] < -ON_SURFACE:
            raise SetupError.of(
                "target.point", target.point,
                f"must not lie inside a shape; it is on {self._named(touched[0])} and "
                f"{-distance[deepest]:.3g} m inside {self._named(deepest)}, which overlaps it",
            )  # fmt: skip
        beside = point + PROBE * normal
        if not any(
            signed_distance(surface, i, *beside)[0] - distance[i] >= PROBE * (1.0 - SLACK)
            for i in touched
        ):
            there = signed_distance(surface, touched[0], *(point + 1e-9 * normal))[1:4]
            raise SetupError.of(
                "target.normal", tuple(round(float(v), 6) for v in normal),
                f"must be an outward normal of {self._named(touched[0])} at the target, "
                f"e.g. {[round(v, 6) for v in there]}",
            )  # fmt: skip
        return self

    def compiled(self, friction: float | None = None) -> Surface:
        """The shapes for compiled code, shared by all that ask: not to be changed.

        Args:
            friction: of the shell on every shape [-]; ``None``: what the file says.
        """
        return compile_parts(self.shapes, self.friction, friction)

    def moving(self, friction: float | None = None, time: float = 0.0) -> Surface:
        """The shapes as they are at a time [s] after the start, with a state of their own where
        anything moves or gives way; friction as in :meth:`compiled`."""
        surface = self.compiled(friction)
        if not self.is_carried:
            return surface
        carrier = np.zeros((len(self.shapes), CARRIED))
        for row, part in zip(carrier, self.shapes, strict=True):
            if part.panel is not None:
                panel = part.panel
                row[[STIFFNESS, MASS, DAMPING]] = panel.stiffness, panel.mass, panel.damping
            row[RETURNED] = 1.0 if part.panel is None else part.panel.returned
            row[BRAKING] = part.braking
            velocity = np.array(part.velocity)
            speed = float(np.linalg.norm(velocity))
            driven = time if part.braking == 0.0 else min(time, speed / part.braking)
            left = 0.0 if speed == 0.0 else 1.0 - part.braking * driven / speed
            way = velocity * driven * 0.5 * (1.0 + left)
            row[PLACE : PLACE + 3] = np.array(part.position) + way
            row[SPEED : SPEED + 3] = velocity * left
        position, velocity = carrier[:, PLACE : PLACE + 3], carrier[:, SPEED : SPEED + 3]
        return surface._replace(
            position=position.copy(), velocity=velocity.copy(),
            reaction=np.zeros(position.shape), carrier=carrier,
        )  # fmt: skip

    @property
    def is_carried(self) -> bool:
        """Whether anything in it moves or gives way."""
        return any(part.is_carried for part in self.shapes)

    def name_of(self, index: int) -> str:
        """What a report calls a shape."""
        part = self.shapes[index]
        return part.name or part.kind.replace("_", " ")

    @property
    def frame(self) -> tuple[FloatArray, FloatArray]:
        """The target: point (3,) [m], and local axes to world (3, 3).

        The columns are heading 0, heading 90 deg and the outward normal.
        """
        return np.array(self.target.point), self.target.rotation

    @property
    def half_thickness(self) -> float:
        """Depth [m] that the signed distance cannot exceed in the thinnest shape."""
        return min(part.half_thickness for part in self.shapes)

    def falls_away(self, radius: float) -> float:
        """Greatest distance [m] from the shapes of a ring about the target in its tangent plane, of
        that radius [m]; 0 or less on a plane."""
        from helmet_sim_ros.model.surface.shapes import signed_distance  # loads the compiler

        point, axes = self.frame
        turns = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
        ring = point + radius * (axes[:, :2] @ [np.cos(turns), np.sin(turns)]).T
        surface, shapes = self.compiled(), range(len(self.shapes))
        return float(max(min(signed_distance(surface, k, *p)[0] for k in shapes) for p in ring))

    @property
    def is_flat_ground(self) -> bool:
        """Whether it is the plane z = 0 and nothing else."""
        if len(self.shapes) != 1 or not isinstance(self.shapes[0], HalfSpace):
            return False
        part = self.shapes[0]
        return part.position[2] == 0.0 and bool(part.rotation[2, 2] == 1.0)

    def _named(self, index: int) -> str:
        return f"shapes[{index}] ({self.shapes[index].kind})"


@lru_cache(maxsize=64)
def compile_parts(
    parts: tuple[Part, ...], common: float = 0.0, override: float | None = None
) -> Surface:
    """Shapes for compiled code; friction is the override, else the shape's own, else ``common``."""
    friction = [
        override if override is not None else common if part.friction is None else part.friction
        for part in parts
    ]
    return at_rest(
        np.array([KINDS[part.kind][1] for part in parts], dtype=np.int64),
        np.array([part.position for part in parts], dtype=float),
        np.array([part.rotation.flatten() for part in parts]),
        np.array([part.size for part in parts], dtype=float),
        np.array(friction, dtype=float),
    )
