"""What a sweep found, as tables."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.cli._console import print_table
from helmet_sim_ros.study.falls.measures import STRIKE_MEASURES
from helmet_sim_ros.study.falls.summary import Summary, summarise
from helmet_sim_ros.study.sweeps.percentiles import Estimate, converged, convergence
from helmet_sim_ros.study.sweeps.sweep import SweepResult


def report(result: SweepResult, console: Console) -> None:
    """Print estimates, failures and where the results are."""
    if result.study.file.percentiles is not None:
        found = convergence(result.table, result.study.file.percentiles)
        print_table(console, estimate_table(found, result.study.unit))
        for last in (series[-1] for series in found if not converged(series)):
            text = f"{last.criterion}, {last.percent:g} %: not converged with {last.draws} draws"
            console.print(text, style="yellow")
    if "strikes" in result.study.criteria:
        report_falls(result, console)
    report_notes(result, console)
    unit = result.study.unit
    errors = [(row["index"], row["error"]) for row in _failed(result)]
    for index, error in errors[:10]:
        console.print(f"{unit[:-1]} {index}: {error}", style="red", markup=False, soft_wrap=True)
    if len(errors) > 10:
        console.print(f"... and {len(errors) - 10} more, see column error", style="red")
    console.print(
        f"{len(result.study) - result.failed} of {len(result.study)} {unit} evaluated, "
        f"{result.computed} of them computed now"
    )
    console.print(f"results: {result.folder}/results.parquet, results.csv", soft_wrap=True)


def report_notes(result: SweepResult, console: Console) -> None:
    """Print how many rows have notes, and of which kinds."""
    notes = result.table["notes"].to_pylist()
    noted = sum(map(bool, notes))
    if not noted:
        return
    unit = result.study.unit
    console.print(f"{noted} of {len(notes)} {unit} have notes, see column notes:", style="yellow")
    for kind, count in result.notes.items():
        console.print(f"  {count}: {kind}", style="yellow", markup=False, soft_wrap=True)


def report_falls(result: SweepResult, console: Console) -> None:
    """Print what the falls of a study say together, and draw it where matplotlib is installed."""
    columns = result.table.to_pydict()
    wanted = result.study.file.percentiles
    for summary in summarise(columns, () if wanted is None else wanted.by):
        print_table(console, falls_table(summary))
    needed = {"peak_g", *(name for name in STRIKE_MEASURES)}
    if not needed <= columns.keys() or not any(columns["strikes"]):
        return
    try:
        from helmet_sim_ros.report.figures.falls import falls_figure
        from helmet_sim_ros.report.figures.save import save_figure
    except ImportError:
        return
    path = result.folder / "falls.png"
    save_figure(falls_figure(columns, result.study.name), path)
    console.print(f"figure: {path}", soft_wrap=True)


def falls_table(summary: Summary) -> Table:
    """Head strikes of a group of falls."""
    group = f"{summary.group}: " if summary.group else ""
    struck = f"head contact in {summary.struck} of {summary.falls} falls"
    zones = ", ".join(f"{zone} {share:.0%}" for zone, share in summary.zones.items() if share)
    table = Table(
        title=f"{group}{struck}; the worst strike is on: {zones}" if zones else f"{group}{struck}",
        box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False,
    )  # fmt: skip
    table.add_column("worst strike")
    for header in ("mean", "deviation", "5 %", "50 %", "95 %"):
        table.add_column(header, justify="right")
    for m in summary.measures:
        unit = f" [{m.unit}]" if m.unit != "-" else ""
        values = (m.mean, m.deviation, m.low, m.median, m.high)
        table.add_row(Text(f"{m.name}{unit}"), *(f"{value:.3g}" for value in values))
    return table


def estimate_table(found: Sequence[Sequence[Estimate]], unit: str) -> Table:
    """One line per estimate and number of draws.

    Args:
        unit: what the rows of the study are, ``impacts`` or ``falls``.
    """
    table = Table(
        title="Percentiles with 95 % bootstrap interval, for growing numbers of draws",
        box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False,
    )  # fmt: skip
    for header in ("group", "criterion"):
        table.add_column(header)
    for header in ("percentile", "draws", unit, "value", "95 % interval"):
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
