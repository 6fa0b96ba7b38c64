"""Rerun the whole validation and write its report."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console


@click.command()
@click.option("--output", default="docs", show_default=True, type=click.Path(path_type=Path),
              metavar="DIR", help="Where validation.md and figures/ go.")  # fmt: skip
def command(output: Path) -> None:
    """Compare spring, foam and the published table; refine; balance; write OUTPUT/validation.md."""
    from helmet_sim_ros.report.validation.document import write_validation
    from helmet_sim_ros.study.validation.validate import validate

    console = Console(highlight=False)
    result = validate(lambda what: console.print(what))
    console.print(f"report: {write_validation(result, output)}")
