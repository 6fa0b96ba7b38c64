"""Optimisation files: what may vary, what is to be made small or large, and within which limits."""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.biomech.catalogue import entry
from helmet_sim_ros.biomech.standards import load_standard
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, Leaf, leaves, quantity
from helmet_sim_ros.study.certification.campaign import make_campaign
from helmet_sim_ros.study.certification.protocol import load_protocol
from helmet_sim_ros.study.optimisation.design import (
    FOLLOWING,
    QUANTITIES,
    Design,
    DesignRules,
    make_design,
)
from helmet_sim_ros.study.scenario.matrix import flatten, load_scenario
from helmet_sim_ros.study.sweeps.sampling import unit_points
from helmet_sim_ros.study.sweeps.study import Study, StudyFile, build_study, digest, value_leaves
from helmet_sim_ros.yaml_file import read_yaml

#: Designs tried, without a simulation, for whether the limits on designs can be met at all.
PROBES = 512
#: Variables up to which every corner of their ranges is tried, too.
MAX_CORNERS = 9

#: The response of a protocol.
MARGIN = "protocol_margin"

_OVER = re.compile(r"(worst|mean|p(\d{1,2}(?:\.\d+)?)) (\w+)")


class Goal(Config):
    """Something to minimise or to maximise; see :class:`Response` for what can be named."""

    minimise: str | None = Field(None, description="response")
    maximise: str | None = Field(None, description="response")

    @model_validator(mode="after")
    def _one(self) -> Goal:
        if (self.minimise is None) == (self.maximise is None):
            raise SetupError.of("(goal)", self.minimise, "give one of minimise, maximise")
        Response.parse(self.response)
        return self

    @property
    def response(self) -> str:
        """What is to be made small or large."""
        return self.minimise or self.maximise or ""


class Constraint(Config):
    """Bounds of a response."""

    of: str = Field(description="response")
    at_least: float | None = Field(None, description="lowest allowed value")
    at_most: float | None = Field(None, description="highest allowed value")

    @model_validator(mode="after")
    def _possible(self) -> Constraint:
        Response.parse(self.of)
        if self.at_least is None and self.at_most is None:
            raise SetupError.of("at_most", None, "give at_most, at_least or both")
        if (
            self.at_least is not None and self.at_most is not None
            and self.at_least > self.at_most
        ):  # fmt: skip
            raise SetupError.of("at_least", self.at_least, f"nothing is also <= {self.at_most:g}")
        if self.at_most is not None and self.at_most <= 0.0:
            raise SetupError.of("at_most", self.at_most, "must be above 0: no response is below it")
        return self

    def excess(self, value: float) -> float:
        """How far a value is outside, relative to the bound; <= 0 inside."""
        over = [] if self.at_most is None else [value / self.at_most - 1.0]
        if self.at_least is not None:
            over.append((self.at_least - value) / max(abs(self.at_least), 1e-12))
        return max(over)


class Sensitivity(Config):
    """How strongly the best design's responses depend on each variable, and on what else."""

    step: float = quantity("relative change, up and down", "-", 0.05, gt=0.0, le=0.5)
    names: tuple[str, ...] = Field((), description="further values of the impacts, dotted names")


