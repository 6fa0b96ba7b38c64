"""Write the impacts of logs as CSV, Parquet or ISO-MME."""

from __future__ import annotations

import os
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.cli._logs import FINE, for_each_log, logs_argument
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog


@click.command()
@logs_argument
@click.option("--format", "-f", "form", type=click.Choice(["csv", "parquet", "isomme"]),
              default="csv", show_default=True, help="csv has a row of units below the names; "
              "isomme holds the head's channels in the signs of SAE J211.")  # fmt: skip
@click.option("--output", "-o", type=click.Path(path_type=Path), default=Path("export"),
              show_default=True, metavar="DIR", help="Where the files go.")  # fmt: skip
@click.option("--impact", "only", multiple=True, metavar="ID", help="Only this impact, repeatable.")
def command(logs: tuple[Path, ...], form: str, output: Path, only: tuple[str, ...]) -> None:
    """Write every impact of each LOG, and for csv and parquet a table of all results.

    Files: DIR/LOG_IMPACT.csv, DIR/LOG_impacts.csv (.parquet), or DIR/LOG_IMPACT/ for isomme; of
    falls their own samples (for isomme at the shortest step throughout) and DIR/LOG_strikes.csv.
    """
    console = PlainConsole()

    def write(log: ImpactLog) -> int:
        for path in export(log, form, output, only):
            console.print(os.path.relpath(path), markup=False, soft_wrap=True)
        return FINE

    raise SystemExit(for_each_log(logs, write))


def export(log: ImpactLog, form: str, output: Path, only: tuple[str, ...] = ()) -> list[Path]:
    """Write the impacts of a log; the files (folders for ISO-MME).

    Raises:
        LogError: no such impact, the log is damaged, or a file cannot be written.
    """
    from helmet_sim_ros.report.export import tables
    from helmet_sim_ros.report.export.isomme import write_isomme

    impacts = [impact for impact in log if not only or impact.impact_id in only]
    if missing := set(only) - {impact.impact_id for impact in impacts}:
        known = ", ".join(impact.impact_id for impact in log) or "none"
        raise LogError(f"{log.path}: no complete impact {missing.pop()!r}; in it: {known}")
    if not impacts:
        raise LogError(f"{log.path}: no complete impact in it")
    stem = plain(log.path.stem)
    written = []
    try:
        output.mkdir(parents=True, exist_ok=True)
        for impact in impacts:
            name = f"{stem}_{plain(impact.impact_id)}"
            if form == "isomme":
                date = log.run.get("started", "")[:10]
                written.append(write_isomme(impact, output, name, date))
                continue
            path = output / f"{name}.{form}"
            csv = form == "csv"
            (tables.write_samples_csv if csv else tables.write_samples_parquet)(impact, path)
            written.append(path)
        if form != "isomme":
            path = output / f"{stem}_impacts.{form}"
            (tables.write_results_csv if csv else tables.write_results_parquet)(impacts, path)
            written.append(path)
        falls = [impact for impact in impacts if impact.is_fall]
        if falls:
            from helmet_sim_ros.report.falls.logged import result_of
            from helmet_sim_ros.report.falls.tables import to_csv
            from helmet_sim_ros.report.replay.scene import admit_helmets

            admit_helmets(log)
            written.append(output / f"{stem}_strikes.csv")
            written[-1].write_text(to_csv([result_of(fall) for fall in falls]), encoding="utf-8")
    except OSError as error:
        where = error.filename or output
        raise LogError(f"{where}: cannot be written: {error.strerror or error}") from error
    return written


def plain(name: str) -> str:
    """A name from a log as part of a file name: nothing in it leaves the directory."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name) or "_"
