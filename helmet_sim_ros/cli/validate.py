"""Rerun the whole validation and write its report; or the published experiments alone."""

from __future__ import annotations

from pathlib import Path

import click
from rich import box
from rich.console import Console
from rich.table import Table

from helmet_sim_ros.cli._console import print_table


@click.command()
@click.option("--output", default="docs", show_default=True, type=click.Path(path_type=Path),
              metavar="DIR", help="Where validation.md and figures/ go.")  # fmt: skip
@click.option(
    "--experiments",
    "only_experiments",
    is_flag=True,
    help="Only the published experiments and foam data: show and write them.",
)
@click.option("--references", type=click.Path(path_type=Path), metavar="FILE",
              help="With --experiments: those of this file; nothing is written.")  # fmt: skip
def command(output: Path, only_experiments: bool, references: Path | None) -> None:
    """Compare spring, foam and published values; refine; balance; write OUTPUT/validation.md."""
    console = Console(highlight=False)
    if references is not None and not only_experiments:
        raise click.UsageError("--references: needs --experiments")
    if only_experiments:
        _experiments(console, output, references)
        return
    from helmet_sim_ros.report.validation.document import write_validation
    from helmet_sim_ros.study.validation.validate import validate

    result = validate(lambda what: console.print(what))
    console.print(f"report: {write_validation(result, output)}")


def _experiments(console: Console, output: Path, references: Path | None) -> None:
    from helmet_sim_ros.report.validation.experiments import (
        HEADER,
        experiments_section,
        replace_section,
        table_row,
    )
    from helmet_sim_ros.report.validation.foam import foam_section
    from helmet_sim_ros.study.validation.experiments import load_experiments
    from helmet_sim_ros.study.validation.findings import findings
    from helmet_sim_ros.study.validation.foam import load_foam_reference

    found = findings(load_experiments(references), lambda what: console.print(what))
    for name in ("calibration", "prediction"):
        table = Table(*HEADER, title=name, title_justify="left", box=box.SIMPLE_HEAD,
                      pad_edge=False, padding=(0, 1, 0, 0))  # fmt: skip
        for finding in found:
            if finding.experiment.set == name:
                table.add_row(*(cell.strip("*") for cell in table_row(finding)))
        print_table(console, table)
    accepted = sum(finding.accepted for finding in found)
    console.print(f"{accepted} of {len(found)} published values within their bounds")
    if references is None:
        output.mkdir(parents=True, exist_ok=True)
        path = output / "validation.md"
        replace_section(path, experiments_section(found))
        replace_section(path, foam_section(load_foam_reference()))
        console.print(f"sections: {path}")
