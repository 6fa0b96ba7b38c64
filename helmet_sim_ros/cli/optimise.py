"""Search for better helmet designs, on all cores or on a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich import box
from rich.console import Console
from rich.table import Table

from helmet_sim_ros.cli._progress import shown_progress
from helmet_sim_ros.errors import StudyError

if TYPE_CHECKING:
    from helmet_sim_ros.study.optimisation.trials import OptimisationResult, Trial


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


def report(result: OptimisationResult, console: Console) -> None:
    """Print the best designs beside the reference, the sensitivity, and where the files are."""
    if result.best:
        console.print(design_table(result))
        console.print(sensitivity_table(result))
    else:
        closest = min(
            (t for t in result.trials if t.error is None),
            key=lambda t: max(t.excess.values()), default=None,
        )  # fmt: skip
        missed = "" if closest is None else "; the closest one misses " + ", ".join(
            f"{name} by {value:.1%}" for name, value in closest.excess.items() if value > 0.0
        )  # fmt: skip
        console.print(f"no design meets every limit{missed}", style="bold red")
    for trial in [t for t in result.trials if t.error is not None][:10]:
        text = f"design {trial.number}: {trial.error}"
        console.print(text, style="red", markup=False, soft_wrap=True)
    feasible = sum(trial.feasible for trial in result.trials)
    console.print(
        f"{feasible} of {len(result.trials)} designs meet every limit; {result.computed} designs "
        "were computed now"
    )
    console.print(f"designs: {result.folder}/designs, trials.csv, pareto.png", soft_wrap=True)


def design_table(result: OptimisationResult) -> Table:
    """One line per design: responses, then variables."""
    plan = result.plan
    table = Table(
        title="Best designs (the first line is the reference)", box=box.SIMPLE_HEAD,
        title_justify="left", pad_edge=False,
    )  # fmt: skip
    table.add_column("design")
    for name, response in plan.responses.items():
        unit = f" [{response.unit}]" if response.unit not in ("", "-") else ""
        table.add_column(f"{name}{unit}", justify="right")
    for row in (result.reference, *result.best):
        table.add_row(_name(row), *(f"{row.responses.get(n, float('nan')):.4g}"
                                    for n in plan.responses))  # fmt: skip
    return table


def sensitivity_table(result: OptimisationResult) -> Table:
    """Elasticity of every response of the first best design."""
    names = dict.fromkeys(effect.response for effect in result.sensitivity)
    step = result.plan.file.sensitivity.step
    table = Table(
        title=f"Sensitivity of {_name(result.best[0])}: % change per + 1 %, from +-{step:.0%}",
        box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False,
    )  # fmt: skip
    table.add_column("value", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right")
    rows: dict[str, dict[str, float]] = {}
    for effect in result.sensitivity:
        rows.setdefault(effect.name, {})[effect.response] = effect.elasticity
    for name, found in rows.items():
        table.add_row(name.removeprefix("helmet."), *(f"{found[n]:+.2f}" for n in names))
    return table


def _name(trial: Trial) -> str:
    return "reference" if trial.number < 0 else f"design_{trial.number:04d}"
