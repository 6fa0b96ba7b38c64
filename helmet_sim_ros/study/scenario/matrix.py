"""Scenario matrices: a YAML file becomes a list of validated impact setups."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

from helmet_sim_ros.biomech.record import is_fall
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.setup import Fall, fall_leaves, setup_or_fall
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names, setup_leaves
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, leaf_values
from helmet_sim_ros.study.scenario.reference import Published, Reference, load_reference
from helmet_sim_ros.yaml_file import read_yaml

#: Most cases of a matrix, each a setup that is checked before anything runs, and deepest grouping
#: of names: choices. What a study draws at random multiplies its matrix without this limit.
MOST_CASES = 20_000
DEEPEST = 20

#: Short forms of the values that vary in most matrices, for generated case names.
SHORT_NAMES = {
    "impact.direction": "",
    "impact.rig": "",
    "helmet.name": "",
    "impact.normal_velocity": "vn",
    "impact.tangential_velocity": "vt",
    "impact.tangential_heading_deg": "heading",
    "impact.body_angle_deg": "angle",
    "sim.time_step": "dt",
    "fall.preset": "",
    "fall.scene": "",
    "fall.speed": "v",
    "fall.roll_deg": "roll",
    "fall.pitch_deg": "pitch",
}


class ScenarioFile(Config):
    """What a scenario file holds.

    Keys of ``common``, ``cases`` and ``product`` are the dotted names of the impact setup, or of a
    fall where any of them is ``fall.*``, written out (``impact.friction: 0.4``) or as groups
    (``impact: {friction: 0.4}``); ``helmet: NAME`` is short for ``helmet.name``. The cases are
    every item of ``cases`` combined with every combination of the lists in ``product``, the last
    list varying fastest.
    """

    name: str = Field("", description="name of the scenario; unset: the file's name")
    description: str = Field("", description="what is simulated, and what is left out")
    reference: str | None = Field(None, description="published table in config/references")
    common: dict[Any, Any] = Field(default_factory=dict, description="values of every case")
    cases: tuple[dict[Any, Any], ...] = Field((), description="one mapping of values per case")
    product: dict[Any, Any] = Field(default_factory=dict, description="name -> value or list")


@dataclass(frozen=True)
class Case:
    """One impact or fall of a scenario.

    Attributes:
        name: short and unique within the scenario.
        setup: the complete, validated setup.
        values: the dotted names that the scenario sets; all others are at their defaults.
        reference: what was published for it, or None.
    """

    name: str
    setup: ImpactSetup | Fall
    values: Mapping[str, object]
    reference: Published | None = None

    @property
    def impact(self) -> ImpactSetup:
        """The setup of a case that is an impact.

        Raises:
            SetupError: it is a fall.
        """
        if isinstance(self.setup, Fall):
            raise SetupError.of(
                "fall.preset", self.setup.preset, f"{self.name} is a fall, an impact is needed"
            )
        return self.setup


@dataclass(frozen=True)
class Scenario:
    """A named matrix of impacts and falls; ``path`` is the file it came from."""

    name: str
    description: str
    cases: tuple[Case, ...]
    path: Path
    reference: Reference | None = None

    @property
    def setups(self) -> tuple[ImpactSetup, ...]:
        """The setup of each case, in order, without falls."""
        return tuple(c.setup for c in self.cases if isinstance(c.setup, ImpactSetup))

    @property
    def falls(self) -> tuple[Fall, ...]:
        """Each case that is a fall, in order."""
        return tuple(c.setup for c in self.cases if isinstance(c.setup, Fall))


def load_scenario(name_or_path: str | Path, **common: object) -> Scenario:
    """The scenario of ``config/scenarios/NAME.yaml``, or of any such file by path.

    Args:
        name_or_path: ``"oblique_table1"``, or a path to a YAML file.
        **common: :class:`ImpactSetup` keyword arguments (``helmet="..."``, ``body_angle_deg=20.0``,
            ``overrides={...}``) that replace the file's values in every case.

    Raises:
        SetupError: unknown scenario, unreadable file, an empty matrix, or a refused value in any
            case; names file, case, key, value and what is allowed. Nothing has run by then.
    """
    path = find_config("scenarios", str(name_or_path), "scenario")
    file: ScenarioFile = ScenarioFile.from_mapping(read_yaml(path, "scenario"), str(path))
    falls = is_fall(flatten(file.common, str(path)))
    replaced = _dotted_arguments(common, falls)
    if not falls:
        setup_from_names(replaced)
    reference = _reference(file, path)
    cases = tuple(cases_of(file, path, replaced, reference))
    return Scenario(file.name or path.stem, file.description, cases, path, reference)


def cases_of(
    file: ScenarioFile,
    path: Path,
    replaced: Mapping[str, object],
    reference: Reference | None = None,
) -> Iterable[Case]:
    """Every case of a scenario.

    Args:
        file: the scenario.
        path: where it stands, for errors.
        replaced: dotted names that replace its values in every case.
        reference: what was published for it.

    Raises:
        SetupError: an empty matrix, or a refused value in any case.
    """
    shared = flatten(file.common, f"{path}: common")
    validated(shared, f"{path}: common")
    combinations = list(combinations_of(file, path))
    names = _names(combinations, file.name or path.stem)
    for number, ((_, values), name) in enumerate(zip(combinations, names, strict=True), 1):
        values = {**shared, **values, **replaced}
        setup = validated(values, f"{path}: case {number} ({name})")
        published = reference.row(setup.described()) if reference else None
        yield Case(name, setup, values, published)


def flatten(values: Mapping[Any, Any], source: str = "", prefix: str = "") -> dict[str, object]:
    """Nested groups as dotted names: ``{"impact": {"friction": 1}}`` -> ``{"impact.friction": 1}``.

    Raises:
        SetupError: a key that is not text, or a value given twice.
    """
    flat: dict[str, object] = {}
    for key, value in values.items():
        if not isinstance(key, str):
            raise SetupError.of(f"{prefix}{key}", value, "a key must be text", source)
        name = prefix + key
        if isinstance(value, Mapping):
            if prefix.count(".") >= DEEPEST:
                raise SetupError.of(name, type(value), f"has more than {DEEPEST} levels", source)
            inner = flatten(value, source, f"{name}.")
        else:
            inner = {"helmet.name" if name == "helmet" else name: value}
        for twice in flat.keys() & inner.keys():
            raise SetupError.of(twice, inner[twice], "is given twice", source)
        flat |= inner
    return flat


def combinations_of(file: ScenarioFile, path: Path) -> Iterable[tuple[str, dict[str, object]]]:
    """Explicit name (or "") and values of every case, without the common values."""
    axes = flatten(file.product, f"{path}: product")
    lists = {name: v if isinstance(v, (list, tuple)) else [v] for name, v in axes.items()}
    for name, values in lists.items():
        if not values:
            raise SetupError.of(name, [], "must hold at least one value", f"{path}: product")
    if not file.cases and not lists:
        raise SetupError.of("cases", [], "the matrix is empty: give cases, or product", str(path))
    count = math.prod(map(len, lists.values())) * max(len(file.cases), 1)
    if count > MOST_CASES:
        raise SetupError.of("cases", count, f"the matrix has at most {MOST_CASES} cases", str(path))
    for number, case in enumerate(file.cases or ({},), 1):
        where = f"{path}: case {number}"
        given = dict(case)
        name = given.pop("name", "")
        if not isinstance(name, str):
            raise SetupError.of("name", name, "must be text", where)
        fixed = flatten(given, where)
        for twice in fixed.keys() & lists.keys():
            raise SetupError.of(twice, fixed[twice], "is given in product too", where)
        for combination in itertools.product(*lists.values()):
            product = dict(zip(lists, combination, strict=True))
            yield " ".join([name, _label(product)]).strip() if name else "", fixed | product


def _names(combinations: list[tuple[str, dict[str, object]]], scenario: str) -> list[str]:
    """A short, unique name per case: the explicit one, or the values in which cases differ."""
    everything = [values for _, values in combinations]
    keys = dict.fromkeys(key for values in everything for key in values)
    varying = [k for k in keys if any(v.get(k) != everything[0].get(k) for v in everything)]
    names: list[str] = []
    used: Counter[str] = Counter()
    for explicit, values in combinations:
        differing = {key: values[key] for key in varying if key in values}
        name = explicit or _label(differing) or scenario
        used[name] += 1
        names.append(name if used[name] == 1 else f"{name} #{used[name]}")
    return names


def _label(values: Mapping[str, object]) -> str:
    parts = []
    for key, value in values.items():
        short = SHORT_NAMES.get(key, key.rpartition(".")[2] + "=")
        text = f"{value:g}" if isinstance(value, float) else str(value)
        parts.append(short + (Path(text).stem if key == "helmet.name" else text))
    return " ".join(parts)


def validated(values: Mapping[str, object], where: str) -> ImpactSetup | Fall:
    """The impact or fall of dotted names.

    Raises:
        SetupError: unknown name or refused value; says that it stands in ``where``.
    """
    try:
        return setup_or_fall(values)
    except SetupError as error:
        raise error.within(f"{where}: {error.source}" if error.source else where) from None


def _dotted_arguments(arguments: Mapping[str, object], falls: bool) -> dict[str, object]:
    """Keyword arguments of ImpactSetup or Fall by dotted name, ``overrides`` on top."""
    known_leaves = fall_leaves() if falls else setup_leaves()
    names = {leaf.name.partition(".")[2]: leaf.name for leaf in known_leaves
             if not leaf.name.startswith("rider.")}  # fmt: skip
    values: dict[str, object] = {}
    for key, value in arguments.items():
        if key == "rider" and isinstance(value, Config):
            values |= {f"rider.{name}": v for name, v in leaf_values(value).items()}
        elif key == "helmet":
            values["helmet.name"] = value
        elif key in names:
            values[names[key]] = value
        elif key != "overrides":
            known = ", ".join([*names, "helmet", "rider", "overrides"])
            raise SetupError.of(key, value, f"unknown argument; known: {known}")
    overrides = arguments.get("overrides", {})
    if not isinstance(overrides, Mapping):
        raise SetupError.of("overrides", overrides, "must be a mapping of dotted names to values")
    return values | flatten(overrides)


def _reference(file: ScenarioFile, path: Path) -> Reference | None:
    if file.reference is None:
        return None
    try:
        return load_reference(file.reference)
    except SetupError as error:
        raise error if error.source else error.within(str(path)) from None