class OptimisationFile(StudyFile):
    """What an optimisation file holds.

    The impacts of every design are given as in a study (``common``, ``cases``, ``product``,
    ``draw``), or are those of a ``protocol`` or a ``scenario``; its helmet is the reference.
    ``variables`` are values of the helmet with the range to search. A response is a criterion over
    the impacts (``worst peak_g``, ``mean hic``, ``p95 bric``), a quantity of the design
    (``helmet_mass``, ``liner_mass``, ``max_thickness``, ``max_density``), or ``protocol_margin``:
    the least of 1 - value / limit over all limits of the protocol.
    """

    protocol: str | None = Field(
        None, description="impacts of a protocol: name in config/protocols, or path"
    )
    scenario: str | None = Field(
        None,
        description="impacts of a scenario, the head strikes of falls for example: name in "
        "config/scenarios, or path; common replaces its values",
    )
    variables: dict[str, tuple[float, float]] = Field(
        description="helmet.* name -> lowest and highest value"
    )
    objectives: tuple[Goal, ...] = Field(description="one, or several for a Pareto front")
    constraints: tuple[Constraint, ...] = Field((), description="limits on responses")
    design: DesignRules = Field(default_factory=DesignRules)
    trials: int = quantity("designs to simulate", "-", 200, ge=1, le=1_000_000)
    batch: int = quantity(
        "designs proposed together; they run in parallel, and the search learns after each batch",
        "-", 20, ge=1, le=10_000,
    )  # fmt: skip
    sampler: Literal["tpe", "nsga2", "random"] = Field("tpe", description="search of Optuna")
    seed: int = quantity("the same seed gives the same search", "-", 0, ge=0, le=2**31)
    best: int = quantity("designs written as helmet files, at most", "-", 10, ge=1, le=1000)
    sensitivity: Sensitivity = Field(default_factory=Sensitivity)

    @model_validator(mode="before")
    @classmethod
    def _ranges_become_tuples(cls, data: object) -> object:
        if isinstance(data, Mapping) and isinstance(data.get("variables"), Mapping):
            ranges = {
                k: tuple(v) if isinstance(v, list) else v for k, v in data["variables"].items()
            }
            return {**data, "variables": ranges}
        return data

    @model_validator(mode="after")
    def _nothing_lost(self) -> OptimisationFile:
        for key in ("criteria", "percentiles", "histories"):
            if getattr(self, key):
                raise SetupError.of(key, getattr(self, key), "goes with sweeps")
        for source, others in (
            ("protocol", ("scenario", "cases", "product")), ("scenario", ("cases", "product")),
        ):  # fmt: skip
            for key in others if getattr(self, source) is not None else ():
                if getattr(self, key):
                    raise SetupError.of(
                        key, getattr(self, key),
                        f"must not be given beside {source}, which has impacts",
                    )  # fmt: skip
        for key in ("variables", "objectives"):
            if not getattr(self, key):
                raise SetupError.of(key, getattr(self, key), "must hold at least one")
        return self


@dataclass(frozen=True)
class Response:
    """A number that judges a design: a quantity of it, or a criterion over its impacts.

    Attributes:
        name: as the user wrote it.
        criterion: None for a quantity of the design.
        percent: percentile of the criterion over the impacts; None: its mean.
    """

    name: str
    criterion: str | None = None
    percent: float | None = None

    @classmethod
    def parse(cls, name: str) -> Response:
        """The response of a name.

        Raises:
            SetupError: neither a quantity of a design nor a criterion over impacts.
        """
        if name in QUANTITIES or name == MARGIN:
            return cls(name)
        match = _OVER.fullmatch(name)
        if match is None:
            raise SetupError.of(
                "(response)", name,
                "must be 'worst CRITERION', 'mean CRITERION', 'p95 CRITERION' or one of "
                + ", ".join((*QUANTITIES, MARGIN)),
            )  # fmt: skip
        try:
            entry(match[3])
        except PulseError as error:
            raise SetupError.of("(response)", name, str(error)) from None
        percent = 100.0 if match[1] == "worst" else float(match[2]) if match[2] else None
        return cls(name, match[3], percent)

    @property
    def unit(self) -> str:
        """Its unit."""
        if self.name == MARGIN:
            return "-"
        return QUANTITIES[self.name] if self.criterion is None else entry(self.criterion).unit

    def value(
        self,
        design: Design,
        criteria: Mapping[str, Sequence[float]],
        limits: Sequence[Mapping[str, float]] = (),
    ) -> float:
        """Its value for a design, given each criterion, and the limits, for all impacts."""
        if self.name == MARGIN:
            return min(
                1.0 - criteria[name][i] / limit
                for i in range(len(next(iter(criteria.values()))))
                for name, limit in limits[i % len(limits)].items()
            )
        if self.criterion is None:
            return design.quantities[self.name]
        values = criteria[self.criterion]
        return float(
            np.mean(values) if self.percent is None else np.percentile(values, self.percent)
        )


