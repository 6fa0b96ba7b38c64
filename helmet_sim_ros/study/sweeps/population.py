"""Riders drawn from published body measures: height, mass and head mass of women and men."""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.setup import setup_leaves
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.yaml_file import read_yaml

#: Random numbers that one rider takes: sex, height, mass, head circumference.
DIMENSIONS = 4
#: Measures of a drawn rider, and all setup values that he or she sets.
NAMES = ("rider.height", "rider.mass", "rider.head_mass")
VALUES = (*NAMES, "rider.sex")


class HeadMass(Config):
    """Regression of the head's mass: a + b circumference + c body mass."""

    intercept: float = quantity("constant", "kg")
    per_circumference: float = quantity("slope over head circumference", "kg/m")
    per_mass: float = quantity("slope over body mass", "kg/kg")


class Sex(Config):
    """Body measures of one sex: height and head circumference normal, mass lognormal."""

    height: tuple[float, float] = quantity("mean and standard deviation", "m")
    log_mass: tuple[float, float] = quantity("mean and standard deviation of ln(mass / kg)", "-")
    head_circumference: tuple[float, float] = quantity("mean and standard deviation", "m")
    height_mass: float = quantity("correlation of height and ln(mass)", "-", ge=-0.99, le=0.99)
    height_circumference: float = quantity("correlation", "-", ge=-0.99, le=0.99)
    mass_circumference: float = quantity(
        "correlation of ln(mass) and circumference", "-", ge=-0.99, le=0.99
    )

    @property
    def correlation(self) -> FloatArray:
        """Of height, ln(mass) and head circumference, shape (3, 3)."""
        a, b, c = self.height_mass, self.height_circumference, self.mass_circumference
        return np.array([[1.0, a, b], [a, 1.0, c], [b, c, 1.0]])

    @model_validator(mode="after")
    def _possible(self) -> Sex:
        for name in ("height", "log_mass", "head_circumference"):
            if getattr(self, name)[1] <= 0.0:
                raise SetupError.of(name, getattr(self, name), "the deviation must be above 0")
        if np.linalg.eigvalsh(self.correlation)[0] <= 0.0:
            raise SetupError.of("height_mass", self.height_mass, "no such three correlations exist")
        return self


class Population(Config):
    """A published population, from ``config/populations``."""

    source: str = Field(description="who was measured, and where the numbers stand")
    notes: str = Field("", description="what a user of these riders must know")
    head_mass: HeadMass
    female: Sex
    male: Sex

    def riders(self, unit: FloatArray, female_share: float) -> dict[str, list[object]]:
        """Riders at points of the unit cube.

        Sex sets the distribution of height, mass and head circumference, and whose segment table
        the body follows. What lies beyond the range of a setup value (fewer than one in 100 000)
        is moved to its edge.

        Args:
            unit: shape (n, 4), in [0, 1).
            female_share: share of women [-].

        Returns:
            ``VALUES`` and ``population.sex``, n values each.
        """
        from scipy.special import ndtri

        normal = ndtri(np.clip(unit[:, 1:], 1e-12, 1.0 - 1e-12))
        female = unit[:, 0] < female_share
        columns = np.zeros((len(unit), 3))
        for is_female, sex in ((True, self.female), (False, self.male)):
            here = female == is_female
            z = normal[here] @ np.linalg.cholesky(sex.correlation).T
            height = sex.height[0] + sex.height[1] * z[:, 0]
            mass = np.exp(sex.log_mass[0] + sex.log_mass[1] * z[:, 1])
            around = sex.head_circumference[0] + sex.head_circumference[1] * z[:, 2]
            law = self.head_mass
            head = law.intercept + law.per_circumference * around + law.per_mass * mass
            columns[here] = np.column_stack([height, mass, head])
        leaves = {leaf.name: leaf for leaf in setup_leaves()}
        low, high = ([getattr(leaves[n], side) for n in NAMES] for side in ("minimum", "maximum"))
        columns = np.clip(columns, low, high)
        drawn: dict[str, list[object]] = {n: columns[:, i].tolist() for i, n in enumerate(NAMES)}
        drawn["rider.sex"] = np.where(female, "female", "male").tolist()
        drawn["population.sex"] = list(drawn["rider.sex"])
        return drawn


def load_population(name_or_path: str) -> Population:
    """The population of ``config/populations/NAME.yaml``, or of any such file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    path = find_config("populations", name_or_path, "population")
    return Population.from_mapping(read_yaml(path, "population"), str(path))  # type: ignore[no-any-return]
