"""Start the four nodes and keep them up until Ctrl-C."""

from __future__ import annotations

import time
from pathlib import Path

import click

from helmet_sim_ros.cli._client import TICK
from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.cli._processes import (
    NODES,
    NodeProcesses,
    termination_as_interrupt,
)
from helmet_sim_ros.nodes.environment import prepare_environment


@click.command()
@click.option("--output", default="logs", show_default=True, metavar="DIR",
              type=click.Path(path_type=Path), help="Where logs go.")  # fmt: skip
@domain_option
def command(output: Path, domain_id: int | None) -> None:
    """Start simulation, evaluator, recorder and scenario node; Ctrl-C ends them all."""
    from helmet_sim_ros.cli.run import check_writable

    check_writable(output)
    prepare_environment(domain_id)
    parameters = {"recorder": {"output_dir": str(output.resolve())}}
    try:
        with termination_as_interrupt(), NodeProcesses(parameters, quiet=False) as nodes:
            click.echo(f"nodes: {', '.join('/' + name for name in NODES)}; Ctrl-C ends them")
            while True:
                nodes.check()
                time.sleep(TICK)
    except KeyboardInterrupt:
        click.echo("all nodes ended")
