"""What a sweep found, as tables."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from helmet_sim_ros.study.sweeps.percentiles import Estimate, converged, convergence
from helmet_sim_ros.study.sweeps.sweep import SweepResult


def report(result: SweepResult, console: Console) -> None:
    """Print estimates, failures and where the results are."""
    if result.study.file.percentiles is not None:
        found = convergence(result.table, result.study.file.percentiles)
        console.print(estimate_table(found))
        for last in (series[-1] for series in found if not converged(series)):
            text = f"{last.criterion}, {last.percent:g} %: not converged with {last.draws} draws"
            console.print(text, style="yellow")
    errors = [(row["index"], row["error"]) for row in _failed(result)]
    for index, error in errors[:10]:
        console.print(f"impact {index}: {error}", style="red", markup=False, soft_wrap=True)
    if len(errors) > 10:
        console.print(f"... and {len(errors) - 10} more, see column error", style="red")
    console.print(
        f"{len(result.study) - result.failed} of {len(result.study)} impacts evaluated, "
        f"{result.computed} of them computed now"
    )
    console.print(f"results: {result.folder}/results.parquet, results.csv", soft_wrap=True)


def estimate_table(found: Sequence[Sequence[Estimate]]) -> Table:
    """One line per estimate and number of draws."""
    table = Table(
        title="Percentiles with 95 % bootstrap interval, for growing numbers of draws",
        box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False,
    )  # fmt: skip
    for header in ("group", "criterion"):
        table.add_column(header)
    for header in ("percentile", "draws", "impacts", "value", "95 % interval"):
        table.add_column(header, justify="right")
    for one in (estimate for series in found for estimate in series):
        group = ", ".join(map(str, one.group.values())) or "all"
        table.add_row(
            group, one.criterion, f"{one.percent:g}", str(one.draws), str(one.impacts),
            f"{one.value:.5g}", f"{one.low:.5g} to {one.high:.5g}",
        )  # fmt: skip
    return table


def _failed(result: SweepResult) -> list[dict[str, object]]:
    columns = result.table.select(["index", "status", "error"]).to_pylist()
    return [row for row in columns if row["status"] != "ok"]
