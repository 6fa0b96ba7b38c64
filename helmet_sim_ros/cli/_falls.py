"""Falls for the terminal: run, table of head strikes, page, and a log of the strikes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.cli._progress import shown_progress
from helmet_sim_ros.cli._table import VERDICT_STYLE
from helmet_sim_ros.errors import DivergedError, LogError, StudyError
from helmet_sim_ros.mcap_log.strikes import NOTHING
from helmet_sim_ros.model.fall.setup import Fall, setup_or_fall
from helmet_sim_ros.model.fall.strikes import HeadStrikes, Strike, head_strikes
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.report.falls.tables import FallResult, impacts_of, to_scenario
from helmet_sim_ros.study.sweeps.sweep import SweepResult

#: Criteria in the table.
SHOWN = ("peak_g", "hic", "bric", "peak_angular_acceleration")
#: Columns behind the name, and whether they stand on the right.
HEADERS = (
    ("t [s]", True), ("struck", False), ("into", True), ("along", True), ("body", True),
    ("on", False), ("g", True), ("HIC", True), ("BrIC", True), ("a", True), ("", False),
)  # fmt: skip
AFTER_PEAK, LEAST = 0.020, 0.040  # s, that are logged after the peak, and at least; choices


def run_falls(
    cases: Sequence[tuple[str, Fall]], console: Console
) -> tuple[list[FallResult], list[str]]:
    """Simulate falls one after the other; the results, and a line for each that failed."""
    results: list[FallResult] = []
    failed: list[str] = []
    with shown_progress(console, "falls") as progress:
        for done, (name, fall) in enumerate(cases):
            progress(done, len(cases), len(failed))
            try:
                results.append(FallResult(name, fall, head_strikes(simulate(fall))))
            except DivergedError as error:
                failed.append(f"{name}: the simulation diverged at t = {error.time:.4f} s")
        progress(len(cases), len(cases), len(failed))
    return results, failed


Row = Mapping[str, Any]


def strike_rows(strikes: Sequence[Row]) -> list[Row]:
    """Rows of :func:`strikes_table` from strikes as the evaluator gives them."""
    return [
        {**strike, "verdict": strike["evaluation"]["verdict"]}
        | {name: entry["value"] for name, entry in strike["evaluation"]["criteria"].items()}
        for strike in strikes
    ]


def rows_of(strikes: HeadStrikes) -> list[Row]:
    """Rows of :func:`strikes_table`."""
    return [
        {**row, "verdict": strike.evaluation.verdict}
        for row, strike in zip(strikes.rows(SHOWN), strikes, strict=True)
    ]


def strikes_table(falls: Sequence[tuple[str, Sequence[Row]]]) -> Table:
    """One line per head strike; below it, which falls are without.

    Args:
        falls: name of each, and its strikes: see :func:`rows_of`.
    """
    table = Table(
        title="Head strikes", box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False,
        padding=(0, 1, 0, 0),
    )  # fmt: skip
    table.add_column("fall")
    for header, right in HEADERS:
        table.add_column(Text(header), justify="right" if right else "left", no_wrap=True)
    for name, strikes in falls:
        for number, strike in enumerate(strikes):
            table.add_row(Text("" if number else name), *_cells(strike))
    without = [name for name, strikes in falls if not strikes]
    lines = [f"{NOTHING}: {', '.join(without)}"] if without else []
    if len(without) < len(falls):
        lines.append("into, along: m/s; body: trunk to the surface, head down, deg; a: krad/s^2")
    table.caption = Text("\n".join(lines))
    table.caption_justify = "left"
    return table


def _cells(row: Row) -> list[str | Text]:
    return [
        f"{row['time']:.3f}", str(row["struck"]), f"{row['normal_velocity']:.1f}",
        f"{row['tangential_velocity']:.1f}", f"{row['body_angle_deg']:.0f}", str(row["zone"]),
        f"{row['peak_g']:.0f}", f"{row['hic']:.0f}", f"{row['bric']:.2f}",
        f"{row['peak_angular_acceleration'] * 1e-3:.1f}",
        Text(row["verdict"], style=VERDICT_STYLE.get(row["verdict"], "")),
    ]  # fmt: skip


def write_results(
    results: Sequence[FallResult], folder: Path, console: Console, name: str = "falls"
) -> None:
    """Write table, scenario, log and pages into a folder, and say where they are.

    Raises:
        LogError: one of them cannot be written.
    """
    from helmet_sim_ros.report.falls.page import write_falls

    log = _log(results, folder, console, name)
    pages = None
    if log is not None:
        from helmet_sim_ros.mcap_log import open_log
        from helmet_sim_ros.report.page.page import write_report

        pages = write_report([open_log(log)], folder / "strikes.html")
    written = write_falls(results, folder, None if pages is None else pages.name)
    for path in [*written, *filter(None, (log, pages))]:
        console.print(str(path), soft_wrap=True, markup=False)


def _log(results: Sequence[FallResult], folder: Path, console: Console, name: str) -> Path | None:
    """Log every strike as the impact that it is, simulated alone; None: nothing to log."""
    wanted = [(f"{fall}-{number}", strike) for fall, number, strike in impacts_of(results)]
    if not wanted:
        return None
    try:
        from helmet_sim_ros.cli._histories import log_impacts
    except ImportError:
        text = "strikes are not logged: logs are of ROS messages, which are not installed"
        console.print(text, style="yellow")
        return None
    path = folder / "strikes.mcap"
    folder.mkdir(parents=True, exist_ok=True)
    for old in (path, path.with_name(path.name + ".part")):
        old.unlink(missing_ok=True)
    try:
        log_impacts(path, name, [(_identity(n), to_the_peak(s)) for n, s in wanted])
    except DivergedError as error:
        raise StudyError(f"a strike diverged when it was simulated alone: {error.time}") from None
    return path


def write_strikes(result: SweepResult, count: int, console: Console) -> None:
    """Simulate falls of a sweep once more, and write their head strikes as a scenario.

    Raises:
        LogError: it cannot be written.
    """
    cases = [
        (f"{result.study.name}-{row.index:06d}", setup_or_fall(row.values))
        for row in result.spread(count)
    ]
    again, _ = run_falls([(name, fall) for name, fall in cases if isinstance(fall, Fall)], console)
    scenario, path = to_scenario(again), result.folder / "strikes.yaml"
    if scenario is None:
        console.print("no head strike is an impact: no strikes.yaml")
        return
    try:
        path.write_text(scenario, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror}") from error
    console.print(f"strikes: {path}", soft_wrap=True, markup=False)


def to_the_peak(strike: Strike) -> ImpactSetup:
    """A strike as an impact that ends a moment after its peak acceleration: what slides on for a
    second after it makes a log large and says little."""
    record, setup = strike.record, strike.setup()
    peak = int(np.linalg.norm(record.head_acceleration, axis=1).argmax())
    wanted = max(float(record.time[peak] - record.time[0]) + AFTER_PEAK, LEAST)
    if wanted >= setup.duration:
        return setup
    return setup.model_copy(update={"duration": wanted})


def _identity(name: str) -> str:
    """A name as an impact's identity: letters, digits and hyphens."""
    return "".join(c if c.isalnum() else "-" for c in name)


def summary(results: Sequence[FallResult]) -> str:
    """How many falls, strikes, and the worst of them, in words."""
    strikes = [s for r in results for s in r.strikes]
    if not strikes:
        return f"{len(results)} falls: {NOTHING}"
    worst = max(strikes, key=lambda s: s.peak_acceleration)
    with_contact = sum(bool(r.strikes) for r in results)
    speed = math.hypot(worst.normal_velocity, worst.tangential_velocity)
    return (
        f"{with_contact} of {len(results)} falls with head contact, {len(strikes)} strikes; the "
        f"worst: {worst.evaluation.peak_g.value:.0f} g at {speed:.1f} m/s on {worst.struck}"
    )