@dataclass(frozen=True)
class Optimisation:
    """A validated optimisation.

    Attributes:
        name, path, file: where it comes from and what it says.
        impacts: what every design goes through, with the reference helmet.
        reference: the helmet that the search starts from.
        responses: all that objectives and constraints need, by name.
        limits: of each impact of the protocol, criterion -> limit; empty without a protocol.
    """

    name: str
    path: Path
    file: OptimisationFile
    impacts: Study
    reference: Helmet
    responses: Mapping[str, Response]
    limits: tuple[Mapping[str, float], ...] = ()

    @property
    def criteria(self) -> tuple[str, ...]:
        """Criteria that the responses need."""
        found = [r.criterion for r in self.responses.values() if r.criterion is not None]
        if MARGIN in self.responses:
            found += [name for limits in self.limits for name in limits]
        return tuple(dict.fromkeys(found))

    @property
    def identity(self) -> Mapping[str, str]:
        """What decides the results; more ``trials`` continue the same search."""
        file = self.file
        kept = {k: v for k, v in self.impacts.identity.items() if k != "criteria"}
        parts = ("variables", "objectives", "constraints", "design", "batch", "sampler", "seed")
        dumped = file.model_dump()
        if self.limits:
            kept["limits of the protocol"] = digest(self.limits)
        return {**kept, **{name: digest(dumped[name]) for name in parts}}

    def design(self, values: Mapping[str, float]) -> Design:
        """The design of variables by dotted name.

        Raises:
            SetupError: a value that the helmet refuses.
        """
        changes = {name.removeprefix("helmet."): value for name, value in values.items()}
        return make_design(self.reference, changes, self.file.design)

    def setups(self, design: Design) -> list[dict[str, object]]:
        """Dotted names of every impact of a design."""
        changes = {f"helmet.{name}": value for name, value in design.changes.items()}
        return [{**row.values, **changes} for row in self.impacts.rows()]


def load_optimisation(name_or_path: str | Path, **overrides: object) -> Optimisation:
    """The optimisation of ``config/studies/NAME.yaml``, or of any such file by path.

    Args:
        name_or_path: ``"lighter_ece_22_05"``, or a path to a YAML file.
        **overrides: dotted names that replace the file's values in every impact.

    Raises:
        SetupError: unknown file, a refused value, an empty range, or limits that no design in the
            ranges meets.
    """
    path = find_config("studies", str(name_or_path), "study")
    file: OptimisationFile = OptimisationFile.from_mapping(read_yaml(path, "study"), str(path))
    limits: tuple[Mapping[str, float], ...] = ()
    if file.protocol is not None:
        file, limits = _with_protocol(file, file.protocol, path, overrides)
    if file.scenario is not None:
        file = _with_scenario(file, file.scenario, path)
    impacts = build_study(file, path, overrides)
    try:
        plan = _plan(file, path, impacts, limits)
        _check_limits(plan)
    except SetupError as error:
        raise error.within(str(path)) from None
    return plan


def _with_protocol(
    file: OptimisationFile, name: str, path: Path, overrides: Mapping[str, object]
) -> tuple[OptimisationFile, tuple[Mapping[str, float], ...]]:
    """The file with the protocol's impacts as its cases, and the limits of each."""
    changes = flatten(file.common, f"{path}: common") | flatten(overrides)
    helmet = str(changes.pop("helmet.name", "fullface"))
    try:
        hits = make_campaign(helmet, name, load_protocol(name), changes).hits
    except SetupError as error:
        raise error if error.source else error.within(str(path)) from None
    if any(hit.number > 1 for hit in hits):
        raise SetupError.of(
            "protocol", name,
            "strikes the same spot again; every impact of a search starts from a new helmet",
            str(path),
        )  # fmt: skip
    limits = tuple(
        {k: v.max for k, v in load_standard(hit.standard).limits.items()} if hit.standard else {}
        for hit in hits
    )
    cases = tuple(dict(hit.values) for hit in hits)
    return file.model_copy(update={"cases": cases, "common": {}}), limits


def _with_scenario(file: OptimisationFile, name: str, path: Path) -> OptimisationFile:
    """The file with the scenario's impacts as its cases."""
    common = flatten(file.common, f"{path}: common")
    cases = load_scenario(name).cases
    for case in cases:
        if isinstance(case.setup, Fall):
            raise SetupError.of(
                "scenario", name,
                f"{case.name} is a fall; a search needs impacts: 'helmet-sim fall --output' and "
                "'run' write those of its head strikes into strikes.yaml",
                str(path),
            )  # fmt: skip
    values = tuple({**case.values, **common} for case in cases)
    return file.model_copy(update={"cases": values, "common": {}})


