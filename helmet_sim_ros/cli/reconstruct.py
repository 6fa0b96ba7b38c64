"""From the residual crush of a helmet back to its crash, with the uncertainty."""

from __future__ import annotations

from pathlib import Path

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table


@click.command()
@click.argument("helmet")
@click.option("--residual", required=True, type=click.Path(path_type=Path),
              help="Table of depths: x, y, z and depth with units ('x [mm]; ...'), head axes, or "
              "azimuth [deg], elevation [deg] and depth.")  # fmt: skip
@click.option("--noise", type=float, default=0.5, show_default=True, metavar="MM",
              help="Standard deviation of a measured depth.")  # fmt: skip
@click.option("--surface", default="ground", show_default=True, help="What was struck.")
@click.option("--friction", type=float, help="Of the shell on it; unset: the surface's.")
@click.option("--head-mass", type=float, metavar="KG", help="Of the head; unset: the rider's.")
@click.option("--fastest", type=float, default=10.0, show_default=True, metavar="M/S",
              help="Highest speed into the surface that is thought possible.")  # fmt: skip
@click.option("--along", type=float, default=8.0, show_default=True, metavar="M/S",
              help="Highest speed along it, to every side.")  # fmt: skip
@click.option("--samples", type=click.Path(path_type=Path),
              help="Write the sample of crashes to this CSV file.")  # fmt: skip
@click.option("--seed", type=int, default=0, show_default=True)
def command(
    helmet: str,
    residual: Path,
    noise: float,
    surface: str,
    friction: float | None,
    head_mass: float | None,
    fastest: float,
    along: float,
    samples: Path | None,
    seed: int,
) -> None:
    """Find speed, angle and place of the impact that left the crush of HELMET's foam liner.

    Simulates several hundred headform impacts, and samples those that explain the depths.
    """
    from helmet_sim_ros.errors import SetupError
    from helmet_sim_ros.model.force.columns import columns
    from helmet_sim_ros.model.setup import setup_from_names
    from helmet_sim_ros.study.reconstruction.crush_map import read_crush_map
    from helmet_sim_ros.study.reconstruction.posterior import UNITS, reconstruct, write_sample

    for key, value, low, high in (
        ("noise", noise, 0.01, 20.0), ("fastest", fastest, 2.0, 20.0), ("along", along, 0.5, 30.0),
    ):  # fmt: skip
        if not low <= value <= high:
            raise SetupError.of(key, value, f"must be from {low:g} to {high:g}")
    names: dict[str, object] = {
        "impact.rig": "headform", "helmet.name": helmet, "helmet.coupling": "foam",
        "impact.surface": surface,
    }  # fmt: skip
    if friction is not None:
        names["impact.friction"] = friction
    if head_mass is not None:
        names["rider.head_mass"] = head_mass
    setup = setup_from_names(names)
    crush = read_crush_map(residual, columns(setup.helmet_config))
    result = reconstruct(crush, setup, 1e-3 * noise, fastest, along, seed)
    console = Console(highlight=False, soft_wrap=True)
    view = Table(title=f"the crash behind {residual.name}, {len(crush.depth)} depths",
                 title_justify="left", box=SIMPLE_HEAD, pad_edge=False)  # fmt: skip
    view.add_column("quantity")
    for header in ("unit", "5 %", "median", "95 %", "of the prior"):
        view.add_column(header, justify="right")
    for name, unit in UNITS.items():
        low, middle, high = result.interval(name)
        view.add_row(
            name.replace("_", " "), unit, f"{low:.2f}", f"{middle:.2f}", f"{high:.2f}",
            f"{100 * result.told[name]:.0f} %",
        )  # fmt: skip
    console.print(view)
    console.print(
        f"{result.simulations} simulations, error of their stand-in "
        f"{1e3 * result.emulator_error:.2f} mm; misfit {result.misfit:.2f} times the noise; "
        f"acceptance {result.acceptance:.2f}, {result.steps_per_sample:.0f} steps per sample"
    )
    for note in result.notes:
        console.print(f"note: {note}", markup=False)
    if samples:
        write_sample(result, samples)
        console.print(f"sample: {samples}", markup=False)
