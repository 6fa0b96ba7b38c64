"""Study files: a matrix of impacts, values and riders drawn at random, what is kept of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from helmet_sim_ros.biomech.catalogue import CATALOGUE, entry
from helmet_sim_ros.biomech.record import is_fall
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, load_standard
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.model.fall.setup import fall_leaves
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_leaves
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, Leaf, leaves, quantity
from helmet_sim_ros.study.falls.measures import STRIKE_MEASURES
from helmet_sim_ros.study.scenario.matrix import ScenarioFile, combinations_of, flatten, validated
from helmet_sim_ros.study.sweeps import population as people
from helmet_sim_ros.study.sweeps.sampling import Distribution, Method, unit_points
from helmet_sim_ros.yaml_file import read_yaml

#: Columns of the results before those of the setup and of the criteria.
FIXED = ("index", "id", "draw", "status", "error", "verdict", "notes")
#: Packages whose version decides what an impact gives: results of two of them are not mixed.
PACKAGES = ("helmet_sim_ros", "mujoco")


class PopulationDraw(Config):
    """Riders to draw."""

    name: str = Field(description="name in config/populations, or path to a YAML file")
    female_share: float = quantity("share of women", "-", 0.5, ge=0.0, le=1.0)


class Draw(Config):
    """What is drawn at random: ``count`` points, each combined with every case of the matrix.

    ``values`` maps dotted names to distributions: ``impact.friction: {normal: [0.4, 0.05]}``.
    """

    method: Method = Field("sobol", description="how the points fill the space")
    count: int = quantity("number of points", "-", ge=1, le=100_000_000)
    seed: int = quantity("the same seed gives the same points", "-", 0, ge=0, le=2**32 - 1)
    values: dict[Any, Any] = Field(default_factory=dict, description="name -> distribution")
    population: PopulationDraw | None = Field(None, description="riders")


class Percentiles(Config):
    """Which percentiles of which criteria are estimated, over all impacts or per group."""

    criteria: tuple[str, ...] = Field(description="names of criteria")
    at: tuple[float, ...] = Field((50.0, 95.0), description="percent, above 0 and below 100")
    by: tuple[str, ...] = Field((), description="dotted names of which each value is one group")

    @model_validator(mode="after")
    def _plausible(self) -> Percentiles:
        _check_criteria("criteria", self.criteria)
        for percent in self.at:
            if not 0.0 < percent < 100.0:
                raise SetupError.of("at", percent, "must be above 0 and below 100 percent")
        return self


class Histories(Config):
    """Impacts whose complete samples go into a log: the worst by one criterion, or all."""

    worst: int | None = quantity("how many; unset: all", "-", None, ge=1, le=100_000)
    by: str = Field("peak_g", description="criterion that ranks them")

    @model_validator(mode="after")
    def _plausible(self) -> Histories:
        _check_criteria("by", (self.by,))
        return self


class StudyFile(ScenarioFile):
    """What a study file holds: a scenario's matrix, and draws that multiply it."""

    draw: Draw | None = Field(None, description="values and riders drawn at random")
    standard: str = Field(DEFAULT_STANDARD, description="limits of the verdict")
    criteria: tuple[str, ...] = Field((), description="columns of the results; empty: all")
    percentiles: Percentiles | None = Field(None, description="estimates over all impacts")
    histories: Histories | None = Field(None, description="complete samples that are kept")

    @model_validator(mode="after")
    def _plausible(self) -> StudyFile:
        if self.reference is not None:
            raise SetupError.of("reference", self.reference, "goes with scenarios, not studies")
        _check_criteria("criteria", self.criteria)
        for key, names in (
            ("percentiles.criteria", self.percentiles.criteria if self.percentiles else ()),
            ("histories.by", (self.histories.by,) if self.histories else ()),
        ):
            for name in names:
                if self.criteria and name not in self.criteria:
                    raise SetupError.of(key, name, "must be among criteria")
        return self


@dataclass(frozen=True)
class Row:
    """One impact of a study.

    Attributes:
        index: place in the study, from 0.
        draw: index of the drawn point, 0 without draws.
        values: dotted names that the study sets.
        labels: what describes the row but is no setup value (``population.sex``).
    """

    index: int
    draw: int
    values: Mapping[str, object]
    labels: Mapping[str, object]

    @property
    def id(self) -> str:
        """Hash of the setup, the row's identity within its study."""
        return digest(self.values)[:20]


