"""What an optimisation leaves behind for a reader: table and plot of every design."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from helmet_sim_ros.extra import need
from helmet_sim_ros.study.optimisation.trials import Effect, OptimisationResult, Trial


def write_trials(path: Path, result: OptimisationResult) -> None:
    """Every trial as CSV: variables, responses, whether it is feasible and among the best."""
    variables, responses = list(result.plan.file.variables), list(result.plan.responses)
    chosen = {trial.number for trial in result.best}
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(["trial", *variables, *responses, "feasible", "best", "error"])
        for trial in (result.reference, *result.trials):
            table.writerow(
                [trial.number, *(trial.values.get(n) for n in variables)]
                + [trial.responses.get(n) for n in responses]
                + [trial.feasible, trial.number in chosen, trial.error]
            )


def write_sensitivity(path: Path, effects: Sequence[Effect]) -> None:
    """The sensitivity of the first of the best designs as CSV."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(["name", "response", "base", "low", "high", "elasticity"])
        table.writerows([e.name, e.response, e.base, e.low, e.high, e.elasticity] for e in effects)


def plot_trials(path: Path, result: OptimisationResult) -> None:
    """Plot of the designs as PNG.

    Several objectives: each pair of neighbours against each other. One: its best value so far over
    the trials.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure_class = need("matplotlib.figure", "study").Figure
    names = [goal.response for goal in result.plan.file.objectives]
    pairs = list(itertools.pairwise(names))
    figure = figure_class(figsize=(6.4 * max(1, len(pairs)), 4.8), layout="constrained")
    axes = figure.subplots(1, max(1, len(pairs)), squeeze=False)[0]
    if pairs:
        for axis, (x, y) in zip(axes, pairs, strict=True):
            _front(axis, result, x, y)
    else:
        _history(axes[0], result, names[0])
    figure.suptitle(result.plan.name)
    figure.savefig(path, format="png", dpi=150)


def _front(axis: Any, result: OptimisationResult, x: str, y: str) -> None:
    done = [trial for trial in result.trials if trial.error is None]
    groups = (
        ("a limit is missed", [t for t in done if not t.feasible], "0.8", "o", 12),
        ("every limit is met", [t for t in done if t.feasible], "tab:blue", "o", 14),
        ("best designs", list(result.best), "tab:red", "D", 34),
        ("reference", [result.reference], "black", "*", 120),
    )
    for label, trials, color, marker, size in groups:
        points = [t for t in trials if t.error is None]
        axis.scatter(
            [t.responses[x] for t in points], [t.responses[y] for t in points],
            s=size, c=color, marker=marker, label=label,
        )  # fmt: skip
    axis.set_xlabel(_label(result, x))
    axis.set_ylabel(_label(result, y))
    axis.legend()
    axis.grid(alpha=0.3)


def _history(axis: Any, result: OptimisationResult, name: str) -> None:
    smaller = result.plan.file.objectives[0].minimise is not None
    best_so_far: list[tuple[int, float]] = []
    for trial in result.trials:
        if trial.feasible and _improves(best_so_far, trial, name, smaller):
            best_so_far.append((trial.number, trial.responses[name]))
    feasible = [t for t in result.trials if t.feasible]
    axis.scatter(
        [t.number for t in feasible], [t.responses[name] for t in feasible], s=14,
        label="every limit is met",
    )  # fmt: skip
    numbers, values = [n for n, _ in best_so_far], [v for _, v in best_so_far]
    axis.step(numbers, values, where="post", c="tab:red", label="best so far")
    if result.reference.error is None:
        axis.axhline(result.reference.responses[name], c="black", ls="--", label="reference")
    axis.set_xlabel("trial")
    axis.set_ylabel(_label(result, name))
    axis.legend()
    axis.grid(alpha=0.3)


def _improves(so_far: list[tuple[int, float]], trial: Trial, name: str, smaller: bool) -> bool:
    if not so_far:
        return True
    value, last = trial.responses[name], so_far[-1][1]
    return value < last if smaller else value > last


def _label(result: OptimisationResult, name: str) -> str:
    unit = result.plan.responses[name].unit
    return name.replace("_", " ") + (f" [{unit}]" if unit and unit != "-" else "")
