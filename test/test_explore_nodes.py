"""A setup of the explorer on real nodes."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="the nodes need ROS 2")

from domains import claim_domain

from helmet_sim_ros import evaluate, simulate
from helmet_sim_ros.cli._processes import NodeProcesses
from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.explore.session import slot_of
from helmet_sim_ros.nodes.asking import ask_for_impact
from helmet_sim_ros.nodes.client import ros_client, wait_for_service

PATIENCE = 250.0


@pytest.fixture
def domain(monkeypatch):
    number = claim_domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return number


def wait_for_nodes() -> None:
    """Until the simulation node answers; a loaded machine needs long to start it."""
    with ros_client() as node:
        from std_srvs.srv import Trigger

        client = node.create_client(Trigger, "/simulation/run_impact")
        wait_for_service(node, client, PATIENCE)


@pytest.mark.timeout(900)  # a loaded machine compiles for minutes
def test_the_nodes_run_the_setup_that_is_sent_and_none_before_it(domain, tmp_path):
    first = slot_of({"helmet.name": "bicycle", "impact.neck_flexion_deg": 10.0})
    second = slot_of({"impact.normal_velocity": 6.5, "helmet.liner.front.density": 70.0})
    parameters = {"recorder": {"output_dir": str(tmp_path)}}
    with NodeProcesses(parameters):
        wait_for_nodes()
        for slot in (first, second):
            answer = ask_for_impact(slot.values(), "", PATIENCE)
            expected = evaluate(simulate(slot.setup)).peak_g.value
            assert answer["peak_g"] == pytest.approx(expected, rel=1e-6)


def test_no_node_is_said_in_time(domain):
    with pytest.raises(NodeError, match="is it running"):
        ask_for_impact({}, "nobody", 1.0)
