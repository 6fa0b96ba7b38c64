"""What an optimisation found, as tables."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from helmet_sim_ros.cli._console import print_table
from helmet_sim_ros.study.optimisation.trials import OptimisationResult, Trial


def report(result: OptimisationResult, console: Console) -> None:
    """Print the best designs beside the reference, the sensitivity, and where the files are."""
    if result.best:
        print_table(console, design_table(result))
        print_table(console, sensitivity_table(result))
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
