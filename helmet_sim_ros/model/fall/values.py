"""The values of a fall, from the posture to the surroundings, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.posture import Posture, load_posture
from helmet_sim_ros.model.head_surface import Head, HeadSurface
from helmet_sim_ros.model.headform import Headform
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.rider.posing import Posing
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.model.setup import (
    Rig,
    overridden_helmet,
    surface_of_head,
    told_helmet,
    with_overrides,
)
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.scenes import SCENE, Drive, load_scene, load_surface
from helmet_sim_ros.schema import Config, leaf_values, leaves, quantity

Bracing = Literal["passive", "arms"]

#: Arms held out to break a fall: reached forwards, slightly bent, and stiffer than passive ones by
#: this factor. Choices: 10 to 80 N m of a shoulder that gives way by 0.1 to 0.8 rad.
ARMS: Mapping[str, float] = {"shoulder_flexion": math.radians(75.0),
                             "elbow_flexion": math.radians(25.0)}  # fmt: skip
BRACED_STIFFNESS = 10.0


class FallValues(Config):
    """What defines a fall, each value for itself: whether the rider may start there is not asked.

    Raises:
        SetupError: any refused value, named with its key and the allowed range.
    """

    preset: str = Field(
        "motorcycle",
        description="posture at the start: name in config/postures (motorcycle, bicycle, "
        "pedestrian), or path to a YAML file",
    )
    speed: float | None = quantity(
        "along the heading, level; unset: that of the posture", "m/s", None, ge=0.0, le=40.0
    )
    vertical_speed: float = quantity("upwards", "m/s", 0.0, ge=-20.0, le=20.0)
    height: float | None = quantity(
        "of the hip joints above the ground; unset: that of the posture, or what keeps the feet "
        "out of the ground",
        "m", None, ge=0.0, le=10.0,
    )  # fmt: skip
    x: float = quantity("of the hips along the scene", "m", 0.0, ge=-50.0, le=50.0)
    y: float = quantity("of the hips across the scene, to the left", "m", 0.0, ge=-50.0, le=50.0)
    heading_deg: float = quantity(
        "direction of facing and speed, counter-clockwise from above; 0 is along the scene",
        "deg", 0.0, ge=-360.0, le=360.0,
    )  # fmt: skip
    pitch_deg: float = quantity(
        "whole body turned forwards, on top of the posture", "deg", 0.0, ge=-180.0, le=180.0
    )
    roll_deg: float = quantity("whole body leaning to its right", "deg", 0.0, ge=-180.0, le=180.0)
    spin: float = quantity(
        "turning about the vertical through the hips, counter-clockwise from above",
        "rad/s", 0.0, ge=-30.0, le=30.0,
    )  # fmt: skip
    pitch_rate: float = quantity("turning forwards", "rad/s", 0.0, ge=-30.0, le=30.0)
    roll_rate: float = quantity("turning to the right", "rad/s", 0.0, ge=-30.0, le=30.0)
    bracing: Bracing = Field(
        "passive",
        description="passive: joints hold the posture as weakly as a relaxed body; arms: both arms "
        "reach forwards, ten times stiffer",
    )
    scene: str = Field(
        "road", description="surroundings: name in config/scenes, or path to a YAML file"
    )
    traffic_speed: float | None = quantity(
        "of what moves in the scene, without the rider's own vehicle; unset: the scene's",
        "m/s", None, gt=0.0, le=60.0,
    )  # fmt: skip
    traffic_braking: float | None = quantity(
        "its deceleration; unset: the scene's", "m/s^2", None, ge=0.0, le=1000.0
    )
    friction: float | None = quantity(
        "friction of the shell on everything; unset: the surfaces'", "-", None, ge=0.0, le=2.0
    )
    gravity: float = quantity("gravity, downwards", "m/s^2", 9.80665, ge=0.0, le=30.0)
    helmet: str = Field(
        "fullface",
        description="name in config/helmets, or path to a YAML file; none: a bare head",
    )
    rider: Rider = Field(default_factory=Rider)
    head: Head = Field(default_factory=Head)
    duration: float = quantity(
        "simulated time, unless all is at rest before", "s", 2.0, ge=1e-3, le=5.0
    )
    time_step: float = quantity(
        "sampling step where the head is struck", "s", 5e-5, ge=1e-6, le=1e-3
    )
    overrides: dict[str, Any] = Field(
        default_factory=dict, description="dotted names of rider, helmet, head, fall or sim values"
    )

    @model_validator(mode="before")
    @classmethod
    def _normalise(cls, data: Any) -> Any:
        return with_overrides(data, FALL_KEYS)

    @model_validator(mode="after")
    def _consistent(self) -> FallValues:
        if self.duration < 10 * self.time_step:
            raise SetupError.of("duration", self.duration, "must be at least 10 time steps")
        if self.head.form is not None:
            raise SetupError.of(
                "head.form", self.head.form, "must be unset: a rider has a head of his own"
            )
        scene = load_scene(self.scene)
        for key in ("traffic_speed", "traffic_braking"):
            if getattr(self, key) is not None and not scene.has_traffic:
                raise SetupError.of(
                    key, getattr(self, key),
                    f"has no effect: nothing but the rider moves in scene {self.scene}",
                )  # fmt: skip
        # Refuse a bad file now, not when it runs.
        _ = self.helmet_config, self.surface_config, self.head_surface, self.posture
        return self

    @property
    def rig(self) -> Rig:
        """A whole rider falls."""
        return "rider"

    @property
    def headform(self) -> Headform | None:
        """None: a rider has a head of his own."""
        return None

    @cached_property
    def posture(self) -> Posture:
        """How the rider sits, stands or walks at the start."""
        return load_posture(self.preset)

    @cached_property
    def posing(self) -> Posing:
        """Where the joints are at the start, where they rest and how stiff they are."""
        start = self.posture.angles()
        if self.bracing == "passive":
            return Posing.resting(start)
        arms = {f"{joint}_{side}": angle for joint, angle in ARMS.items()
                for side in ("left", "right")}  # fmt: skip
        return Posing.resting(start | arms, dict.fromkeys(arms, BRACED_STIFFNESS), start)

    @cached_property
    def helmet_config(self) -> Helmet:
        """The helmet with its overrides applied."""
        return overridden_helmet(self.helmet, self.overrides)

    @cached_property
    def surface(self) -> str:
        """The name of everything that surrounds the rider, as an impact's surface."""
        scene = load_scene(self.scene)
        if not (scene.has_traffic or scene.has_own_vehicle):
            return SCENE + self.scene
        drive = Drive(self.resolved_speed, self.traffic_speed, self.traffic_braking)
        return f"{SCENE}{self.scene}@{drive.text()}"

    @cached_property
    def surface_config(self) -> SurfaceConfig:
        """Everything that surrounds the rider."""
        return load_surface(self.surface)

    @cached_property
    def head_surface(self) -> HeadSurface:
        """The surface of the head in the liner."""
        return surface_of_head(self.head_surface_name, self.head)

    @property
    def head_surface_name(self) -> str:
        """The head surface that is used."""
        return self.head.surface or "scalp"

    @property
    def resolved_speed(self) -> float:
        """The speed along the heading that is used [m/s]."""
        return self.posture.speed if self.speed is None else self.speed

    @property
    def resolved_neck_flexion_deg(self) -> float:
        """How far the neck is bent at the start, and rests [deg]."""
        return self.posture.neck_flexion_deg

    @property
    def samples(self) -> int:
        """Number of samples of the record."""
        return round(self.duration / self.time_step) + 1

    @property
    def closing_speed(self) -> float:
        """The fastest that the head may meet anything with, but for spin [m/s]."""
        height = self.height or self.posture.height or self.rider.height
        fallen = math.sqrt(2.0 * self.gravity * (height + self.rider.height))
        driven = max(float(np.linalg.norm(s.velocity)) for s in self.surface_config.shapes)
        return math.hypot(self.resolved_speed + driven, abs(self.vertical_speed) + fallen)

    def described(self) -> dict[str, Any]:
        """Every value by its dotted name, as plain JSON data, for logs and provenance."""
        values = {name: getattr(self, field) for name, field in FALL_KEYS.items()}
        values["fall.speed"] = self.resolved_speed
        values |= {f"rider.{k}": v for k, v in leaf_values(self.rider).items()}
        values["head.form"] = None
        values["head.surface"] = self.head_surface_name
        values["head.friction"] = self.head_surface.friction
        values["helmet.name"] = self.helmet
        values |= told_helmet(self.helmet_config)
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}


def _fall_keys() -> dict[str, str]:
    """Dotted name -> field of a fall, for the values it holds itself."""
    names = {}
    for leaf in leaves(FallValues):
        if "." not in leaf.name and leaf.name != "helmet":
            group = "sim" if leaf.name in ("duration", "time_step") else "fall"
            names[f"{group}.{leaf.name}"] = leaf.name
    return names


FALL_KEYS = _fall_keys()
