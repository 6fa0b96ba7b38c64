"""Let a rider fall, and show what the head strikes."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console


@click.command()
@click.argument("preset", default="motorcycle")
@click.option("--speed", type=float, metavar="M/S", help="Level speed at the start.")
@click.option("--scene", metavar="NAME", help="Name in config/scenes, or path to a YAML file.")
@click.option("--helmet", metavar="NAME", help="Helmet, or none for a bare head.")
@click.option("--duration", type=float, metavar="S", help="Simulated time.  [default: 2]")
@click.option("--override", "-o", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set any value, e.g. fall.roll_deg=30 or rider.height=1.6.")  # fmt: skip
@click.option("--output", metavar="DIR", type=click.Path(path_type=Path),
              help="Write the page falls.html, strikes.csv, the strikes as a scenario for "
              "helmet-sim run, and as a log with its report there.")  # fmt: skip
def command(
    preset: str,
    speed: float | None,
    scene: str | None,
    helmet: str | None,
    duration: float | None,
    overrides: tuple[str, ...],
    output: Path | None,
) -> None:
    """Let a rider fall from a posture: PRESET is a name in config/postures (motorcycle, bicycle,
    pedestrian), or a path to a YAML file.

    Exit code 0: the fall was simulated, with or without head contact; 1: it failed; 2: bad input,
    nothing was computed.
    """
    from helmet_sim_ros.cli._console import print_table
    from helmet_sim_ros.cli._falls import rows_of, run_falls, strikes_table, summary, write_results
    from helmet_sim_ros.model.fall.setup import fall_from_names
    from helmet_sim_ros.study.scenario.overrides import parse_overrides

    given = {
        "fall.preset": preset, "fall.speed": speed, "fall.scene": scene, "helmet.name": helmet,
        "sim.duration": duration,
    }  # fmt: skip
    values = {name: value for name, value in given.items() if value is not None}
    fall = fall_from_names(values | parse_overrides(overrides))
    console = Console(highlight=False)
    name = Path(preset).stem
    results, failed = run_falls([(name, fall)], console)
    for line in failed:
        console.print(line, style="red", markup=False)
    print_table(console, strikes_table([(r.name, rows_of(r.strikes)) for r in results]))
    for result in results:
        for number, strike in enumerate(result.strikes, 1):
            for warning in strike.evaluation.warnings:
                text = f"{result.name}, strike {number}: {warning}"
                console.print(text, style="dim", markup=False, soft_wrap=True)
    console.print(summary(results), markup=False, soft_wrap=True)
    if output is not None:
        write_results(results, output, console)
    if failed:
        raise SystemExit(1)
