"""A whole fall through simulation, evaluator and recorder, as any ROS 2 client sees it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from node_processes import Rig
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

from helmet_sim_ros import Fall, ImpactSetup, head_strikes, open_log, simulate
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.mcap_log.strikes import JudgedStrike
from helmet_sim_ros.nodes.diagnostics import to_strikes
from helmet_sim_ros.nodes.evaluator_node import judged_strikes
from helmet_sim_ros.nodes.qos import LIVE
from helmet_sim_ros.nodes.setup_parameters import parameter_values

#: A car strikes the helmet at once, and one that meets nothing.
STRUCK = Fall(preset="pedestrian", pitch_deg=170.0, height=1.2, duration=0.3, scene="car", x=0.3)
LOOSE = Fall(preset="pedestrian", height=1.4, duration=0.05)
LIVE_VALUES = {"sim.real_time_factor": 0.0, "sim.publish_rate": 1000.0}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("falls"), ["evaluator", "recorder"]) as running:
        running.start("simulation", sim__kind="fall")  # its code is ready when it answers
        running.until(lambda: running.status.get("simulation", {}).get("readers") == "2", 300)
        yield running


def ran(rig: Rig, fall: Fall) -> dict[str, Any]:
    assert rig.set(**parameter_values(fall), **LIVE_VALUES) == ""
    return rig.impact("fall")


def pause(rig: Rig, paused: bool) -> None:
    assert rig.call("simulation/pause", SetBool.Request(data=paused)).success


def test_strikes_and_log_of_a_fall_equal_those_in_process_to_the_last_bit(rig: Rig) -> None:
    record = simulate(STRUCK)
    expected = judged_strikes(record)
    answer = ran(rig, STRUCK)
    impact_id = answer["impact_id"]
    assert answer["samples"] == len(record) and answer["strikes"] == len(expected)
    assert answer["peak_g"] == max(s.evaluation.peak_g.value for s in expected)
    assert answer["setup_digest"] == setup_digest(STRUCK.described())
    array = rig.criteria[impact_id]
    assert to_strikes(array) == (impact_id, tuple(expected))
    assert "bumper" in array.status[0].message
    last = json.loads(rig.call("evaluator/last_result").message)
    assert last["setup_digest"] == answer["setup_digest"] and last["evaluation"] is None
    assert [JudgedStrike.from_dict(strike) for strike in last["strikes"]] == expected
    path = rig.recorded(impact_id)
    assert rig.call("recorder/finish").success
    fall = open_log(path)[impact_id]
    assert same_samples(fall.record, record) and fall.strikes == tuple(expected)
    assert [s.evaluation for s in head_strikes(fall.record)] == [s.evaluation for s in expected]


def test_no_head_contact_is_a_result(rig: Rig) -> None:
    answer = ran(rig, LOOSE)
    (status,) = rig.criteria[answer["impact_id"]].status
    assert status.level == DiagnosticStatus.OK and status.message == "no head contact"
    assert (answer["strikes"], answer["peak_g"]) == (0, None)
    assert to_strikes(rig.criteria[answer["impact_id"]])[1] == ()


def test_a_paused_fall_is_shown_step_by_step_and_cancelled(rig: Rig) -> None:
    seen: dict[str, list[Any]] = {"scene": [], "helmet/pose": [], "joint_states": [], "/clock": []}
    kinds = {"scene": MarkerArray, "helmet/pose": PoseStamped, "joint_states": JointState}
    readers = [
        rig.node.create_subscription(kinds.get(topic, Clock), topic, seen[topic].append, LIVE)
        for topic in seen
    ]
    assert rig.set(**parameter_values(STRUCK), **LIVE_VALUES | {"sim.publish_rate": 200.0}) == ""
    pause(rig, True)
    running = rig.ask("simulation/run_fall")
    rig.until(lambda: rig.status["simulation"]["message"] == "paused")
    assert rig.status["simulation"]["total"] == "unknown"
    assert "busy: fall" in rig.set(fall__speed=3.0)
    rig.serve(0.3)
    for expected in range(2, 5):
        assert "of unknown samples" in rig.call("simulation/step").message
        rig.until(lambda: all(len(seen[name]) >= 2 for name in kinds))
        rig.until(lambda count=expected: len(seen["scene"]) >= count - 1)
    stamps = [message.header.stamp for message in seen["helmet/pose"]]
    times = np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps])
    assert np.diff(times) == pytest.approx(0.005, abs=2.5e-3)
    cars = [next(m for m in s.markers if m.ns == "surface").pose.position.y for s in seen["scene"]]
    assert np.all(np.diff(cars) < 0.0)  # it comes closer
    assert len(seen["joint_states"][0].name) == len(seen["joint_states"][0].position) > 10
    assert seen["/clock"][-1].clock.sec >= stamps[0].sec
    assert "cancelled fall" in rig.call("simulation/cancel").message
    rig.until(running.done)
    assert "cancelled by a client" in running.result().message
    impact_id = rig.status["simulation"]["impact_id"]
    rig.until(lambda: impact_id in rig.criteria)
    assert "cancelled" in rig.criteria[impact_id].status[0].message
    pause(rig, False)
    for reader in readers:
        rig.node.destroy_subscription(reader)


def test_what_runs_is_what_the_parameters_describe(rig: Rig) -> None:
    assert rig.set(**parameter_values(LOOSE), **LIVE_VALUES) == ""
    refused = rig.call("simulation/run_impact")
    assert not refused.success
    assert "describe a fall (sim.kind), which ~/run_fall runs" in refused.message
    drop = ImpactSetup(rig="headform", duration=0.02)
    assert rig.set(**parameter_values(drop)) == ""
    assert "which ~/run_impact runs" in rig.call("simulation/run_fall").message
    assert rig.impact()["setup_digest"] == setup_digest(drop.described())
