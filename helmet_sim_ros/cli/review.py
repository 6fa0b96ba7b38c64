"""Show the impacts of logs and compute their criteria again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.cli._console import PlainConsole, print_table
from helmet_sim_ros.cli._falls import strike_rows, strikes_table
from helmet_sim_ros.cli._logs import DIFFERENT, FINE, for_each_log, logs_argument
from helmet_sim_ros.cli._table import SHORT as COLUMNS
from helmet_sim_ros.cli._table import VERDICT_STYLE, criteria_table
from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.mcap_log.strikes import NOTHING
from helmet_sim_ros.model.fall.strikes import HeadStrikes
from helmet_sim_ros.present.words import value_text
from helmet_sim_ros.report.review.check import Difference, Reviewed, ReviewedFall, reviewed
from helmet_sim_ros.report.review.strikes import LoggedStrike
from helmet_sim_ros.report.review.summary import (
    FOLLOWING,
    LEADING,
    SHORT,
    common,
    label,
    varying,
)

#: Differences shown per impact; the rest is counted.
MOST_DIFFERENCES = 8


@click.command()
@logs_argument
@click.option("--standard", help="Show verdicts by config/standards/NAME.yaml or a path.")
@click.option("--all-criteria", is_flag=True, help="Show every criterion of every impact.")
@click.option("--setup", "full_setup", is_flag=True, help="Show every value of the setup.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one line per log.")
def command(
    logs: tuple[Path, ...],
    standard: str | None,
    all_criteria: bool,
    full_setup: bool,
    as_json: bool,
) -> None:
    """Show the impacts of each LOG, and the head strikes of its falls; compute their criteria from
    the logged samples and compare.

    LOG: a log of the recorder, or a bag of ros2 bag record -s mcap with impact/samples.

    Exit code 0: all is as logged; 1: a criterion differs; 2: a log cannot be read.
    """
    console = PlainConsole()

    def show(log: ImpactLog) -> int:
        found = list(reviewed(log, standard))
        rows = [row for row in found if isinstance(row, Reviewed)]
        falls = [row for row in found if isinstance(row, ReviewedFall)]
        strikes = [strike for fall in falls for strike in fall.strikes]
        if as_json:
            click.echo(json.dumps(_plain(log, rows, falls)))
        else:
            _show_log(console, log, rows, falls, full_setup)
            if all_criteria:
                _show_criteria(console, [*rows, *strikes])
        differing = any(row.differences for row in (*rows, *strikes))
        return DIFFERENT if differing or any(fall.differences for fall in falls) else FINE

    raise SystemExit(for_each_log(logs, show))


def _show_log(
    console: PlainConsole,
    log: ImpactLog,
    rows: list[Reviewed],
    falls: list[ReviewedFall],
    full_setup: bool,
) -> None:
    def say(text: str, style: str = "") -> None:
        console.print(text, style=style, markup=False, soft_wrap=True)

    incomplete = f", {len(log.problems)} incomplete" if log.problems else ""
    counts = [(len(rows), "impact")] if rows or not falls else []
    counts += [(len(falls), "fall")] if falls else []
    count = " and ".join(f"{n} complete {what}{'s' * (n != 1)}" for n, what in counts)
    say(f"{os.path.relpath(log.path)}: {count}{incomplete}", "bold")
    run = log.run
    made = [run.get("scenario", ""), run.get("started", ""), log.library]
    say("  recorded: " + ", ".join(filter(None, made)))
    if versions := _versions(run):
        say(f"  versions: {versions}")
    for warning in log.warnings:
        say(f"  warning: {warning}", "yellow")
    for problem in log.problems:
        say(f"  {problem}", "yellow")
    setups = [row.impact.setup for row in rows] + [row.fall.setup for row in falls]
    if not setups:
        return
    values = common(setups)
    names = list(values) if full_setup else [name for name in SHORT if name in values]
    say("  setup: " + ", ".join(f"{name} = {value_text(values[name])}" for name in names))
    if any(models := _models(rows)):
        say("  model: " + ", ".join(f"{k} {v}".strip() for v, k in models.items()))
    if rows:
        print_table(console, _table(rows))
    for number, row in enumerate(rows, 1):
        _show_differences(say, f"#{number}", row.impact.impact_id, row.differences)
    for number, fall in enumerate(falls, len(rows) + 1):
        struck = len(fall.strikes)
        count = f"{struck} head strike{'s' * (struck > 1)}" if struck else NOTHING
        say(f"#{number} {label(fall.fall.setup)}: {count}, {fall.check}")
        _show_differences(say, f"#{number}", fall.fall.impact_id, fall.differences)
        for strike in fall.strikes:
            _show_differences(say, f"#{number}", strike.impact.impact_id, strike.differences)
    if falls:
        tables = [(f"#{n}", _strikes(fall)) for n, fall in enumerate(falls, len(rows) + 1)]
        print_table(console, strikes_table(tables))
    for warning, of in _noted(rows, falls).items():
        say(f"note: {warning} ({', '.join(of)})", "dim")


def _noted(rows: list[Reviewed], falls: list[ReviewedFall]) -> dict[str, list[str]]:
    """Each warning, and of which impacts and head strikes it is."""
    judged = [(f"#{number}", row) for number, row in enumerate(rows, 1)]
    for number, fall in enumerate(falls, len(rows) + 1):
        judged += [(f"#{number} strike {n}", strike) for n, strike in enumerate(fall.strikes, 1)]
    said: dict[str, list[str]] = {}
    for name, row in judged:
        for warning in row.evaluation.warnings:
            said.setdefault(warning, []).append(name)
    return said


def _show_differences(
    say: Callable[[str, str], None], short: str, name: str, differences: Sequence[Difference]
) -> None:
    for difference in differences[:MOST_DIFFERENCES]:
        say(f"{short} {name}: {difference}", "red")
    if len(differences) > MOST_DIFFERENCES:
        say(f"{short}: {len(differences)} differences in all", "red")


def _found(fall: ReviewedFall) -> HeadStrikes:
    return HeadStrikes(
        strike.impact.found for strike in fall.strikes if isinstance(strike.impact, LoggedStrike)
    )


def _strikes(fall: ReviewedFall) -> list[Mapping[str, Any]]:
    """Rows of the table of strikes."""
    plain = zip(_found(fall).rows(()), fall.strikes, strict=True)
    return strike_rows([row | {"evaluation": s.evaluation.as_dict()} for row, s in plain])


def _table(rows: list[Reviewed]) -> Table:
    setups = [row.impact.setup for row in rows]
    more = [n for n in varying(setups) if n not in (*LEADING, *FOLLOWING)][:2]
    sliding = any(setup.get(LEADING[2]) for setup in setups)
    leading_names = LEADING if sliding else LEADING[:2]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    models = _models(rows)
    leading = ["#", "from"] if len(models) == 1 else ["#", "", "from"]
    for header in leading:
        table.add_column(header, no_wrap=True)
    numbers = ["vn", *(["vt"] if sliding else []), *(name.rpartition(".")[2] for name in more)]
    for header in [*numbers, *(header for _, header, _, _ in COLUMNS)]:
        table.add_column(Text(header), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column("check", no_wrap=True)
    for number, row in enumerate(rows, 1):
        impact, criteria = row.impact, row.evaluation.criteria
        values = [
            format(criteria[name].value * factor, style) if name in criteria else ""
            for name, _, style, factor in COLUMNS
        ]
        table.add_row(
            str(number), *([models[impact.model_hash]] if len(models) > 1 else []),
            *(value_text(impact.setup.get(name)) for name in (*leading_names, *more)),
            *values,
            Text(row.evaluation.verdict, style=VERDICT_STYLE.get(row.evaluation.verdict, "")),
            Text(row.check, style="bold red" if row.differences else ""),
        )  # fmt: skip
    return table


def _models(rows: list[Reviewed]) -> dict[str, str]:
    """Hash of each model in the log -> what it is called in the table; empty for a single one."""
    hashes = list(dict.fromkeys(row.impact.model_hash for row in rows))
    return {digest: f"M{i}" if len(hashes) > 1 else "" for i, digest in enumerate(hashes, 1)}


def _show_criteria(console: PlainConsole, rows: list[Reviewed]) -> None:
    for number, row in enumerate(rows, 1):
        case = {"name": f"#{number} {row.impact.impact_id}", "evaluation": row.evaluation.as_dict()}
        print_table(console, criteria_table(case))


def _versions(run: dict[str, str]) -> str:
    """``numpy 2.4.6 (here 2.5.0), ...``."""
    texts = []
    for key, logged in run.items():
        package = key.removeprefix("version.")
        if package != key:
            try:
                here = version(package)
            except PackageNotFoundError:
                here = logged
            texts.append(f"{package} {logged}" + (f" (here {here})" if here != logged else ""))
    return ", ".join(texts)


def _plain(log: ImpactLog, rows: list[Reviewed], falls: list[ReviewedFall]) -> dict[str, object]:
    return {
        "log": str(log.path),
        "run": log.run,
        "library": log.library,
        "warnings": list(log.warnings),
        "problems": list(log.problems),
        "impacts": [_plain_impact(row) for row in rows],
        "falls": [
            {
                "impact_id": fall.fall.impact_id,
                "start_time": fall.fall.start_time,
                "samples": fall.fall.samples,
                "model_hash": fall.fall.model_hash,
                "setup": dict(fall.fall.setup),
                "strikes_logged": fall.has_logged,
                "differences": [vars(difference) for difference in fall.differences],
                "strikes": [
                    row | {
                        "differences": [vars(difference) for difference in strike.differences],
                        "evaluation": strike.evaluation.as_dict(),
                    }
                    for row, strike in zip(_found(fall).rows(()), fall.strikes, strict=True)
                ],
            }
            for fall in falls
        ],
    }  # fmt: skip


def _plain_impact(row: Reviewed) -> dict[str, object]:
    return {
        "impact_id": row.impact.impact_id,
        "start_time": row.impact.start_time,
        "samples": row.impact.samples,
        "model_hash": row.impact.model_hash,
        "setup": dict(row.impact.setup),
        "criteria_logged": row.has_logged,
        "differences": [vars(difference) for difference in row.differences],
        "evaluation": row.evaluation.as_dict(),
    }
