"""Bring a helmet of your own: from meshes, foam tests and the scale to a helmet file."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console


@click.group()
def command() -> None:
    """Bring a helmet of your own: its shape, its foam."""


@command.command("import")
@click.argument("shell", type=click.Path(path_type=Path))
@click.option("--liner", type=click.Path(path_type=Path),
              help="Mesh of the solid liner, or of its inner surface.")  # fmt: skip
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="New folder for helmet.yaml and its array file.")  # fmt: skip
@click.option("--units", type=click.Choice(["mm", "cm", "m", "in"]),
              help="Of the meshes; unset: told by their size.")  # fmt: skip
@click.option("--headform", default="J", show_default=True, metavar="A|E|J|M|O",
              help="Size of the head that must fit.")  # fmt: skip
@click.option("--forward", default="x", show_default=True, metavar="AXIS",
              help="Axis of the meshes that points forwards: x, -y, ...")  # fmt: skip
@click.option("--up", default="z", show_default=True, metavar="AXIS",
              help="Axis of the meshes that points upwards.")  # fmt: skip
@click.option("--landmark", "landmarks", multiple=True, metavar="NAME=X,Y,Z",
              help="Instead of axes, points on the shell in the meshes' coordinates: left, right, "
              "front, back and top; repeatable.")  # fmt: skip
@click.option("--origin", metavar="X,Y,Z",
              help="The head's centre of gravity in the meshes' coordinates; unset: their origin "
              "if it lies inside, else the middle.")  # fmt: skip
@click.option(
    "--thickness",
    metavar="LENGTH",
    help="Of the liner, without a mesh of it ('40 mm'); unset: down to the headform.",
)
@click.option("--zone", "zones", multiple=True, metavar="NAME:WHERE",
              help="Where a zone (front, back, side, top) is: 'top: z > 60 mm', or a colour of the "
              "shell's triangles, 'top: #ff0000'; repeatable.")  # fmt: skip
@click.option("--columns", type=int, default=1000, show_default=True,
              help="Cells of the outer surface.")  # fmt: skip
@click.option("--mass", type=float, metavar="KG",
              help="Of the whole helmet, from the scale; unset: of shell and liner.")  # fmt: skip
@click.option("--areal-density", type=float, default=4.5, show_default=True, metavar="KG/M2",
              help="Mass of the shell per area.")  # fmt: skip
@click.option("--density", type=float, metavar="KG/M3",
              help="Of the foam; unset: that of the base helmet.")  # fmt: skip
@click.option(
    "--base",
    default="fullface",
    show_default=True,
    help="Helmet that gives what meshes do not tell: foam, padding, strap, spring.",
)
@click.option("--allow-intersections", is_flag=True,
              help="Take meshes that intersect themselves, and tell where.")  # fmt: skip
def import_(
    shell: Path,
    liner: Path | None,
    output: Path,
    units: str | None,
    headform: str,
    forward: str,
    up: str,
    landmarks: tuple[str, ...],
    origin: str | None,
    thickness: str | None,
    zones: tuple[str, ...],
    columns: int,
    mass: float | None,
    areal_density: float,
    density: float | None,
    base: str,
    allow_intersections: bool,
) -> None:
    """Make a helmet file of the mesh SHELL (STL, OBJ or PLY): outer surface or solid shell.

    The result is a folder with helmet.yaml and an array file, for helmet=FOLDER/helmet.yaml
    everywhere. Axes: x forward, y left, z up, origin at the head's centre of gravity.
    """
    from helmet_sim_ros.extra import need

    need("trimesh", "cad")
    need("embreex", "cad")
    need("fast_simplification", "cad")
    from helmet_sim_ros.study.helmets.importing import (
        ImportPlan,
        import_helmet,
        write_helmet_folder,
    )

    plan = ImportPlan(
        units=units, headform=headform, forward=forward, up=up,
        landmarks={k: _point(f"landmark.{k}", v) for k, v in map(_named, landmarks)},
        origin=None if origin is None else _point("origin", origin),
        thickness=None if thickness is None else _length("thickness", thickness),
        zones=zones, columns=columns, mass=mass, areal_density=areal_density, density=density,
        base=base, intersecting=allow_intersections,
    )  # fmt: skip
    imported = import_helmet(shell, liner, plan)
    path = write_helmet_folder(imported, output)
    console = Console(highlight=False, soft_wrap=True)
    for note in imported.notes:
        console.print(note, markup=False)
    console.print(f"helmet: {path}", markup=False)


def _named(text: str) -> tuple[str, str]:
    from helmet_sim_ros.errors import SetupError

    name, equals, rest = text.partition("=")
    if not equals:
        raise SetupError.of("landmark", text, "must be like front=150,0,20")
    return name.strip(), rest


def _point(key: str, text: str) -> tuple[float, float, float]:
    from helmet_sim_ros.errors import SetupError

    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise SetupError.of(key, text, "must be three numbers like 150,0,20") from None
    return x, y, z


def _length(key: str, text: str) -> float:
    """A length with its unit [m]."""
    from helmet_sim_ros.errors import SetupError
    from helmet_sim_ros.study.helmets.mesh import UNITS

    number = text.strip()
    unit = next((name for name in ("mm", "cm", "in", "m") if number.endswith(name)), None)
    try:
        return float(number.removesuffix(unit or "")) * UNITS[unit or ""]
    except (KeyError, ValueError):
        raise SetupError.of(key, text, "must be a length with its unit, like '40 mm'") from None


@command.command("foam")
@click.argument("table", type=click.Path(path_type=Path))
@click.option("--density", type=float, required=True, metavar="KG/M3", help="Of what was tested.")
@click.option("-o", "--output", type=click.Path(path_type=Path),
              help="New foam file, for liner.foam.")  # fmt: skip
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    help="Write the curves and their fit to this file (.svg, .pdf or .png).",
)
@click.option(
    "--rate",
    type=float,
    default=100.0,
    show_default=True,
    metavar="1/S",
    help="Strain rate for which the foam is made, where several were tested.",
)
@click.option("--solid-density", type=float, default=1050.0, show_default=True, metavar="KG/M3",
              help="Of the polymer; polystyrene 1050, polypropylene 900.")  # fmt: skip
def foam(
    table: Path,
    density: float,
    output: Path | None,
    plot: Path | None,
    rate: float,
    solid_density: float,
) -> None:
    """Make a foam of compression tests in TABLE, a CSV file of stress over strain.

    Columns with units in brackets, as 'strain [%]; stress [MPa]', of several rates with a column
    'rate [1/s]' or a stress column for each, 'stress 100 1/s [MPa]'. Semicolons and decimal commas
    are read.
    """
    from helmet_sim_ros.errors import SetupError
    from helmet_sim_ros.study.foams.curve import read_curves
    from helmet_sim_ros.study.foams.fitting import fit_foam, write_foam

    for key, value, low, high in (
        ("density", density, 10.0, 300.0), ("rate", rate, 1e-4, 1e4),
        ("solid_density", solid_density, 500.0, 2000.0),
    ):  # fmt: skip
        if not low <= value <= high:
            raise SetupError.of(key, value, f"must be from {low:g} to {high:g}")
    fit = fit_foam(read_curves(table), density, table.name, solid_density, rate)
    console = Console(highlight=False, soft_wrap=True)
    for note in fit.notes:
        console.print(note, markup=False)
    if output:
        write_foam(fit, output)
        console.print(f"foam: {output}", markup=False)
    if plot:
        from helmet_sim_ros.report.figures.foam import foam_figure
        from helmet_sim_ros.report.figures.save import save_figure

        save_figure(foam_figure(fit), plot)
        console.print(f"figure: {plot}", markup=False)
