"""Ask running nodes for one impact or fall and print the result."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click
from rich.console import Console

from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.model.fall.setup import fall_from_names, fall_leaves
from helmet_sim_ros.model.setup import setup_from_names, setup_leaves
from helmet_sim_ros.schema import Leaf
from helmet_sim_ros.study.scenario.matrix import flatten
from helmet_sim_ros.study.scenario.overrides import parse_overrides

IMPACT, FALL = "impact", "fall"


@click.group()
def command() -> None:
    """Call a running simulation (helmet-sim up, or ros2 run)."""


def option_name(leaf: Leaf) -> str:
    """``impact.normal_velocity`` -> ``--normal-velocity``, ``rider.mass`` -> ``--rider-mass``."""
    name = re.sub(r"^(impact|fall|sim)\.", "", leaf.name)
    return "--" + re.sub(r"[._]", "-", name)


def setup_options(leaves: Sequence[Leaf]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """One option for each value of an impact or fall, and those that every call has."""
    further: list[Callable[[Callable[..., None]], Callable[..., None]]] = [
        click.option("--helmet", "helmet__name",
                     help="name in config/helmets, or path to a YAML file"),
        click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
                     help="any dotted name, e.g. helmet.liner.density=60"),
        click.option("--namespace", default="", help="namespace of the nodes"),
        click.option("--timeout", default=120.0, show_default=True, help="longest wait for it [s]"),
        domain_option,
    ]  # fmt: skip

    def decorated(function: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(further):
            function = option(function)
        for leaf in reversed(leaves):
            kind: Any = {float: float, int: int, bool: bool}.get(leaf.type, str)
            if leaf.choices:
                kind = click.Choice([*leaf.choices, *(["side"] if "left" in leaf.choices else [])])
            function = click.option(
                option_name(leaf), leaf.name.replace(".", "__"), type=kind,
                metavar=None if leaf.choices else "VALUE",
                help=leaf.description if leaf.choices else f"{leaf.description}; {leaf.allowed}",
            )(function)  # fmt: skip
        return function

    return decorated


@command.command()
@setup_options(setup_leaves())
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
    _ask_and_print(IMPACT, options, overrides, namespace, timeout, domain_id)


@command.command()
@setup_options(fall_leaves())
def fall(
    overrides: tuple[str, ...],
    namespace: str,
    timeout: float,
    domain_id: int | None,
    **options: Any,
) -> None:
    """Set what is given on the running simulation, run one fall, print the answer.

    Values that are not given stay as they are on the simulation node, if a fall was its last. If
    another client changes the setup before the fall runs, that is an error and nothing of it is
    shown.
    """
    _ask_and_print(FALL, options, overrides, namespace, timeout, domain_id)


def _ask_and_print(
    kind: str,
    options: Mapping[str, Any],
    overrides: tuple[str, ...],
    namespace: str,
    timeout: float,
    domain_id: int | None,
) -> None:
    given = {name: value for name, value in options.items() if value is not None}
    values = {name.replace("__", "."): value for name, value in given.items()}
    values |= flatten(parse_overrides(overrides))
    own = {leaf.name for leaf in (fall_leaves() if kind == FALL else setup_leaves())}
    # Refuse bad input before anyone is asked; what of sim.* is no part of a setup the node judges.
    build = fall_from_names if kind == FALL else setup_from_names
    build({k: v for k, v in values.items() if not k.startswith("sim.") or k in own})

    from helmet_sim_ros.nodes.asking import ask_for_impact

    for key, value in ask_for_impact(values, namespace, timeout, domain_id, kind).items():
        Console(highlight=False).print(f"{key}: {value}", soft_wrap=True, markup=False)
