"""Search for better helmet designs, on all cores or on a cluster."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from helmet_sim_ros.cli._progress import shown_progress
from helmet_sim_ros.errors import StudyError


@click.command()
@click.argument("study")
@click.option("--output", metavar="DIR", type=click.Path(path_type=Path),
              help="Results folder; a search goes on there.  "
              "[default: NAME.optimisation]")  # fmt: skip
@click.option("--trials", type=click.IntRange(1), metavar="N",
              help="Designs in all, those that are there already included.  "
              "[default: as STUDY says]")  # fmt: skip
@click.option("--workers", type=click.IntRange(0), metavar="N",
              help="Processes on this machine; 0: compute in this one.  "
              "[default: one per core]")  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS",
              help="Use a running Dask cluster, e.g. tcp://host:8786.")  # fmt: skip
@click.option("--override", "-o", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Replace a value in every impact, e.g. impact.friction=0.3.")  # fmt: skip
def command(
    study: str,
    output: Path | None,
    trials: int | None,
    workers: int | None,
    scheduler: str | None,
    overrides: tuple[str, ...],
) -> None:
    """Search for the best designs of STUDY, a name in config/studies or a path to a YAML file.

    Exit code 0: a design meets every limit, and no impact failed; 1: otherwise, or stopped on the
    way (what is finished is kept, the same command goes on); 2: bad input, nothing was computed.
    """
    from helmet_sim_ros.cli._designs import report
    from helmet_sim_ros.study.optimisation.plan import load_optimisation
    from helmet_sim_ros.study.optimisation.search import optimise
    from helmet_sim_ros.study.scenario.overrides import parse_overrides

    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers and --scheduler exclude each other")
    console = Console(highlight=False)
    plan = load_optimisation(study, **parse_overrides(overrides))
    console.print(
        f"[bold]{plan.name}[/bold]: {len(plan.file.variables)} variables, "
        f"{len(plan.impacts)} impacts per design"
    )
    try:
        with shown_progress(console, "designs") as progress:
            result = optimise(
                plan, output, workers=workers, scheduler=scheduler, progress=progress,
                trials=trials,
            )  # fmt: skip
    except KeyboardInterrupt:
        raise StudyError(
            "interrupted; every finished design is kept, the same command goes on from there"
        ) from None
    report(result, console)
    if result.failed or not result.best:
        raise SystemExit(1)
