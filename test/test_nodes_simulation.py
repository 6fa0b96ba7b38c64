"""The simulation and the evaluator as processes, as any ROS 2 client sees them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import AccelStamped, WrenchStamped
from node_processes import Rig
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from visualization_msgs.msg import Marker, MarkerArray

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import block_labels, to_block
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.diagnostics import to_evaluation
from helmet_sim_ros.nodes.qos import LIVE, SAMPLES_READER, SAMPLES_WRITER
from helmet_sim_ros.nodes.setup_parameters import parameter_values

#: Every parameter of the simulation: a short headform drop, as fast as possible.
QUICK = parameter_values(ImpactSetup(rig="headform", duration=0.02)) | {
    "sim.real_time_factor": 0.0, "sim.publish_rate": 1000.0,
}  # fmt: skip
DIVERGING = {"helmet.shell.contact_stiffness": 1e8, "helmet.shell.effective_mass": 1e-5}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("nodes"), ["simulation", "evaluator"]) as running:
        yield running


@pytest.fixture
def quick(rig: Rig) -> Rig:
    """The rig, idle, with a short headform drop."""
    assert rig.call("simulation/reset").success
    rig.until(lambda: status(rig)[0] == "idle")
    assert rig.set(**QUICK) == ""
    return rig


def pause(rig: Rig, paused: bool) -> Any:
    return rig.call("simulation/pause", SetBool.Request(data=paused))


def status(rig: Rig) -> tuple[str, int]:
    told = rig.status["simulation"]
    return told["message"], int(told["done"])


def test_criteria_through_processes_equal_those_in_process(quick: Rig) -> None:
    values = {"impact.normal_velocity": 7, "impact.direction": "back", "helmet.mass": 1.5}
    assert quick.set(**values) == ""
    setup = ImpactSetup(
        rig="headform", direction="back", normal_velocity=7.0, duration=0.02,
        overrides={"helmet.mass": 1.5},
    )  # fmt: skip
    expected = evaluate(simulate(setup))
    answer = quick.impact()
    assert to_evaluation(quick.criteria[answer["impact_id"]]) == (answer["impact_id"], expected)
    assert answer["peak_g"] == expected.peak_g.value
    assert answer["samples"] == setup.samples
    last = json.loads(quick.call("evaluator/last_result").message)
    assert last["impact_id"] == answer["impact_id"]
    assert Evaluation.from_dict(last["evaluation"]) == expected


def test_levels_follow_the_limits(quick: Rig) -> None:
    assert quick.set(**{"impact.normal_velocity": 15.0}) == ""
    array = quick.criteria[quick.impact()["impact_id"]]
    evaluation = to_evaluation(array)[1]
    levels = {status.name: status.level for status in array.status}
    assert set(levels) == set(evaluation.criteria)
    assert evaluation.peak_g.verdict == "fail"
    assert levels["peak_g"] == DiagnosticStatus.ERROR
    assert levels["peak_normal_force"] == DiagnosticStatus.OK  # no limit


def test_impacts_in_a_row_are_the_same_to_the_last_bit_and_time_goes_on(quick: Rig) -> None:
    results = [quick.impact() for _ in range(5)]
    found = [to_evaluation(quick.criteria[result["impact_id"]])[1] for result in results]
    assert all(evaluation == found[0] for evaluation in found)
    starts = [result["start_time"] for result in results]
    assert np.all(np.diff(starts) > QUICK["sim.duration"])


def test_a_second_client_is_told_busy_and_values_stay(quick: Rig) -> None:
    assert quick.set(**{"sim.real_time_factor": 0.02}) == ""
    first = quick.ask("simulation/run_impact")
    quick.until(lambda: status(quick)[0] == "running")
    second = quick.call("simulation/run_impact")
    refused = quick.set(**{"impact.normal_velocity": 9.0})
    assert not second.success and "busy" in second.message
    assert "busy" in refused
    quick.until(first.done)
    assert first.result().success
    assert quick.get("impact.normal_velocity") == 5.0


def test_pause_step_and_cancel_answer_while_an_impact_runs(quick: Rig) -> None:
    assert "no impact" in quick.call("simulation/step").message
    assert pause(quick, True).success and pause(quick, True).success
    running = quick.ask("simulation/run_impact")
    quick.until(lambda: status(quick) == ("paused", 0))
    done = []
    for _ in range(2):
        step = quick.call("simulation/step")
        assert step.success
        done.append(int(step.message.split()[0]))
    assert done == [20, 40]  # one millisecond of 50 us steps each
    assert not running.done()
    assert pause(quick, False).success
    quick.until(running.done)
    assert running.result().success

    assert quick.set(**{"sim.real_time_factor": 1e-4}) == ""
    running = quick.ask("simulation/run_impact")
    quick.until(lambda: status(quick)[0] == "running")
    assert "paused" in quick.call("simulation/step").message
    assert quick.call("simulation/cancel").success
    quick.until(running.done)
    assert not running.result().success and "cancelled" in running.result().message
    assert "no impact" in quick.call("simulation/cancel").message


def test_a_cancelled_impact_has_no_number(quick: Rig) -> None:
    assert quick.set(**{"sim.real_time_factor": 1e-3}) == ""
    running = quick.ask("simulation/run_impact")
    quick.until(lambda: status(quick)[0] == "running")
    impact_id = quick.status["simulation"]["impact_id"]
    assert quick.call("simulation/reset").success
    quick.until(running.done)
    quick.until(lambda: impact_id in quick.criteria)
    (only,) = quick.criteria[impact_id].status
    assert only.level == DiagnosticStatus.ERROR and not only.values
    assert "incomplete" in only.message and "reset" in only.message
    assert not quick.call("evaluator/last_result").success


def test_a_diverging_impact_fails_with_its_setup_and_the_node_lives_on(quick: Rig) -> None:
    assert quick.set(**DIVERGING, **{"impact.rig": "rider"}) == ""
    answer = quick.call("simulation/run_impact")
    assert not answer.success
    assert "diverged" in answer.message and "'impact.normal_velocity': 5.0" in answer.message
    assert quick.set(**QUICK) == ""
    assert quick.impact()["samples"] == 401


def test_the_clock_never_runs_backwards_and_does_not_wait_for_an_impact(quick: Rig) -> None:
    times: list[int] = []
    subscription = quick.node.create_subscription(
        Clock, "/clock", lambda m: times.append(m.clock.sec * 10**9 + m.clock.nanosec), LIVE
    )
    quick.until(lambda: len(times) > 2)  # idle
    for _ in range(3):
        result = quick.impact()
    end = round((result["start_time"] + QUICK["sim.duration"]) * 1e9)
    quick.until(lambda: times[-1] >= end)
    quick.node.destroy_subscription(subscription)
    assert times == sorted(times)
    assert times[-1] == end


def test_live_topics_are_decimated_samples_in_their_frames(quick: Rig) -> None:
    assert quick.set(**{"impact.rig": "rider", "sim.publish_rate": 2000.0}) == ""
    kinds = {
        "head/acceleration": AccelStamped, "head/imu": Imu, "joint_states": JointState,
        "helmet/ground_contact": WrenchStamped, "scene": MarkerArray,
    }  # fmt: skip
    heard: dict[str, list[Any]] = {name: [] for name in kinds}
    subscriptions = [
        quick.node.create_subscription(kind, name, heard[name].append, LIVE)
        for name, kind in kinds.items()
    ]
    names = [subscription.topic_name for subscription in subscriptions]
    quick.until(lambda: all(quick.node.count_publishers(name) for name in names))
    quick.until(lambda: quick.impact() and all(len(heard[name]) > 40 for name in kinds))
    start = quick.impact()["start_time"]

    def since_start() -> dict[str, list[Any]]:
        return {name: [m for m in heard[name] if time_of(m) > start - 1e-6] for name in kinds}

    quick.until(lambda: all(len(messages) == 41 for messages in since_start().values()))
    scenes, heard = heard["scene"], since_start()
    assert not any(removes_all(scene) for scene in scenes[-82:])  # twice the same setup
    assert quick.set(**{"impact.surface": "incline_45"}) == ""
    quick.impact()
    quick.until(lambda: {"surface"} <= {marker.ns for marker in scenes[-1].markers})
    assert sum(removes_all(scene) for scene in scenes[-82:]) == 1
    for subscription in subscriptions:
        quick.node.destroy_subscription(subscription)

    # The drop before set the surface of its headform, which stays.
    worn = {"head.surface": QUICK["head.surface"]}
    record = simulate(ImpactSetup(duration=0.02, overrides=worn))
    every = slice(None, None, 10)
    for messages in heard.values():
        assert np.allclose([time_of(m) for m in messages], start + record.time[every], atol=1e-8)
    assert {m.header.frame_id for m in heard["head/acceleration"]} == {"world"}
    assert {m.header.frame_id for m in heard["head/imu"]} == {"head"}
    linear = [vector(m.accel.linear) for m in heard["head/acceleration"]]
    assert np.array_equal(linear, record.head_acceleration[every])
    force = [vector(m.wrench.force) for m in heard["helmet/ground_contact"]]
    assert np.array_equal(force, record.ground_force[every])
    # Specific force: what an accelerometer in the head reads, so g upwards at rest.
    turn = Rotation.from_quat(record.head_orientation[every])
    specific = turn.inv().apply(record.head_acceleration[every] + [0.0, 0.0, 9.80665])
    measured = [vector(m.linear_acceleration) for m in heard["head/imu"]]
    assert np.allclose(measured, specific, rtol=1e-12, atol=1e-9)
    joints = heard["joint_states"][7]
    assert tuple(joints.name) == record.joint_names
    assert np.array_equal(joints.position, record.joint_positions[70])
    markers = {marker.ns: marker for marker in heard["scene"][0].markers}
    assert {"ground", "head", "helmet"} <= set(markers)
    head = markers["head"].pose.position
    assert vector(head) == pytest.approx(record.head_position[0], abs=1e-9)


def removes_all(scene: Any) -> bool:
    return [marker.action for marker in scene.markers] == [Marker.DELETEALL]


def time_of(message: Any) -> float:
    header = message.markers[0].header if isinstance(message, MarkerArray) else message.header
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)


def vector(message: Any) -> list[float]:
    return [message.x, message.y, message.z]


def test_without_any_reader_an_impact_runs_all_the_same(rig: Rig) -> None:
    rig.start("simulation", "-r", "__ns:=/alone", name="alone", sim__duration=0.02)
    answer = rig.call("/alone/simulation/run_impact")
    assert answer.success and json.loads(answer.message)["samples"] == 401


class Doctored:
    """Sends blocks of one impact to an evaluator of its own, as the test wants them."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        rig.start("evaluator", "-r", "__ns:=/doctored", name="doctored")
        self.publisher = rig.node.create_publisher(
            Float64MultiArray, "/doctored/impact/samples", SAMPLES_WRITER
        )
        self.arrays: dict[str, Any] = {}
        rig.node.create_subscription(
            DiagnosticArray, "/doctored/evaluation/criteria", self._judged, SAMPLES_READER
        )
        rig.until(self.publisher.get_subscription_count)
        rig.until(lambda: rig.node.count_publishers("/doctored/evaluation/criteria"))
        setup = ImpactSetup(rig="headform", duration=0.02)
        self.record = simulate(setup)
        data = to_block(self.record)
        labels = tuple(block_labels(self.record.joint_names))
        self.blocks = [
            Block("", i, len(data), 1.0, labels, data[i : i + 50], setup.described())
            for i in range(0, len(data), 50)
        ]

    def _judged(self, message: Any) -> None:
        self.arrays[message.status[0].hardware_id] = message

    def send(self, impact_id: str, order: list[int]) -> None:
        from dataclasses import replace

        for i in order:
            self.publisher.publish(samples.to_message(replace(self.blocks[i], impact_id=impact_id)))

    def verdict(self, impact_id: str) -> Any:
        return to_evaluation(self.rig.until(lambda: self.arrays.get(impact_id)))[1]


def test_missing_or_disordered_blocks_give_incomplete_and_never_a_number(rig: Rig) -> None:
    doctored = Doctored(rig)
    whole = list(range(len(doctored.blocks)))
    swapped = [0, 2, 1, *whole[3:]]
    cases = {"gap": [0, *whole[2:]], "swapped": swapped, "late": whole[1:], "twice": [0, *whole]}
    for name, order in cases.items():
        doctored.send(name, order)
        with pytest.raises(NodeError, match="incomplete"):
            doctored.verdict(name)
        assert not doctored.arrays[name].status[0].values
    doctored.send("cut", whole[:-1])
    doctored.send("whole", whole)
    with pytest.raises(NodeError, match="incomplete: followed by impact whole"):
        doctored.verdict("cut")
    assert doctored.verdict("whole") == evaluate(doctored.record)
