"""How a rider sits, stands or walks when a fall begins: joint angles from ``config/postures``."""

from __future__ import annotations

import math
from typing import Any

from pydantic import Field, model_validator

from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.rider.anthropometry import anthropometry
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.schema import Config, quantity

SIDES = ("left", "right")
#: Joints of a posture, each of one hinge of the trunk, or of both sides of the limbs.
TRUNK = tuple(f"{part}_{turn}" for part in ("lumbar", "thoracic")
              for turn in ("flexion", "lateral", "rotation"))  # fmt: skip
LIMBS = (
    "shoulder_flexion", "shoulder_abduction", "shoulder_rotation", "elbow_flexion",
    "wrist_flexion", "hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion",
    "ankle_flexion",
)  # fmt: skip


class Posture(Config):
    """A posture: angles that are not given are 0, standing upright with the arms down."""

    description: str = Field("", description="who sits, stands or walks how")
    source: str = Field("", description="where its numbers come from")
    height: float | None = quantity(
        "of the hip joints above the ground; unset: the rider stands on it",
        "m", None, ge=0.0, le=5.0,
    )  # fmt: skip
    speed: float = quantity("usual of who sits, stands or walks so", "m/s", 0.0, ge=0.0, le=40.0)
    pitch_deg: float = quantity("pelvis leaning forwards", "deg", 0.0, ge=-90.0, le=90.0)
    neck_flexion_deg: float = quantity("head bent towards the chest", "deg", 0.0, ge=-60.0, le=60.0)
    joints: dict[Any, Any] = Field(default_factory=dict, description="joint -> angle [deg]")

    @model_validator(mode="after")
    def _known_joints(self) -> Posture:
        known = [*TRUNK, *LIMBS, *(f"{joint}_{side}" for joint in LIMBS for side in SIDES)]
        for name, angle in self.joints.items():
            if name not in known:
                allowed = "unknown joint; known: " + ", ".join([*TRUNK, *LIMBS])
                raise SetupError.of(f"joints.{name}", angle, allowed)
            if isinstance(angle, bool) or not isinstance(angle, int | float):
                raise SetupError.of(f"joints.{name}", angle, "must be a number deg")
            if not -180.0 <= angle <= 180.0:
                raise SetupError.of(
                    f"joints.{name}", angle, "must be a number from -180 to 180 deg"
                )
        return self

    def angles(self) -> dict[str, float]:
        """Angle of every hinge that is not 0, by the joint's name in the model [rad]."""
        found: dict[str, float] = {}
        for name, angle in self.joints.items():  # of both sides first: one side may differ
            if name in LIMBS:
                found |= {f"{name}_{side}": math.radians(angle) for side in SIDES}
        found |= {n: math.radians(a) for n, a in self.joints.items() if n not in LIMBS}
        return found


def load_posture(name_or_path: str) -> Posture:
    """The posture of ``config/postures/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    return load_config(Posture, "postures", name_or_path, "fall.preset")


def hip_depth(rider: Rider) -> float:
    """Hip joints below the origin of the pelvis [m], when the rider stands."""
    return anthropometry(rider).segments["lower_trunk"].length
