"""Published measurements to hold the model against, read from ``config/references/*.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from helmet_sim_ros.biomech.catalogue import entry
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.study.scenario.matrix import (
    Case,
    ScenarioFile,
    cases_of,
    flatten,
    load_scenario,
)
from helmet_sim_ros.study.validation.quantities import QUANTITIES
from helmet_sim_ros.yaml_file import read_yaml

#: How a source was read: the figure stands in a text that was read; a third party that was read
#: quotes it; general knowledge, which is a documented parameter and no evidence.
Reading = Literal["read", "secondary", "general"]


class Value(Config):
    """One published value and the bound that ours is held to.

    ``kind`` says what was published: ``exact`` one test, ``mean`` of several, ``at_most`` an upper
    bound, ``range`` from ``low`` to ``high``, ``factor`` between two set-ups (a value, or a range),
    ``table`` a column of a table in ``config/references``, of which the mean error counts.
    """

    criterion: str = Field(description="a criterion, or a quantity of study/validation/quantities")
    kind: Literal["exact", "mean", "at_most", "range", "factor", "table"] = Field(
        description="what was published"
    )
    unit: str = Field(description="unit of the criterion; - for a factor")
    value: float | None = quantity("published value", "", None)
    low: float | None = quantity("lower end of a published range", "", None)
    high: float | None = quantity("upper end of a published range", "", None)
    words: str = Field("", description="what was published, where it is no number")
    table: str = Field("", description="TABLE/COLUMN in config/references, for kind table")
    over: Literal["each", "mean", "largest"] = Field(
        "mean", description="what is compared: each case, their mean, or the largest of them"
    )
    within: float | None = quantity("accepted relative difference", "-", None, gt=0.0, le=2.0)
    accepted: tuple[float | None, float | None] | None = Field(
        None, description="accepted lower and upper end, instead of within"
    )

    @model_validator(mode="after")
    def _complete(self) -> Value:
        criterion_unit(self.criterion)
        due = "-" if self.kind == "factor" else criterion_unit(self.criterion)
        if self.unit != due:
            raise SetupError.of("unit", self.unit, f"must be {due}, the unit of {self.criterion}")
        if (self.within is None) == (self.accepted is None):
            raise SetupError.of("within", self.within, "give either within or accepted")
        given = self.value is not None, None not in (self.low, self.high), bool(self.table)
        allowed = {"range": (1,), "factor": (0, 1), "table": (2,)}.get(self.kind, (0,))
        if self.words and self.accepted is not None and not any(given):
            return self
        if sum(given) != 1 or given.index(True) not in allowed:
            names = " or ".join(("value", "low and high", "table")[i] for i in allowed)
            raise SetupError.of("value", self.value, f"kind {self.kind} takes {names}")
        if self.low is not None and self.high is not None and self.low > self.high:
            raise SetupError.of("low", self.low, f"must not exceed high, {self.high:g}")
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value of ours that is accepted, in the unit; of kind table, of the
        mean relative error."""
        if self.accepted is not None:
            low, high = self.accepted
            return -_INFINITE if low is None else low, _INFINITE if high is None else high
        assert self.within is not None
        if self.kind == "table":
            return 0.0, self.within
        low = self.value if self.low is None else self.low
        high = self.value if self.high is None else self.high
        assert low is not None and high is not None
        if self.kind == "at_most":
            return -_INFINITE, high * (1.0 + self.within)
        return low * (1.0 - self.within), high * (1.0 + self.within)