@dataclass(frozen=True)
class Study:
    """A validated study.

    Row i is draw ``i // len(matrix)`` with case ``i % len(matrix)``: impacts of one rider and
    helmet follow each other, and what is finished first is a smaller study of the same kind.

    Attributes:
        name, path, file: where it comes from and what it says.
        matrix: values of each case, common values included.
        drawn: values by dotted name, one per draw.
        labels: further columns, one value per draw.
        draws: number of drawn points, 1 without draws.
    """

    name: str
    path: Path
    file: StudyFile
    matrix: tuple[Mapping[str, object], ...]
    drawn: Mapping[str, Sequence[object]]
    labels: Mapping[str, Sequence[object]]
    draws: int

    def __len__(self) -> int:
        return self.draws * len(self.matrix)

    def row(self, index: int) -> Row:
        """The impact at ``index``."""
        draw, case = divmod(index, len(self.matrix))
        values = {**self.matrix[case], **{k: v[draw] for k, v in self.drawn.items()}}
        return Row(index, draw, values, {k: v[draw] for k, v in self.labels.items()})

    def rows(self) -> Iterator[Row]:
        """Every impact, in order."""
        return map(self.row, range(len(self)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Dotted names that any row sets."""
        return tuple(dict.fromkeys([*(k for case in self.matrix for k in case), *self.drawn]))

    @cached_property
    def unit(self) -> str:
        """What its rows are: ``falls``, or ``impacts`` (also where both are among them)."""
        drawn = is_fall(self.drawn)
        return "falls" if all(drawn or is_fall(case) for case in self.matrix) else "impacts"

    @property
    def criteria(self) -> tuple[str, ...]:
        """Criteria that are kept."""
        limits = load_standard(self.file.standard).limits
        falls = is_fall(self.matrix[0]) or is_fall(self.drawn)
        of_falls = STRIKE_MEASURES if falls else ()
        return self.file.criteria or tuple(dict.fromkeys([*of_falls, *CATALOGUE, *limits]))

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What decides the results, each part as a digest: equal identities, equal results."""
        resolved = [validated(case, "").described() for case in self.matrix]
        return {
            "matrix": digest(self.matrix),
            "drawn values": digest({**self.drawn, **self.labels}),
            "helmets, riders and defaults": digest(resolved),
            "standard": digest(load_standard(self.file.standard).model_dump()),
            "criteria": digest(self.criteria),
            "columns": digest(FIXED),
            **{f"version of {name}": version(name) for name in PACKAGES},
        }


def load_study(name_or_path: str | Path, **overrides: object) -> Study:
    """The study of ``config/studies/NAME.yaml``, or of any such file by path.

    Args:
        name_or_path: ``"population_oblique"``, or a path to a YAML file.
        **overrides: dotted names (``**{"impact.friction": 0.3}``) that replace the file's values in
            every impact.

    Raises:
        SetupError: unknown study, unreadable file, an unknown name, an empty range, or a refused
            value; names file, key, value and what is allowed.
    """
    path = find_config("studies", str(name_or_path), "study")
    file: StudyFile = StudyFile.from_mapping(read_yaml(path, "study"), str(path))
    return build_study(file, path, overrides)


def build_study(
    file: StudyFile, path: Path, overrides: Mapping[str, object] | None = None
) -> Study:
    """The study of a file's content; arguments and errors as :func:`load_study`."""
    replaced = flatten(overrides or {})
    load_standard(file.standard)
    file = file.model_copy(update={"standard": _everywhere(file.standard)})
    shared = flatten(file.common, f"{path}: common")
    cases: list[dict[str, object]] = [{}]
    if file.cases or file.product or file.draw is None:
        cases = [values for _, values in combinations_of(file, path)]
    matrix = [_portable(shared | values | replaced) for values in cases]
    for number, values in enumerate(matrix, 1):
        validated(values, f"{path}: case {number}")
    falls = any(map(is_fall, matrix)) or (
        file.draw is not None and is_fall(flatten(file.draw.values))
    )
    for name in file.criteria:
        if name in STRIKE_MEASURES and not falls:
            raise SetupError.of("criteria", name, "goes with falls, not impacts", str(path))
    drawn: dict[str, list[object]] = {}
    labels: dict[str, list[object]] = {}
    if file.draw is not None:
        try:
            drawn, labels = _draw(file.draw, matrix, replaced)
        except SetupError as error:
            raise error.within(f"{path}: draw") from None
    draws = file.draw.count if file.draw else 1
    study = Study(file.name or path.stem, path, file, tuple(matrix), drawn, labels, draws)
    _check_groups(study)
    return study


def value_leaves() -> dict[str, Leaf]:
    """Every value of an impact setup by its dotted name."""
    found = {leaf.name: leaf for leaf in fall_leaves()}
    found |= {leaf.name: leaf for leaf in setup_leaves()}
    name = next(leaf for leaf in leaves(ImpactSetup) if leaf.name == "helmet")
    return found | {leaf.name: leaf for leaf in leaves(Helmet, "helmet.")} | {"helmet.name": name}


def distributions(values: Mapping[Any, Any]) -> dict[str, tuple[Distribution, Leaf]]:
    """Distributions by dotted name, each checked against the value it is for.

    Raises:
        SetupError: unknown name, not a distribution, or one beyond the value's range.
    """
    known = value_leaves()
    grouped: dict[str, dict[str, Any]] = {}  # checked by Distribution
    for key, value in flatten(values).items():
        name, _, kind = key.rpartition(".")
        grouped.setdefault("helmet.name" if name == "helmet" else name, {})[kind] = value
    found = {}
    for name, given in grouped.items():
        if name not in known:
            validated({(name or next(iter(given))): 0.0}, "")  # says what is near it
            raise SetupError.of(name, given, "unknown name")
        try:
            distribution = Distribution(**given)
        except SetupError as error:
            raise SetupError([p._replace(key=f"{name}: {p.key}") for p in error.problems]) from None
        distribution.check(known[name])
        found[name] = (distribution, known[name])
    return found


def _draw(
    draw: Draw, matrix: Sequence[Mapping[str, object]], replaced: Mapping[str, object]
) -> tuple[dict[str, list[object]], dict[str, list[object]]]:
    """Drawn values and labels, ``draw.count`` of each, without the values that are replaced."""
    found = distributions(draw.values)
    riders = people.load_population(draw.population.name) if draw.population else None
    dimensions = len(found) + (people.DIMENSIONS if riders else 0)
    if not dimensions:
        raise SetupError.of("values", {}, "nothing to draw: give values or a population")
    names = [*found, *(people.VALUES if riders else ())]
    for name in names:
        elsewhere = name not in replaced and any(name in case for case in matrix)
        if names.count(name) > 1 or elsewhere:
            raise SetupError.of(name, "drawn", "is given twice: it is set elsewhere, too")
    points = unit_points(draw.method, draw.count, dimensions, draw.seed)
    drawn = {
        name: distribution.values(points[:, i], leaf)
        for i, (name, (distribution, leaf)) in enumerate(found.items())
    }
    labels: dict[str, list[object]] = {}
    if riders is not None and draw.population is not None:
        columns = riders.riders(points[:, len(found) :], draw.population.female_share)
        drawn |= {name: columns.pop(name) for name in people.VALUES}
        labels = columns
    drawn = {name: values for name, values in drawn.items() if name not in replaced}
    _check_extremes(drawn, matrix)
    return drawn, labels


def _check_extremes(
    drawn: Mapping[str, Sequence[object]], matrix: Sequence[Mapping[str, object]]
) -> None:
    """Validate the draws with the extremes of each value, and every choice, in full."""
    picks = {0}
    for column in drawn.values():
        numbers = [value for value in column if isinstance(value, int | float)]
        if len(numbers) == len(column):
            picks |= {column.index(min(numbers)), column.index(max(numbers))}
        else:
            picks |= {column.index(value) for value in {repr(v): v for v in column}.values()}
    for i in sorted(picks):
        for case in matrix:
            validated({**case, **{k: v[i] for k, v in drawn.items()}}, f"point {i + 1}")


def _check_groups(study: Study) -> None:
    known = {*study.names, *study.labels}
    for name in study.file.percentiles.by if study.file.percentiles else ():
        if name not in known:
            choices = ", ".join(sorted(known))
            raise SetupError.of("percentiles.by", name, f"must be one of {choices}")


def _check_criteria(key: str, names: Sequence[str]) -> None:
    for name in names:
        if name in STRIKE_MEASURES:
            continue
        try:
            entry(name)
        except PulseError as error:
            raise SetupError.of(key, name, str(error)) from None


def _portable(values: dict[str, object]) -> dict[str, object]:
    name = values.get("helmet.name")
    return {**values, "helmet.name": _everywhere(name)} if isinstance(name, str) else values


def _everywhere(name_or_path: str) -> str:
    """A file by its absolute path: workers run in other directories."""
    if "/" in name_or_path or name_or_path.endswith(".yaml"):
        return str(Path(name_or_path).expanduser().resolve())
    return name_or_path


def digest(data: object) -> str:
    text = json.dumps(data, sort_keys=True, default=dict, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
