"""What a worker does: rows of dotted names in, criteria out. Light to import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

#: An error's text is cut here: some repeat the whole setup, which the row has anyway.
MAX_ERROR = 300


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
    """

    status: str
    error: str | None = None
    verdict: str | None = None
    values: tuple[float | None, ...] = ()


def run_chunk(job: Job, chunk: Sequence[Mapping[str, Any]]) -> list[Outcome]:
    """Simulate and evaluate the impacts of a chunk, one after the other."""
    return [run_row(job, values) for values in chunk]


def run_row(job: Job, values: Mapping[str, Any]) -> Outcome:
    """Simulate and evaluate one impact; an error becomes its outcome."""
    from helmet_sim_ros.biomech.evaluation import evaluate
    from helmet_sim_ros.model.impact import simulate
    from helmet_sim_ros.model.setup import setup_from_names

    try:
        result = evaluate(simulate(setup_from_names(values)), job.standard, job.criteria)
    except Exception as error:  # one bad case must not stop a study
        return Outcome("failed", f"{type(error).__name__}: {error}"[:MAX_ERROR])
    found = result.criteria
    numbers = tuple(found[n].value if n in found else None for n in job.criteria)
    return Outcome("ok", None, result.verdict, numbers)


def warm_up() -> dict[str, str]:
    """Import the physics and say which versions of what decides results run here."""
    from importlib.metadata import version

    from helmet_sim_ros.model import impact  # noqa: F401 - takes a second, once per process
    from helmet_sim_ros.study.study import PACKAGES

    return {name: version(name) for name in PACKAGES}
