"""Designs that were simulated: what they give, and which of them are the best."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from helmet_sim_ros.study.optimisation.design import Design
from helmet_sim_ros.study.optimisation.plan import Optimisation
from helmet_sim_ros.study.sweeps.engine import Chunk, Engine
from helmet_sim_ros.study.sweeps.sweep import MAX_CHUNK
from helmet_sim_ros.study.sweeps.worker import Job, Outcome


@dataclass(frozen=True)
class Trial:
    """One design of the search.

    Attributes:
        number: place in the search, from 0.
        values: variables by dotted name.
        responses: by name; empty if an impact failed.
        excess: of each constraint how far it is missed, relative to its bound; <= 0: met.
        error: why it has no responses.
    """

    number: int
    values: Mapping[str, float]
    responses: Mapping[str, float] = field(default_factory=dict)
    excess: Mapping[str, float] = field(default_factory=dict)
    error: str | None = None

    @property
    def feasible(self) -> bool:
        """Whether every constraint is met."""
        return self.error is None and all(value <= 0.0 for value in self.excess.values())


@dataclass(frozen=True)
class Effect:
    """How one response of a design follows one value.

    Attributes:
        name: dotted name of the value.
        response: name of the response.
        base: the response at the design.
        low, high: the response with the value made smaller and larger by the step.
        elasticity: relative change of the response per relative change of the value, by central
            difference [-]: 2 means that 1 % more gives 2 % more.
    """

    name: str
    response: str
    base: float
    low: float
    high: float
    elasticity: float


@dataclass(frozen=True)
class OptimisationResult:
    """What a search found.

    Attributes:
        plan: what was searched.
        folder: where the designs, the table and the plot are.
        reference: the helmet that the search started from, as trial -1.
        trials: every design.
        best: feasible designs that no other one beats in every objective, the best in the first
            objective first; with one objective, the best ones.
        sensitivity: of the first of the best designs.
        computed: trials that this call computed.
    """

    plan: Optimisation
    folder: Path
    reference: Trial
    trials: tuple[Trial, ...]
    best: tuple[Trial, ...]
    sensitivity: tuple[Effect, ...]
    computed: int

    @property
    def failed(self) -> int:
        """Trials with an impact that failed."""
        return sum(trial.error is not None for trial in self.trials)

    def helmet_file(self, trial: Trial) -> Path:
        """The helmet file of one of the best designs."""
        return self.folder / "designs" / f"design_{trial.number:04d}.yaml"


def best(plan: Optimisation, trials: Iterable[Trial]) -> tuple[Trial, ...]:
    """The best designs, at most ``plan.file.best``; see :class:`OptimisationResult`."""
    feasible = [trial for trial in trials if trial.feasible]
    scores = {trial.number: _scores(plan, trial) for trial in feasible}
    feasible.sort(key=lambda trial: scores[trial.number])
    if len(plan.file.objectives) > 1:
        feasible = [t for t in feasible if not _beaten(scores[t.number], scores.values())]
    if len(feasible) <= plan.file.best or len(plan.file.objectives) == 1:
        return tuple(feasible[: plan.file.best])
    steps = max(plan.file.best - 1, 1)  # spread along the front, both ends included
    return tuple(feasible[round(i * (len(feasible) - 1) / steps)] for i in range(plan.file.best))


def evaluate_designs(
    plan: Optimisation, engine: Engine, designs: Sequence[tuple[int, Mapping[str, float], Design]]
) -> Iterator[Trial]:
    """Simulate every impact of every design.

    Args:
        designs: number, variables and design of each.

    Returns:
        A trial for each design, as they finish.
    """
    setups = {number: plan.setups(design) for number, _, design in designs}
    yield from evaluate_setups(plan, engine, designs, setups)


def evaluate_setups(
    plan: Optimisation,
    engine: Engine,
    designs: Sequence[tuple[int, Mapping[str, float], Design]],
    setups: Mapping[int, Sequence[Mapping[str, object]]],
) -> Iterator[Trial]:
    """The same with the impacts of each design given, by its number."""
    outcomes: dict[int, dict[int, Outcome]] = {number: {} for number, _, _ in designs}
    known = {number: (values, design) for number, values, design in designs}
    chunks = (
        Chunk((number, first), tuple(mine[first : first + MAX_CHUNK]))
        for number, mine in setups.items()
        for first in range(0, len(mine), MAX_CHUNK)
    )
    for chunk, found in engine.run(Job(plan.file.standard, plan.criteria), chunks):
        number, first = chunk.tag
        outcomes[number] |= {first + i: outcome for i, outcome in enumerate(found)}
        if len(outcomes[number]) == len(setups[number]):
            values, design = known[number]
            mine = [outcomes[number][i] for i in range(len(setups[number]))]
            yield _judged(plan, number, values, design, mine)


def _judged(
    plan: Optimisation,
    number: int,
    values: Mapping[str, float],
    design: Design,
    outcomes: Sequence[Outcome],
) -> Trial:
    columns: dict[str, list[float]] = {}
    for i, outcome in enumerate(outcomes):
        if outcome.status != "ok":
            return Trial(number, dict(values), error=f"impact {i}: {outcome.error}")
        for name, value in zip(plan.criteria, outcome.values, strict=True):
            if value is None:
                return Trial(number, dict(values), error=f"impact {i}: it gives no {name}")
            columns.setdefault(name, []).append(value)
    responses = {name: r.value(design, columns, plan.limits) for name, r in plan.responses.items()}
    excess = {
        f"{i}: {limit.of}": limit.excess(responses[limit.of])
        for i, limit in enumerate(plan.file.constraints, 1)
    }
    return Trial(number, dict(values), responses, excess)


def _scores(plan: Optimisation, trial: Trial) -> tuple[float, ...]:
    """The objectives, all to be made small."""
    return tuple(
        trial.responses[g.response] if g.minimise else -trial.responses[g.response]
        for g in plan.file.objectives
    )


def _beaten(own: tuple[float, ...], others: Iterable[tuple[float, ...]]) -> bool:
    """Whether another one is nowhere worse and somewhere better."""
    return any(o != own and all(a <= b for a, b in zip(o, own, strict=True)) for o in others)
