"""Write a self-contained HTML page about the impacts of logs."""

from __future__ import annotations

import os
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.cli._logs import FINE, complain, for_each_log, logs_argument, open_logs
from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.mcap_log import ImpactLog


@click.command()
@logs_argument
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), metavar="FILE",
    help="One page about all logs.  [default: a page LOG.html beside each log]",
)  # fmt: skip
@click.option("--standard", help="Judge by config/standards/NAME.yaml or a path.")
def command(logs: tuple[Path, ...], output: Path | None, standard: str | None) -> None:
    """Write an HTML page about each LOG: verdicts, histories, loops, 3-D replay, provenance.

    The page needs no network and no other file.
    """
    from helmet_sim_ros.report.page.page import write_report

    def write(opened: list[ImpactLog], path: Path) -> int:
        write_report(opened, path, standard)
        text = f"{os.path.relpath(path)} ({path.stat().st_size / 1e6:.1f} MB)"
        PlainConsole().print(text, markup=False, soft_wrap=True)
        return FINE

    if output is None:
        code = for_each_log(logs, lambda log: write([log], log.path.with_suffix(".html")))
    else:
        opened, code = open_logs(logs)
        if opened:
            try:
                write(opened, output)
            except HelmetSimError as error:
                code = complain(error)
    raise SystemExit(code)
