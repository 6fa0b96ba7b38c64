"""The foam law against published compression data of EPS (``config/references/eps.yaml``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.foam import foam_row, loading_stress, rate_factor
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.study.validation.experiments import Reading
from helmet_sim_ros.yaml_file import read_yaml


class FoamPoint(Config):
    """One measured stress."""

    density: float = quantity("of the foam", "kg/m^3", ge=5.0, le=200.0)
    strain: float = quantity("compressive", "-", gt=0.0, lt=1.0)
    stress: float = quantity("at that strain", "Pa", gt=0.0, le=1e8)
    low: float | None = quantity("lower end of what is published", "Pa", None, gt=0.0)
    high: float | None = quantity("upper end of what is published", "Pa", None, gt=0.0)


class FoamData(Config):
    """Measured stresses of one source at one strain rate."""

    name: str = Field(description="short name")
    source: str = Field(description="publication")
    reading: Reading = Field(description="how it was read")
    kind: Literal["minimum", "typical"] = Field(
        description="minimum: what a specification demands; typical: measured"
    )
    rate: float = quantity("strain rate", "1/s", gt=0.0, le=1e5)
    points: tuple[FoamPoint, ...]

    @model_validator(mode="before")
    @classmethod
    def _points(cls, data: Any) -> Any:
        return _built(data, "points", FoamPoint)


class FoamReference(Config):
    """Everything that is known of EPS here."""

    description: str = ""
    data: tuple[FoamData, ...]

    @model_validator(mode="before")
    @classmethod
    def _data(cls, data: Any) -> Any:
        return _built(data, "data", FoamData)


@dataclass(frozen=True)
class FoamFinding:
    """The law at one published point.

    Attributes:
        data: where it is from; ``point`` what was published.
        law: stress of the law [Pa], at its own rate; ``at_rate`` brought to that of the test.
    """

    data: FoamData
    point: FoamPoint
    law: float
    at_rate: float

    @property
    def difference(self) -> float:
        """Of ``at_rate`` from the published stress [-]."""
        return self.at_rate / self.point.stress - 1.0


def load_foam_reference(path: str | Path | None = None) -> FoamReference:
    """The data of a file; unset: ``config/references/eps.yaml``.

    Raises:
        SetupError: unreadable, or a refused value.
    """
    place = share_directory() / "config" / "references" / "eps.yaml" if path is None else Path(path)
    data = read_yaml(place, "references")
    return FoamReference.from_mapping(data, str(place))  # type: ignore[no-any-return]


def foam_findings(reference: FoamReference) -> tuple[FoamFinding, ...]:
    """The law at every published point."""
    found = []
    for data in reference.data:
        for point in data.points:
            row = foam_row(point.density, 0.05)
            law = float(loading_stress(point.strain, row))
            found.append(FoamFinding(data, point, law, law * rate_factor(data.rate, row)))
    return tuple(found)


def density_exponents(
    found: tuple[FoamFinding, ...],
) -> Mapping[tuple[str, float], tuple[float, float]]:
    """Exponent of the density in the published stresses and in the law, by data and strain.

    Least squares of the logarithms, where there are at least three densities.
    """
    groups: dict[tuple[str, float], list[FoamFinding]] = {}
    for one in found:
        groups.setdefault((one.data.name, one.point.strain), []).append(one)
    exponents = {}
    for key, own in groups.items():
        if len({one.point.density for one in own}) < 3:
            continue
        density = np.log([one.point.density for one in own])
        published, law = (
            float(np.polyfit(density, np.log(values), 1)[0])
            for values in ([one.point.stress for one in own], [one.law for one in own])
        )
        exponents[key] = published, law
    return exponents


def _built(data: Any, name: str, kind: type[Config]) -> Any:
    """``data`` with the mappings in a list as records; errors name the number of the item."""
    if not isinstance(data, Mapping) or not isinstance(data.get(name), list | tuple):
        return data
    items = []
    for number, item in enumerate(data[name], 1):
        try:
            items.append(kind.from_mapping(item) if isinstance(item, Mapping) else item)
        except SetupError as error:
            raise SetupError(
                [p._replace(key=f"{name}[{number}].{p.key}") for p in error.problems]
            ) from None
    return {**data, name: tuple(items)}
