"""Ask a running simulation for one impact, and make sure that it ran what was asked for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.nodes.client import call, ros_client, wait_for_service
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.nodes.parameters import coerced
from helmet_sim_ros.nodes.scenario_node import not_asked, ran_impact
from helmet_sim_ros.nodes.setup_parameters import configuration, simulation_leaves

#: How long a running simulation may take to be found [s].
FIND_TIMEOUT = 10.0


def ask_for_impact(
    values: Mapping[str, Any], namespace: str, timeout: float, domain_id: int | None = None
) -> dict[str, Any]:
    """Set values on a running simulation and run one impact; its answer.

    Args:
        values: by dotted names; what is not given stays as it is on the node.
        namespace: of the nodes.
        timeout: longest wait for an answer [s].
        domain_id: ROS domain; None: ``ROS_DOMAIN_ID``.

    Raises:
        NodeError: no simulation was found, or it refused, or did not answer in time.
    """
    prepare_environment(domain_id)
    with ros_client() as node:
        prefix = f"/{namespace.strip('/')}/simulation".replace("//", "/")
        change = node.create_client(SetParametersAtomically, f"{prefix}/set_parameters_atomically")
        run = node.create_client(Trigger, f"{prefix}/run_impact")
        for client in (change, run):
            wait_for_service(node, client, min(timeout, FIND_TIMEOUT))
        if values:
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
        raise NodeError(f"no impact: {answer.message}")
    impact_id, ran = ran_impact(answer.message)
    if ran != asked:
        raise NodeError(not_asked(impact_id, ran, asked))
    found: dict[str, Any] = json.loads(answer.message)
    return found


def asked_setup(node: Any, prefix: str, given: Mapping[str, Any], timeout: float) -> ImpactSetup:
    """The whole setup that is asked for: what is given, all else as it stands on the simulation.

    Raises:
        SetupError: the helmet of the simulation cannot be loaded here.
        NodeError: no answer.
    """
    leaves = {leaf.name: leaf for leaf in simulation_leaves()}
    client = node.create_client(GetParameters, f"{prefix}/get_parameters")
    wait_for_service(node, client, min(timeout, FIND_TIMEOUT))
    answer = call(node, client, GetParameters.Request(names=list(leaves)), timeout)
    there = zip(leaves, map(parameter_value_to_python, answer.values), strict=False)
    values = dict(there) | dict(given)
    return configuration({k: coerced(leaves[k], v) for k, v in values.items()}).setup
