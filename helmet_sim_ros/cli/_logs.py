"""Several logs on one command line: a bad one is reported, the others are still processed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.errors import HelmetSimError, LogError
from helmet_sim_ros.mcap_log import ImpactLog, open_log

#: Exit codes.
FINE, DIFFERENT, BAD_INPUT = 0, 1, 2

logs_argument = click.argument(
    "logs", nargs=-1, required=True, metavar="LOG...", type=click.Path(path_type=Path)
)


def for_each_log(paths: Sequence[Path], action: Callable[[ImpactLog], int]) -> int:
    """Open each log and act on it; the worst exit code.

    Args:
        paths: files, or directories of ``ros2 bag record``.
        action: returns an exit code; may raise.
    """
    worst = FINE
    for path in paths:
        try:
            files = bag_files(path)
        except HelmetSimError as error:
            worst = complain(error)
            continue
        for file in files:
            try:
                worst = max(worst, action(open_log(file)))
            except HelmetSimError as error:
                worst = complain(error, file)
    return worst


def open_logs(paths: Sequence[Path]) -> tuple[list[ImpactLog], int]:
    """The logs that can be opened, and the exit code for those that cannot."""
    logs: list[ImpactLog] = []

    def keep(log: ImpactLog) -> int:
        logs.append(log)
        return FINE

    code = for_each_log(paths, keep)
    return logs, code


def bag_files(path: Path) -> list[Path]:
    """The path itself, or the MCAP files of a bag's directory.

    Raises:
        LogError: a directory without such a file.
    """
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise LogError(f"{path}: no .mcap file in this directory")
    return files


def complain(error: HelmetSimError, path: Path | None = None) -> int:
    """Print an error; the exit code for bad input."""
    text = str(error)
    if path is not None and str(path) not in text:
        text = f"{path}: {text}"
    PlainConsole(stderr=True).print(f"Error: {text}", style="red", markup=False, soft_wrap=True)
    return BAD_INPUT
