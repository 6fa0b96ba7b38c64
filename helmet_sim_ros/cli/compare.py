"""Compare the impacts of two logs: difference table, overlaid histories, exit code for CI."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click
from rich import box
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.biomech.catalogue import entry
from helmet_sim_ros.biomech.histories import SPIKE_WIDTH
from helmet_sim_ros.cli._console import PlainConsole, print_table
from helmet_sim_ros.cli._logs import DIFFERENT, FINE
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.report.review.compare import (
    Change,
    Likeness,
    Pair,
    changes,
    likeness,
    paired,
)

#: Compared unless the user chooses.
DEFAULT = (
    "peak_g", "hic", "clip_3ms", "peak_normal_force", "peak_tangential_force", "force_ratio",
    "peak_compression", "pulse_duration",
)  # fmt: skip


@click.command()
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option("--tolerance", default=1.0, show_default=True, type=click.FloatRange(0.0),
              metavar="PERCENT", help="Largest difference that counts as none.")  # fmt: skip
@click.option("--criterion", "-c", "names", multiple=True, metavar="NAME",
              help="Compare this one, repeatable.  [default: the main ones]")  # fmt: skip
@click.option("--all-criteria", is_flag=True, help="Compare every criterion.")
@click.option("--output", "-o", type=click.Path(path_type=Path), metavar="FILE",
              help="Write overlaid histories as .svg, .pdf or .png.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    a: Path,
    b: Path,
    tolerance: float,
    names: tuple[str, ...],
    all_criteria: bool,
    output: Path | None,
    as_json: bool,
) -> None:
    """Compare log B with log A: two helmets, or two versions of this program.

    Impacts of the same direction, speeds and pose are paired, their criteria computed from the
    logged samples, and their histories rated (ISO/TS 18571; 1 is alike).

    Exit code 0: all within the tolerance; 1: not all, or an impact has no counterpart; 2: a log
    cannot be read.
    """
    from helmet_sim_ros.report.figures.overlay import overlay_figure
    from helmet_sim_ros.report.figures.save import save_figure

    for name in names:
        entry(name)  # refuse an unknown one
    pairs = paired(open_log(a), open_log(b))
    if not pairs:
        raise LogError(f"{a}, {b}: no complete impact in either log")
    wanted = None if all_criteria else names or DEFAULT
    rows = [
        (pair, list(changes(pair, wanted, tolerance / 100.0)) if pair.a and pair.b else [])
        for pair in pairs
    ]
    alike = [likeness(pair) if pair.a and pair.b else None for pair, _ in rows]
    same = all(pair.a and pair.b and not any(c.differs for c in found) for pair, found in rows)
    if as_json:
        click.echo(json.dumps([_plain(*row, of) for row, of in zip(rows, alike, strict=True)]))
    else:
        _show(rows, a, b, tolerance, same)
        _show_alike([(pair, of) for (pair, _), of in zip(rows, alike, strict=True) if of])
    if output is not None:
        if not any(pair.a and pair.b for pair in pairs):
            raise click.UsageError("--output: no impact is in both logs, there is nothing to draw")
        titles = (a.stem, b.stem) if a.stem != b.stem else (f"A {a.stem}", f"B {b.stem}")
        save_figure(overlay_figure(pairs, titles), output)
        click.echo(os.path.relpath(output), err=as_json)
    raise SystemExit(FINE if same else DIFFERENT)


def _show(
    rows: list[tuple[Pair, list[Change]]], a: Path, b: Path, tolerance: float, same: bool
) -> None:
    console = PlainConsole()
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("impact")
    table.add_column("criterion", no_wrap=True)
    for header in ("A", "B", "B - A", "%"):
        table.add_column(header, justify="right", no_wrap=True)
    for pair, found in rows:
        if not found:
            where = "B" if pair.b is None else "A"
            table.add_row(pair.label, Text(f"missing in {where}", style="bold red"))
        for i, c in enumerate(found):
            name = c.name if c.unit == "-" else f"{c.name} [{c.unit}]"
            gap = "" if c.a is None or c.b is None else f"{c.b - c.a:+.4g}"
            percent = Text(
                f"{100 * c.relative:+.2f}" if gap else "missing",
                style="bold red" if c.differs else "",
            )
            table.add_row(
                "" if i else pair.label, Text(name), _number(c.a), _number(c.b), gap, percent
            )
    console.print(f"A: {a}\nB: {b}", markup=False, soft_wrap=True)
    print_table(console, table)
    beyond = sum(c.differs for _, found in rows for c in found)
    missing = sum(not found for _, found in rows)
    text = "no difference" if same else f"{beyond} differences, {missing} impacts without pair"
    console.print(f"{text} (tolerance {tolerance:g} %)", style="" if same else "bold red")


def _show_alike(rows: list[tuple[Pair, Likeness]]) -> None:
    """How alike the histories are; no part of the verdict."""
    if not rows:
        return
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("impact")
    table.add_column("history")
    for header in ("rating", "corridor", "phase", "magnitude", "slope"):
        table.add_column(header, justify="right", no_wrap=True)
    table.add_column("grade", no_wrap=True)
    for pair, of in rows:
        if of.problem:
            table.add_row(pair.label, "cannot be rated")
        for i, (channel, rating) in enumerate(of.ratings.items()):
            name = channel.replace("_", " ")
            numbers = (f"{value:.3f}" for value in rating)
            table.add_row("" if i else pair.label, name, *numbers, rating.grade)
    console = PlainConsole()
    console.print("Histories of B rated against A (ISO/TS 18571; 1 is alike)")
    print_table(console, table)
    console.print(
        f"Chatter: highest spike of the head acceleration within {1e3 * SPIKE_WIDTH:g} ms"
    )
    for pair, of in rows:
        spikes = zip("AB", of.chatter, strict=False)
        text = ", ".join(f"{x} {c.height:.1f} g at {c.time * 1e3:.1f} ms" for x, c in spikes)
        console.print(f"  {pair.label}: {text or of.problem}", markup=False, soft_wrap=True)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"


def _plain(pair: Pair, found: list[Change], of: Likeness | None) -> dict[str, object]:
    return {
        "impact": pair.label,
        "a": None if pair.a is None else pair.a.impact_id,
        "b": None if pair.b is None else pair.b.impact_id,
        "criteria": [
            {"name": c.name, "unit": c.unit, "a": c.a, "b": c.b, "differs": c.differs}
            for c in found
        ],
        "ratings": {} if of is None else {name: r._asdict() for name, r in of.ratings.items()},
        "chatter": [] if of is None else [c._asdict() for c in of.chatter],
    }
