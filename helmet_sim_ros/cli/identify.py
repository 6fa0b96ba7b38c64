"""Identify a helmet's coupling spring from drop tests."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console


@click.command()
@click.argument("table", required=False, type=click.Path(path_type=Path))
@click.option("--helmet", default="fullface", show_default=True,
              help="Base helmet: without TABLE its foam liner is dropped in simulation; shell, "
              "mass and liner are kept.")  # fmt: skip
@click.option(
    "--speed",
    "speeds",
    type=float,
    multiple=True,
    metavar="M/S",
    help="Speed of the simulated drops, repeatable.  [default: 2.5, 5, 7.5, 10]",
)
@click.option("--output", type=click.Path(path_type=Path),
              help="Write the helmet with the identified spring to this YAML file.")  # fmt: skip
@click.option("--plot", type=click.Path(path_type=Path),
              help="Write the figure to this file (.svg, .pdf or .png).")  # fmt: skip
@click.option("--peaks", type=click.Path(path_type=Path),
              help="Write the drop tests' peaks to this CSV file.")  # fmt: skip
@click.option(
    "--fit",
    "parameters",
    multiple=True,
    metavar="NAME",
    help="Of histories: parameter to fit, a name below helmet., repeatable.  "
    "[default: liner.density, liner.energy_returned; of a spring, the struck sides' laws]",
)
@click.option(
    "--coupling",
    type=click.Choice(["foam", "spring"]),
    default="foam",
    show_default=True,
    help="Of histories: form of the helmet that is fitted.",
)
@click.option("--head-mass", type=float, metavar="KG",
              help="Of histories: mass of the headform; unset: the rider's head.")  # fmt: skip
def command(
    table: Path | None,
    helmet: str,
    speeds: tuple[float, ...],
    output: Path | None,
    plot: Path | None,
    peaks: Path | None,
    parameters: tuple[str, ...],
    coupling: str,
    head_mass: float | None,
) -> None:
    """Identify F = A (exp(B d) - 1) per side from the drop tests in TABLE, a CSV file.

    Columns: direction, normal_velocity_m_s, peak_force_N, peak_compression_m (one row per test),
    or direction, normal_velocity_m_s, force_N, compression_m (full loops). Without TABLE the
    scenario drop_tests is simulated with the foam liner of the base helmet.

    A TABLE with the columns file, direction and speed [m/s] lists measured histories (acceleration
    over time, CSV or ISO-MME): then parameters of the helmet are fitted to all of them at once.
    """
    from helmet_sim_ros.cli._springs import show
    from helmet_sim_ros.model.helmet import load_helmet
    from helmet_sim_ros.study.identification.drop_table import read_drop_table, write_drop_table
    from helmet_sim_ros.study.identification.drop_tests import simulated_drops
    from helmet_sim_ros.study.identification.fit import identify, write_helmet

    console = Console(highlight=False)
    from helmet_sim_ros.study.identification.histories import is_history_table

    if table is not None and is_history_table(table):
        _histories(table, helmet, parameters, coupling, head_mass, output, plot, console)
        return
    base = load_helmet(helmet)
    if table is None:
        drops = simulated_drops(speeds, helmet=helmet, overrides={"helmet.coupling": "foam"})
        tests, loops = [d.test for d in drops], [d.loop for d in drops]
        origin = f"{len(tests)} simulated drops of its foam liner"
    else:
        tests, loops = read_drop_table(table), []
        origin = f"{len(tests)} drop tests in {table.name}"
    result = identify(tests, base)
    show(result, console)
    if peaks:
        write_drop_table(tests, peaks)
        console.print(f"peaks: {peaks}")
    if output:
        write_helmet(result.helmet, output, f"{helmet} with its spring identified from {origin}.")
        console.print(f"helmet: {output}")
    if plot:
        from helmet_sim_ros.report.figures.drops import identification_figure
        from helmet_sim_ros.report.figures.save import save_figure

        save_figure(identification_figure(result, loops), plot)
        console.print(f"figure: {plot}")


def _histories(
    table: Path,
    helmet: str,
    parameters: tuple[str, ...],
    coupling: str,
    head_mass: float | None,
    output: Path | None,
    plot: Path | None,
    console: Console,
) -> None:
    """Fit a helmet to measured histories, and say what they leave open."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from helmet_sim_ros.study.identification.fit import write_helmet
    from helmet_sim_ros.study.identification.histories import read_histories
    from helmet_sim_ros.study.identification.history_fit import fit_histories

    drops = read_histories(table)
    result = fit_histories(drops, helmet, parameters, coupling, head_mass)
    view = Table(title=f"fitted to {len(drops)} histories", title_justify="left", box=SIMPLE_HEAD,
                 pad_edge=False)  # fmt: skip
    view.add_column("parameter")
    for header in ("value", "95 %", "told"):
        view.add_column(header, justify="right")
    for p in result.parameters:
        view.add_row(
            p.name, f"{p.value:.4g}", f"{p.low:.4g}..{p.high:.4g}", "no" if p.open else "yes"
        )
    console.print(view)
    for drop, error in zip(result.drops, result.error, strict=True):
        console.print(
            f"{drop.source}: {drop.direction} {drop.speed:g} m/s, residual {100 * error:.1f} % of "
            f"the peak {drop.acceleration.max():.0f} g",
            markup=False,
        )
    console.print(f"{result.rank} of {len(result.parameters)} combinations are determined")
    for note in result.notes:
        console.print(f"note: {note}", markup=False)
    if output:
        described = f"{helmet} fitted to {len(drops)} histories in {table.name}."
        write_helmet(result.helmet, output, described)
        console.print(f"helmet: {output}")
    if plot:
        from helmet_sim_ros.report.figures.drops import histories_figure
        from helmet_sim_ros.report.figures.save import save_figure

        save_figure(histories_figure(result), plot)
        console.print(f"figure: {plot}")
