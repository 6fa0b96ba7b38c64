"""What a worker does: rows of dotted names in, criteria out. Light to import."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")

#: An error's text is cut here: some repeat the whole setup, which the row has anyway.
MAX_ERROR = 300
#: Impacts that are simulated before the first of them is evaluated, and their samples (10 MB).
TOGETHER, SAMPLES_TOGETHER = 8, 8000


@dataclass(frozen=True)
class Job:
    """What is the same for every impact of a study: standard, and criteria wanted."""

    standard: str
    criteria: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of one impact.

    Attributes:
        status: ``ok``, or ``failed``.
        error: why it failed.
        verdict: ``pass`` or ``fail`` by the standard; None if it failed to run.
        values: of the job's criteria, in their order; None where a record does not give one.
        notes: what weakens the values (what helmet and neck suffered beyond what they have...).
    """

    status: str
    error: str | None = None
    verdict: str | None = None
    values: tuple[float | None, ...] = ()
    notes: tuple[str, ...] = ()


def run_chunk(job: Job, chunk: Sequence[Mapping[str, object]]) -> list[Outcome]:
    """Simulate and evaluate impacts; an error becomes the outcome of its impact.

    Every stage does some impacts before the next one starts: then its code is still in the
    processor's caches, which saves a tenth of the time.
    """
    from helmet_sim_ros.biomech.evaluation import evaluate
    from helmet_sim_ros.biomech.record import ImpactRecord
    from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD
    from helmet_sim_ros.model.fall.setup import Fall, setup_or_fall
    from helmet_sim_ros.model.impact import Impact
    from helmet_sim_ros.model.setup import ImpactSetup
    from helmet_sim_ros.model.simulate import begun
    from helmet_sim_ros.study.falls.measures import judge_fall

    # A study that names no standard is not told that its impacts are no tests of one.
    standard = None if job.standard == DEFAULT_STANDARD else job.standard

    def planned(values: Mapping[str, object]) -> tuple[int, ImpactSetup | Fall]:
        setup = setup_or_fall(values)
        return setup.samples, setup

    def samples(plan: tuple[int, ImpactSetup | Fall]) -> int:
        return plan[0]

    def started(plan: tuple[int, ImpactSetup | Fall]) -> Impact:
        return begun(plan[1])

    def advanced(impact: Impact) -> Impact:
        impact.run()
        return impact

    def recorded(impact: Impact) -> tuple[ImpactSetup | Fall, ImpactRecord]:
        return impact.setup, impact.record()

    def judged(run: tuple[ImpactSetup | Fall, ImpactRecord]) -> Outcome:
        setup, record = run
        if isinstance(setup, Fall):
            verdict, numbers, notes = judge_fall(record, standard, job.criteria, setup)
            return Outcome("ok", None, verdict, numbers, notes)
        result = evaluate(record, standard, job.criteria)
        found = result.criteria
        numbers = tuple(found[n].value if n in found else None for n in job.criteria)
        return Outcome("ok", None, result.verdict, numbers, result.warnings)

    outcomes: list[Outcome] = []
    for block in _blocks(_tried(planned, chunk), samples):
        runs = _tried(recorded, _tried(advanced, _tried(started, block)))
        outcomes += _tried(judged, runs)
    return outcomes


def _tried(stage: Callable[[Item], Made], items: Iterable[Item | Outcome]) -> list[Made | Outcome]:
    """What the stage makes of each item; an outcome stays what it is."""

    def tried(item: Item | Outcome) -> Made | Outcome:
        if isinstance(item, Outcome):
            return item
        try:
            return stage(item)
        except Exception as error:  # one bad case must not stop a study
            return Outcome("failed", f"{type(error).__name__}: {error}"[:MAX_ERROR])

    return [tried(item) for item in items]


def _blocks(
    items: Iterable[Item | Outcome], samples: Callable[[Item], int]
) -> Iterator[list[Item | Outcome]]:
    """Neighbours whose samples fit into memory together, at least one each."""
    block: list[Item | Outcome] = []
    total = 0
    for item in items:
        more = 0 if isinstance(item, Outcome) else samples(item)
        if len(block) == TOGETHER or (block and total + more > SAMPLES_TOGETHER):
            yield block
            block, total = [], 0
        block.append(item)
        total += more
    yield block


def warm_up() -> dict[str, str]:
    """Import the physics and say which versions of what decides results run here."""
    from importlib.metadata import version

    from helmet_sim_ros.model import impact  # noqa: F401 - takes a second, once per process
    from helmet_sim_ros.study.sweeps.study import PACKAGES

    return {name: version(name) for name in PACKAGES}