class Experiment(Config):
    """One published experiment: what was done, how we do it, and what came out.

    ``set`` is named once, before the model meets it: ``calibration`` where a constant of the model
    was chosen with it in view, and then ``in_view`` says which; else ``prediction``.
    """

    id: str = Field(description="short name, unique")
    title: str = Field(description="what was tested")
    source: str = Field(description="publication")
    reading: Reading = Field(description="how it was read")
    set: Literal["calibration", "prediction"] = Field(description="see above")
    in_view: tuple[str, ...] = Field((), description="what was chosen with it in view")
    notes: str = Field("", description="what our set-up assumes or leaves out")
    scenario: str = Field("", description="scenario that is run; unset: cases or product")
    common: dict[Any, Any] = Field(default_factory=dict, description="values of every case")
    cases: tuple[dict[Any, Any], ...] = Field((), description="as in a scenario")
    product: dict[Any, Any] = Field(default_factory=dict, description="as in a scenario")
    against: dict[Any, Any] = Field(
        default_factory=dict, description="values of the set-up that factors refer to"
    )
    values: tuple[Value, ...] = Field(description="what was published")

    @model_validator(mode="before")
    @classmethod
    def _values(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and isinstance(data.get("values"), list | tuple):
            values = tuple(
                Value.from_mapping(v) if isinstance(v, Mapping) else v for v in data["values"]
            )
            return {**data, "values": values}
        return data

    @model_validator(mode="after")
    def _complete(self) -> Experiment:
        if not self.values:
            raise SetupError.of("values", [], "must hold at least one published value")
        if (self.set == "calibration") != bool(self.in_view):
            raise SetupError.of(
                "in_view", list(self.in_view),
                "must name what was chosen with it in view for set calibration, and nothing for "
                "prediction",
            )  # fmt: skip
        if bool(self.scenario) == bool(self.cases or self.product):
            raise SetupError.of("scenario", self.scenario, "give a scenario, or cases and product")
        if bool(self.against) != any(v.kind == "factor" for v in self.values):
            raise SetupError.of(
                "against", self.against, "is needed for values of kind factor, and for these only"
            )
        return self

    def setups(self, reference: bool = False) -> tuple[Case, ...]:
        """The cases of our set-up; with ``reference`` of the one that factors refer to.

        Raises:
            SetupError: unknown scenario or name, or a refused value.
        """
        changes = flatten(self.against, self.id) if reference else {}
        if self.scenario:
            common = flatten(self.common, self.id)
            return load_scenario(self.scenario, overrides=common | changes).cases
        file = ScenarioFile(common=self.common, cases=self.cases, product=self.product)
        return tuple(cases_of(file, Path(self.id), changes))


class ExperimentFile(Config):
    """A file of experiments."""

    description: str = Field("", description="what they have in common")
    experiments: tuple[Experiment, ...]

    @model_validator(mode="before")
    @classmethod
    def _experiments(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("experiments"), list | tuple):
            return data
        found = []
        for number, item in enumerate(data["experiments"], 1):
            name = item.get("id", number) if isinstance(item, Mapping) else number
            try:
                found.append(Experiment.from_mapping(item))
            except SetupError as error:
                raise SetupError(
                    [p._replace(key=f"experiment {name}: {p.key}") for p in error.problems]
                ) from None
        return {**data, "experiments": tuple(found)}


_INFINITE = float("inf")


def criterion_unit(name: str) -> str:
    """The unit of a criterion or a quantity.

    Raises:
        SetupError: unknown name.
    """
    if name in QUANTITIES:
        return QUANTITIES[name].unit
    try:
        return entry(name).unit
    except PulseError as error:
        raise SetupError.of("criterion", name, f"{error}, {', '.join(QUANTITIES)}") from None


def load_experiments(path: str | Path | None = None) -> tuple[Experiment, ...]:
    """The experiments of a file; unset: all that are shipped, in ``config/references``.

    Raises:
        SetupError: unreadable, a refused value, or an id given twice; names file and experiment.
    """
    folder = share_directory() / "config" / "references"
    paths = sorted(folder.glob("experiments_*.yaml")) if path is None else [Path(path)]
    found: dict[str, Experiment] = {}
    for one in paths:
        data = read_yaml(one, "references")
        file: ExperimentFile = ExperimentFile.from_mapping(data, str(one))
        for experiment in file.experiments:
            if experiment.id in found:
                raise SetupError.of("id", experiment.id, "is given twice", str(one))
            found[experiment.id] = experiment
    return tuple(found.values())
