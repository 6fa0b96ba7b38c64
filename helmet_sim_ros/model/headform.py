"""Headforms of test houses: mass, inertia and planes as data; read from ``config/headforms``."""

from __future__ import annotations

from pydantic import Field, model_validator

from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.schema import Config, quantity

Vector = tuple[float, float, float]


class Origin(Config):
    """Where a number comes from."""

    source: str = Field(description="document that states it, or how it was estimated")
    verified: bool = Field(description="whether that document was read")


class Mass(Origin):
    """Mass of a headform without helmet and without what carries it."""

    value: float = quantity("mass", "kg", ge=2.0, le=8.0)


class Inertia(Origin):
    """Principal moments of inertia about the centre of gravity, head axes."""

    value: Vector = quantity("about x (front), y (left), z (up)", "kg m^2")

    @model_validator(mode="after")
    def _of_a_body(self) -> Inertia:
        low, middle, high = sorted(self.value)
        if low <= 0.0 or high > 0.1 or low + middle < high:
            raise SetupError.of(
                "value", self.value,
                "each must be above 0 and at most 0.1 kg m^2, none above the sum of the others",
            )  # fmt: skip
        return self


class Length(Origin):
    """A length on a headform."""

    value: float = quantity("length", "m", gt=0.0, le=0.8)


class Headform(Config):
    """A headform: what takes the place of the head in a test of helmets.

    Planes as in ISO/DIS 6220: the basic plane through ear openings and lower orbits, the reference
    plane above it, the crown above that.
    """

    description: str = Field("", description="what it is")
    mass: Mass
    inertia: Inertia
    circumference: Length | None = Field(None, description="at the reference plane")
    reference_plane: Length | None = Field(None, description="height above the basic plane")
    crown: Length | None = Field(None, description="height above the reference plane")
    surface: str = Field(description="surface in the liner: name in config/head_surfaces")


def load_headform(name_or_path: str) -> Headform:
    """The headform of ``config/headforms/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    return load_config(Headform, "headforms", name_or_path, "head.form")
