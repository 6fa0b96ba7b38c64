"""Save the complete impacts of a log that was never finished or is damaged."""

from __future__ import annotations

import os
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.cli._logs import FINE, complain, logs_argument
from helmet_sim_ros.errors import HelmetSimError


@click.command()
@logs_argument
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), metavar="FILE",
    help="Where to write it, for a single LOG.  [default: LOG without .part]",
)  # fmt: skip
def command(logs: tuple[Path, ...], output: Path | None) -> None:
    """Write a valid log with every complete impact of each LOG (usually LOG.mcap.part).

    LOG stays as it is; no existing file is replaced. Exit code 2: a log could not be recovered.
    """
    from helmet_sim_ros.mcap_log.recover import recover

    if output is not None and len(logs) > 1:
        raise click.UsageError("--output goes with a single LOG")
    console = PlainConsole()
    code = FINE
    for path in logs:
        try:
            result = recover(path, output)
        except HelmetSimError as error:
            code = complain(error, path)
            continue
        number = f"{result.impacts} complete impact{'s' if result.impacts != 1 else ''}"
        console.print(
            f"{os.path.relpath(result.path)}: {number}", style="bold", markup=False, soft_wrap=True
        )
        for lost in result.lost or ("nothing",):
            console.print(f"  lost: {lost}", markup=False, soft_wrap=True)
    raise SystemExit(code)