def _plan(
    file: OptimisationFile,
    path: Path,
    impacts: Study,
    limits: tuple[Mapping[str, float], ...],
) -> Optimisation:
    helmets = {str(row.values.get("helmet.name", "fullface")) for row in impacts.rows()}
    if len(helmets) > 1:
        raise SetupError.of("helmet.name", sorted(helmets), "a design starts from one helmet")
    reference = load_helmet(helmets.pop())
    own = {k: v for k, v in impacts.row(0).values.items() if k.startswith("helmet.")}
    own.pop("helmet.name", None)
    for name, value in own.items():
        if any(row.values.get(name) != value for row in impacts.rows()):
            raise SetupError.of(name, value, "a design's helmet must not vary between its impacts")
    reference = reference.replaced({k.removeprefix("helmet."): v for k, v in own.items()})
    known = {leaf.name: leaf for leaf in leaves(Helmet, "helmet.")}
    for name, bounds in file.variables.items():
        _check_variable(name, bounds, known)
    for name in file.sensitivity.names:
        _check_numeric(name)
    wanted = [goal.response for goal in file.objectives] + [c.of for c in file.constraints]
    responses = {name: Response.parse(name) for name in wanted}
    if MARGIN in responses and not any(limits):
        raise SetupError.of(MARGIN, file.protocol, "needs a protocol that sets limits")
    return Optimisation(impacts.name, path, file, impacts, reference, responses, limits)


def _check_variable(name: str, bounds: tuple[float, float], known: Mapping[str, Leaf]) -> None:
    key = f"variables.{name}"
    if name not in known:
        import difflib

        near = difflib.get_close_matches(name, known, 3) or sorted(known)
        raise SetupError.of(key, list(bounds), f"unknown name; known: {', '.join(near)}")
    leaf = known[name]
    if name.removeprefix("helmet.") in FOLLOWING:
        raise SetupError.of(key, list(bounds), "follows from liner and shell in a design")
    if leaf.type is not float:
        raise SetupError.of(key, list(bounds), "only numbers can be searched")
    low, high = bounds
    if not low < high:
        raise SetupError.of(key, list(bounds), "empty range: the first must be the lower")
    if (leaf.minimum is not None and low < leaf.minimum) or (
        leaf.maximum is not None and high > leaf.maximum
    ):
        raise SetupError.of(key, list(bounds), leaf.allowed)


def _check_numeric(name: str) -> None:
    leaf = value_leaves().get(name)
    if leaf is None or leaf.type is not float or name.startswith("helmet."):
        raise SetupError.of(
            "sensitivity.names", name, "must be a number of impact.* or rider.*; variables are "
            "always included",
        )  # fmt: skip


def _check_limits(plan: Optimisation) -> None:
    """Refuse limits on quantities of the design that no design in the ranges meets."""
    limits = [c for c in plan.file.constraints if c.of in QUANTITIES]
    closest: tuple[float, Constraint, float] | None = None
    tried = 0
    for design in _probes(plan) if limits else ():
        tried += 1
        worst = max(
            ((c.excess(design.quantities[c.of]), c) for c in limits), key=lambda pair: pair[0]
        )
        if worst[0] <= 0.0:
            return
        if closest is None or worst[0] < closest[0]:
            closest = (*worst, design.quantities[worst[1].of])
    if closest is not None:
        _, limit, value = closest
        bound = f"<= {limit.at_most:g}" if limit.at_most is not None else f">= {limit.at_least:g}"
        raise SetupError.of(
            "constraints", limit.of,
            f"nothing in the ranges of the variables meets every limit; the closest of {tried} "
            f"designs has {value:.4g} {plan.responses[limit.of].unit}, {bound} is asked for",
        )  # fmt: skip


def _probes(plan: Optimisation) -> Iterator[Design]:
    """Designs at the corners of the variables' ranges and all over them."""
    names = list(plan.file.variables)
    low, high = np.array(list(plan.file.variables.values())).T
    corners = itertools.product((0.0, 1.0), repeat=len(names)) if len(names) <= MAX_CORNERS else ()
    for point in itertools.chain(corners, unit_points("sobol", PROBES, len(names), 0)):
        values = (low + np.asarray(point) * (high - low)).tolist()
        with contextlib.suppress(SetupError):  # a combination that makes no helmet
            yield plan.design(dict(zip(names, values, strict=True)))
