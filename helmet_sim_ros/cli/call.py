"""Ask running nodes for one impact or fall and print the result."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click
from rich.console import Console

from helmet_sim_ros.cli._client import call, ros_client, wait_for_service
from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.fall.setup import Fall, fall_from_names, fall_leaves
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names, setup_leaves
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.schema import Leaf
from helmet_sim_ros.study.scenario.matrix import flatten
from helmet_sim_ros.study.scenario.overrides import parse_overrides

IMPACT, FALL = "impact", "fall"
#: How long a running simulation may take to be found [s].
FIND_TIMEOUT = 10.0


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

    for key, value in ask_for_impact(values, namespace, timeout, domain_id, kind).items():
        Console(highlight=False).print(f"{key}: {value}", soft_wrap=True, markup=False)


def ask_for_impact(
    values: Mapping[str, Any],
    namespace: str,
    timeout: float,
    domain_id: int | None = None,
    kind: str = IMPACT,
) -> dict[str, Any]:
    """Set values on a running simulation and run one impact or fall; its answer.

    Args:
        values: by dotted names; what is not given stays as it is on the node.
        namespace: of the nodes.
        timeout: longest wait for an answer [s].
        domain_id: ROS domain; None: ``ROS_DOMAIN_ID``.
        kind: ``impact`` or ``fall``.

    Raises:
        NodeError: no simulation was found, or it refused, or did not answer in time.
    """
    prepare_environment(domain_id)
    values = {"sim.kind": kind} | dict(values)
    with ros_client() as node:
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter
        from std_srvs.srv import Trigger

        from helmet_sim_ros.nodes.scenario_node import not_asked, ran_impact

        prefix = f"/{namespace.strip('/')}/simulation".replace("//", "/")
        change = node.create_client(SetParametersAtomically, f"{prefix}/set_parameters_atomically")
        run = node.create_client(Trigger, f"{prefix}/run_{kind}")
        for client in (change, run):
            wait_for_service(node, client, min(timeout, FIND_TIMEOUT))
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        request = SetParametersAtomically.Request(
            parameters=[Parameter(k, value=v).to_parameter_msg() for k, v in plain.items()]
        )
        result = call(node, change, request, timeout).result
        if not result.successful:
            raise NodeError(f"the simulation refused the values: {result.reason}")
        asked = setup_digest(asked_setup(node, prefix, values, timeout).described())
        answer = call(node, run, Trigger.Request(), timeout)
    if not answer.success:
        raise NodeError(f"no {kind}: {answer.message}")
    impact_id, ran = ran_impact(answer.message)
    if ran != asked:
        raise NodeError(not_asked(impact_id, ran, asked))
    found: dict[str, Any] = json.loads(answer.message)
    return found


def asked_setup(
    node: Any, prefix: str, given: Mapping[str, Any], timeout: float
) -> ImpactSetup | Fall:
    """The whole setup that is asked for: what is given, all else as it stands on the simulation.

    Raises:
        SetupError: the helmet of the simulation cannot be loaded here.
        NodeError: no answer.
    """
    from rcl_interfaces.srv import GetParameters
    from rclpy.parameter import parameter_value_to_python

    from helmet_sim_ros.nodes.parameters import coerced
    from helmet_sim_ros.nodes.setup_parameters import configuration, simulation_leaves

    leaves = {leaf.name: leaf for leaf in simulation_leaves()}
    client = node.create_client(GetParameters, f"{prefix}/get_parameters")
    wait_for_service(node, client, min(timeout, FIND_TIMEOUT))
    answer = call(node, client, GetParameters.Request(names=list(leaves)), timeout)
    there = zip(leaves, map(parameter_value_to_python, answer.values), strict=False)
    values = dict(there) | dict(given)
    return configuration({k: coerced(leaves[k], v) for k, v in values.items()}).setup
