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
def command(
    table: Path | None,
    helmet: str,
    speeds: tuple[float, ...],
    output: Path | None,
    plot: Path | None,
    peaks: Path | None,
) -> None:
    """Identify F = A (exp(B d) - 1) per side from the drop tests in TABLE, a CSV file.

    Columns: direction, normal_velocity_m_s, peak_force_N, peak_compression_m (one row per test),
    or direction, normal_velocity_m_s, force_N, compression_m (full loops). Without TABLE the
    scenario drop_tests is simulated with the foam liner of the base helmet.
    """
    from helmet_sim_ros.cli._springs import show
    from helmet_sim_ros.model.helmet import load_helmet
    from helmet_sim_ros.study.identification.drop_table import read_drop_table, write_drop_table
    from helmet_sim_ros.study.identification.drop_tests import simulated_drops
    from helmet_sim_ros.study.identification.fit import identify, write_helmet

    console = Console(highlight=False)
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
        write_helmet(result, output, f"{helmet} with its spring identified from {origin}.")
        console.print(f"helmet: {output}")
    if plot:
        from helmet_sim_ros.report.figures.drops import identification_figure
        from helmet_sim_ros.report.figures.save import save_figure

        save_figure(identification_figure(result, loops), plot)
        console.print(f"figure: {plot}")
