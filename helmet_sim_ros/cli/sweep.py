"""Compute a study of many impacts, on all cores or on a cluster."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from helmet_sim_ros.cli._progress import shown_progress
from helmet_sim_ros.errors import StudyError


@click.command()
@click.argument("study")
@click.option("--output", metavar="DIR", type=click.Path(path_type=Path),
              help="Results folder; an interrupted sweep goes on there.  "
              "[default: NAME.results]")  # fmt: skip
@click.option("--workers", type=click.IntRange(0), metavar="N",
              help="Processes on this machine; 0: compute in this one.  "
              "[default: one per core]")  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS",
              help="Use a running Dask cluster, e.g. tcp://host:8786.")  # fmt: skip
@click.option("--override", "-o", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Replace a value in every impact, e.g. impact.friction=0.3.")  # fmt: skip
@click.option("--retry-failed", is_flag=True, help="Compute failed rows again.")
@click.option("--strikes", type=click.IntRange(1), metavar="N",
              help="Of a study of falls: write the head strikes of N falls, spread evenly over the "
              "ranks of peak g, as a scenario strikes.yaml.")  # fmt: skip
def command(
    study: str,
    output: Path | None,
    workers: int | None,
    scheduler: str | None,
    overrides: tuple[str, ...],
    retry_failed: bool,
    strikes: int | None,
) -> None:
    """Compute every impact of STUDY, a name in config/studies or a path to a YAML file.

    Exit code 0: every impact has its criteria; 1: not all, or stopped on the way (what is finished
    is kept, the same command goes on); 2: bad input, nothing was computed.
    """
    from helmet_sim_ros.cli._estimates import report
    from helmet_sim_ros.study.scenario.overrides import parse_overrides
    from helmet_sim_ros.study.sweeps.study import load_study
    from helmet_sim_ros.study.sweeps.sweep import results_folder, sweep

    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers and --scheduler exclude each other")
    console = Console(highlight=False)
    plan = load_study(study, **parse_overrides(overrides))
    if strikes is not None and not {"strikes", "peak_g"} <= set(plan.criteria):
        raise click.UsageError("--strikes goes with a study of falls that has peak_g")
    console.print(f"[bold]{plan.name}[/bold]: {len(plan)} {plan.unit}")
    kept = "every finished row is"
    try:
        with shown_progress(console, plan.unit) as progress:

            def tell(done: int, total: int, failed: int) -> None:
                nonlocal kept
                kept = f"{done} of {total} {plan.unit} are"
                progress(done, total, failed)

            result = sweep(
                plan, output, workers=workers, scheduler=scheduler, progress=tell,
                retry_failed=retry_failed,
            )  # fmt: skip
    except KeyboardInterrupt:
        folder = results_folder(plan, output)
        raise StudyError(
            f"interrupted; {kept} kept in {folder}, the same command goes on from there"
        ) from None
    report(result, console)
    if strikes is not None:
        from helmet_sim_ros.cli._falls import write_strikes

        write_strikes(result, strikes, console)
    if plan.file.histories is not None:
        try:
            from helmet_sim_ros.cli._histories import write_histories
        except ImportError as error:
            raise StudyError(
                f"histories are logs of ROS messages, which are not installed ({error}); all other "
                "results are there. Source a ROS 2 installation, or: "
                "pip install helmet_sim_ros[ros]"
            ) from None
        with shown_progress(console, "histories") as progress:
            path, differing = write_histories(result, progress)
        for line in differing:
            console.print(line, style="yellow", markup=False, soft_wrap=True)
        console.print(f"histories: {path}", soft_wrap=True)
    if result.failed:
        raise SystemExit(1)
