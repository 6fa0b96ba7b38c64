"""The model against published experiments: ours, the difference, and whether it is accepted."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.errors import HelmetSimError, SetupError
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.scenario.matrix import Case
from helmet_sim_ros.study.scenario.reference import load_reference
from helmet_sim_ros.study.validation.experiments import Experiment, Value
from helmet_sim_ros.study.validation.quantities import QUANTITIES

#: Values of criteria and quantities of one setup, by name.
Measures = dict[str, float]


@dataclass(frozen=True)
class Finding:
    """One published value and ours.

    Attributes:
        experiment: where it is from.
        value: what was published, and the bound.
        cases: names of our cases.
        ours: of each case, in the unit of ``value``; of kind table its relative error.
        compared: what is held against the bound: each of ``ours``, their mean, or the largest.
        problem: why there is none of it, in words; else empty.
    """

    experiment: Experiment
    value: Value
    cases: tuple[str, ...] = ()
    ours: tuple[float, ...] = ()
    compared: tuple[float, ...] = ()
    problem: str = ""

    @property
    def accepted(self) -> bool:
        """Whether all that is compared lies within the stated bound."""
        low, high = self.value.bounds
        return bool(self.compared) and all(low <= ours <= high for ours in self.compared)

    @property
    def difference(self) -> float | None:
        """Relative difference from the published value [-], from the nearer end of a range, 0
        inside; of several the largest. Of an upper bound what is above it; None without number."""
        value = self.value
        if value.kind == "table":
            return max(self.compared, default=None)
        low = value.value if value.low is None else value.low
        high = value.value if value.high is None else value.high
        if low is None or high is None or not self.compared:
            return None
        if value.kind == "at_most":
            low = min(low, *self.compared)
        differences = [(ours - min(max(ours, low), high)) / min(max(ours, low), high)
                       for ours in self.compared]  # fmt: skip
        return max(differences, key=abs)


def findings(
    experiments: Iterable[Experiment], progress: Callable[[str], None] = lambda _: None
) -> tuple[Finding, ...]:
    """Run every experiment and compare. Equal setups are simulated once.

    An experiment that cannot be run (a name this version does not know, a run that diverges)
    gives findings that say so, and the others go on.
    """
    known: dict[str, Measures] = {}
    found: list[Finding] = []
    for experiment in experiments:
        progress(f"{experiment.id}: {experiment.title}")
        try:
            found += _findings(experiment, known)
        except HelmetSimError as error:
            found += [Finding(experiment, value, problem=str(error)) for value in experiment.values]
    return tuple(found)


def _findings(experiment: Experiment, known: dict[str, Measures]) -> list[Finding]:
    names = [value.criterion for value in experiment.values]
    cases = experiment.setups()
    ours = [_measured(case.impact, names, known) for case in cases]
    other: Sequence[Measures] = ()
    if experiment.against:
        other = [_measured(case.impact, names, known) for case in experiment.setups(True)]
    found = []
    for value in experiment.values:
        of = [measures[value.criterion] for measures in ours]
        if value.kind == "factor":
            of = [a / b[value.criterion] for a, b in zip(of, other, strict=True)]
        elif value.kind == "table":
            of = [abs(a / b - 1.0) for a, b in zip(of, _column(value, cases), strict=True)]
        compared = {"each": of, "mean": [sum(of) / len(of)], "largest": [max(of)]}[value.over]
        found.append(
            Finding(experiment, value, tuple(c.name for c in cases), tuple(of), tuple(compared))
        )
    return found


def _measured(setup: ImpactSetup, names: Sequence[str], known: dict[str, Measures]) -> Measures:
    key = json.dumps(setup.described(), sort_keys=True)
    missing = [name for name in names if name not in known.get(key, {})]
    if missing:
        record = simulate(setup)
        result = evaluate(record, criteria=[name for name in missing if name not in QUANTITIES])
        measures = known.setdefault(key, {})
        for name in missing:
            if name in QUANTITIES:
                measures[name] = QUANTITIES[name].of(record)
            else:
                measures[name] = float(result.criteria[name])
    return known[key]


def _column(value: Value, cases: Sequence[Case]) -> list[float]:
    """The published column of a table for each case.

    Raises:
        SetupError: no such table or column, or no row for a case.
    """
    name, _, column = value.table.partition("/")
    table = load_reference(name)
    numbers = []
    for case in cases:
        row = table.row(case.setup.described())
        if row is None or column not in row.get(value.criterion, {}):
            raise SetupError.of(
                "table", value.table, f"has no {value.criterion}/{column} for case {case.name}"
            )
        numbers.append(row[value.criterion][column])
    return numbers
