"""Ask running nodes for one impact and print the result."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import click
from rich.console import Console

from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.model.setup import setup_from_names, setup_leaves
from helmet_sim_ros.schema import Leaf
from helmet_sim_ros.study.scenario.matrix import flatten
from helmet_sim_ros.study.scenario.overrides import parse_overrides


@click.group()
def command() -> None:
    """Call a running simulation (helmet-sim up, or ros2 run)."""


def option_name(leaf: Leaf) -> str:
    """``impact.normal_velocity`` -> ``--normal-velocity``, ``rider.mass`` -> ``--rider-mass``."""
    name = re.sub(r"^(impact|sim)\.", "", leaf.name)
    return "--" + re.sub(r"[._]", "-", name)


def setup_options(function: Callable[..., None]) -> Callable[..., None]:
    """One option for each value of the impact setup."""
    for leaf in reversed(setup_leaves()):
        kind: Any = {float: float, int: int, bool: bool}.get(leaf.type, str)
        if leaf.choices:
            kind = click.Choice([*leaf.choices, *(["side"] if "left" in leaf.choices else [])])
        function = click.option(
            option_name(leaf), leaf.name.replace(".", "__"), type=kind,
            metavar=None if leaf.choices else "VALUE",
            help=leaf.description if leaf.choices else f"{leaf.description}; {leaf.allowed}",
        )(function)  # fmt: skip
    return function


@command.command()
@setup_options
@click.option("--helmet", "helmet__name", help="name in config/helmets, or path to a YAML file")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="any dotted name, e.g. helmet.liner.density=60")  # fmt: skip
@click.option("--namespace", default="", help="namespace of the nodes")
@click.option("--timeout", default=120.0, show_default=True, help="longest wait for it [s]")
@domain_option
def impact(
    overrides: tuple[str, ...],
    namespace: str,
    timeout: float,
    domain_id: int | None,
    **options: Any,
) -> None:
    """Set what is given on the running simulation, run one impact, print the answer.

    Values that are not given stay as they are on the simulation node. If another client changes
    the setup before the impact runs, that is an error and nothing of the impact is shown.
    """
    given = {name: value for name, value in options.items() if value is not None}
    values = {name.replace("__", "."): value for name, value in given.items()}
    values |= flatten(parse_overrides(overrides))
    own = {leaf.name for leaf in setup_leaves()}
    # Refuse bad input before anyone is asked; what of sim.* is no part of a setup the node judges.
    setup_from_names({k: v for k, v in values.items() if not k.startswith("sim.") or k in own})

    from helmet_sim_ros.nodes.asking import ask_for_impact

    for key, value in ask_for_impact(values, namespace, timeout, domain_id).items():
        Console(highlight=False).print(f"{key}: {value}", soft_wrap=True)
