"""Start the four nodes and keep them up until Ctrl-C."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.cli._processes import (
    NODES,
    start_nodes,
    termination_as_interrupt,
)
from helmet_sim_ros.nodes.client import TICK
from helmet_sim_ros.nodes.environment import prepare_environment


@click.command()
@click.option("--output", default="logs", show_default=True, metavar="DIR",
              type=click.Path(path_type=Path), help="Where logs go.")  # fmt: skip
@click.option("--config-path", "paths", multiple=True, metavar="PATH",
              type=click.Path(exists=True, resolve_path=True),
              help="A file or folder of helmets, scenarios and standards that clients may name, "
              "beside those shipped.")  # fmt: skip
@click.option("--one-process", is_flag=True, help="All nodes in this process; "
              "one that crashes takes the others with it.")  # fmt: skip
@domain_option
def command(output: Path, paths: tuple[str, ...], one_process: bool, domain_id: int | None) -> None:
    """Start simulation, evaluator, recorder and scenario node; Ctrl-C ends them all."""
    from helmet_sim_ros.cli.run import check_writable

    check_writable(output)
    prepare_environment(domain_id)
    parameters: dict[str, dict[str, Any]] = {
        name: {"config_paths": list(paths)} if paths else {} for name in NODES
    }
    parameters["recorder"]["output_dir"] = str(output.resolve())
    try:
        with termination_as_interrupt(), start_nodes(one_process, parameters, quiet=False) as nodes:
            click.echo(f"nodes: {', '.join('/' + name for name in NODES)}; Ctrl-C ends them")
            nodes.exit_code = 0
            while True:
                nodes.check()
                time.sleep(TICK)
    except KeyboardInterrupt:
        click.echo("all nodes ended")
