"""What a user configures of the rider: size, neck, posture."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal

from pydantic import Field, model_validator

from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.schema import Config, quantity

Sex = Literal["male", "female"]

#: Names of the neck of version 0.1, which described it as one joint, and what takes their place.
RETIRED: Mapping[str, str] = MappingProxyType(
    {
        "axial_stiffness": "compression_per_level and tension_per_level",
        "axial_damping": "axial_damping_per_level",
        "bending_stiffness": "flexion_per_level, extension_per_level and lateral_per_level",
        "torsion_stiffness": "torsion_per_level",
        "damping": "rotation_damping_per_level",
    }
)


class Neck(Config):
    """Passive neck: properties of one of its eight levels (C0-C1 to C7-T1), which act in series.

    Sources, each marked as read or as general literature knowledge: docs/model.md, Neck.
    """

    flexion_per_level: float = quantity(
        "bending stiffness of one level, head towards the chest",
        "N m/rad", 86.0, ge=1.0, le=5000.0,
    )  # fmt: skip
    extension_per_level: float = quantity(
        "bending stiffness of one level, head towards the back", "N m/rad", 86.0, ge=1.0, le=5000.0
    )
    lateral_per_level: float = quantity(
        "bending stiffness of one level to either side", "N m/rad", 86.0, ge=1.0, le=5000.0
    )
    torsion_per_level: float = quantity(
        "torsional stiffness of one level", "N m/rad", 66.0, ge=1.0, le=5000.0
    )
    rotation_damping_per_level: float = quantity(
        "damping of one level against bending and torsion", "N m s/rad", 1.5, ge=0.0, le=100.0
    )
    compression_per_level: float = quantity(
        "stiffness of one level pressed together, below the plateau",
        "N/m", 492e3, ge=1e4, le=1e7,
    )  # fmt: skip
    tension_per_level: float = quantity(
        "stiffness of one level pulled apart", "N/m", 356e3, ge=1e4, le=1e7
    )
    axial_damping_per_level: float = quantity(
        "damping of one level along the neck", "N s/m", 1000.0, ge=0.0, le=1e5
    )
    compression_plateau: float = quantity(
        "compression at which the neck yields; what it yields it does not give back",
        "N", 2870.0, ge=100.0, le=1e5,
    )  # fmt: skip
    tension_plateau: float = quantity(
        "tension at which the neck yields", "N", 3370.0, ge=100.0, le=1e5
    )

    @model_validator(mode="before")
    @classmethod
    def _not_retired(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            refuse_retired(data)
        return data


class Posture(Config):
    """Joint angles of the limbs at the first touch; 0 is standing upright, arms down."""

    shoulder_flexion_deg: float = quantity("arms raised forwards", "deg", 0.0, ge=-45.0, le=170.0)
    elbow_flexion_deg: float = quantity("elbows bent", "deg", 20.0, ge=0.0, le=140.0)
    hip_flexion_deg: float = quantity("thighs raised forwards", "deg", 15.0, ge=-15.0, le=115.0)
    knee_flexion_deg: float = quantity("knees bent", "deg", 20.0, ge=0.0, le=140.0)


class Rider(Config):
    """The rider: de Leva's body of a man or a woman, scaled by height and mass."""

    sex: Sex = Field("male", description="whose segment table is scaled")
    height: float = quantity("standing height", "m", 1.75, ge=1.2, le=2.2)
    mass: float = quantity("body mass", "kg", 77.0, ge=30.0, le=180.0)
    head_mass: float | None = quantity(
        "mass of the head without neck; unset: from a regression on sex, height and body mass",
        "kg", None, ge=2.5, le=7.0,
    )  # fmt: skip
    neck: Neck = Field(default_factory=Neck)
    posture: Posture = Field(default_factory=Posture)


def refuse_retired(values: Mapping[str, Any], prefix: str = "") -> None:
    """Refuse by name what described the neck of version 0.1.

    Args:
        values: what a user set, by name.
        prefix: of the names, for example ``neck.``.

    Raises:
        SetupError: names every such value and what takes its place.
    """
    problems = [
        Problem(f"{prefix}{name}", values[f"{prefix}{name}"],
                f"no longer acts: the neck has properties per level; use {successors}")
        for name, successors in RETIRED.items() if f"{prefix}{name}" in values
    ]  # fmt: skip
    if problems:
        raise SetupError(problems)
