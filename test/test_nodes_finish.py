"""``recorder/finish`` takes all that has arrived, also what has not had its turn yet."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from impacts import SPACING, Impacts
from node_processes import DOMAIN
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.nodes import recorder_node, samples
from helmet_sim_ros.nodes.diagnostics import from_evaluation, from_problem
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.nodes.log_session import CRITERIA_TOPIC
from helmet_sim_ros.nodes.qos import CRITERIA, SAMPLES_WRITER
from helmet_sim_ros.nodes.recorder_node import RecorderNode

COUNT = 12


@pytest.fixture
def served(tmp_path: Path) -> Iterator[list[SingleThreadedExecutor]]:
    """A client and a recorder, each served on its own."""
    prepare_environment(DOMAIN)
    rclpy.init(args=["--ros-args", "-p", f"output_dir:={tmp_path}"])
    executors = []
    for make in (lambda: rclpy.create_node("client"), RecorderNode):
        executors.append(SingleThreadedExecutor())
        executors[-1].add_node(make())
    yield executors
    for executor in executors:
        (node,) = executor.get_nodes()
        node.destroy_node()
    rclpy.try_shutdown()


def send(executors: list[SingleThreadedExecutor], count: int) -> None:
    """Impacts and their criteria that arrive at the recorder, and have no turn there yet."""
    impacts = Impacts()
    client: Node = executors[0].get_nodes()[0]
    sender = client.create_publisher(Float64MultiArray, samples.TOPIC, SAMPLES_WRITER)
    judge = client.create_publisher(DiagnosticArray, CRITERIA_TOPIC, CRITERIA)
    until_matched(sender, judge)
    for number in range(count):
        sender.publish(impacts.message(number))
        time_ns = round((1.0 + number * SPACING + impacts.record.time[-1]) * 1e9)
        judge.publish(
            from_evaluation(impacts.evaluation, f"test-{number}", time_ns, impacts.digest)
        )
    for publisher in (sender, judge):
        assert publisher.wait_for_all_acked(Duration(seconds=30.0))


def until_matched(*publishers: Publisher) -> None:
    """Until each of them has a reader."""
    deadline = time.monotonic() + 30.0
    while not all(publisher.get_subscription_count() for publisher in publishers):
        assert time.monotonic() < deadline
        time.sleep(0.01)  # the middleware finds them in a thread of its own


def answered(executors: list[SingleThreadedExecutor], answer: Future) -> Trigger.Response:
    """The answer, both sides being served until it comes."""
    deadline = time.monotonic() + 30.0
    while not answer.done():
        assert time.monotonic() < deadline
        for executor in executors:
            executor.spin_once(timeout_sec=0.01)
    return answer.result()


def check(answer: Trigger.Response, count: int) -> None:
    assert answer.success, answer.message
    log = open_log(json.loads(answer.message)["path"])
    assert [impact.impact_id for impact in log.impacts] == [f"test-{i}" for i in range(count)]
    assert all(impact.evaluation for impact in log.impacts)


def test_a_log_is_finished_with_every_impact_that_was_acknowledged(
    served: list[SingleThreadedExecutor],
) -> None:
    finish = served[0].get_nodes()[0].create_client(Trigger, "recorder/finish")
    assert finish.wait_for_service(30.0)
    send(served, COUNT)
    check(answered(served, finish.call_async(Trigger.Request())), COUNT)


def test_the_first_impact_may_arrive_just_before_the_call(
    served: list[SingleThreadedExecutor],
) -> None:
    """As a task, ``~/finish`` has its turn before samples, as where a wait saw them too late."""
    (recorder,) = served[1].get_nodes()
    send(served, 1)
    check(answered(served, served[1].create_task(recorder._finish, None, Trigger.Response())), 1)


def test_an_impact_that_a_stranger_had_ended_has_the_one_verdict_that_was_told(
    served: list[SingleThreadedExecutor], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The evaluator met the stranger's block in the middle of the impact, and found it incomplete
    once; the recorder met it before the first sample, and waited in vain for another verdict."""
    monkeypatch.setattr(recorder_node, "CRITERIA_TIMEOUT", 0.5)
    impacts, client = Impacts(), served[0].get_nodes()[0]
    send(served, 1)
    sender = client.create_publisher(Float64MultiArray, samples.TOPIC, SAMPLES_WRITER)
    judge = client.create_publisher(DiagnosticArray, CRITERIA_TOPIC, CRITERIA)
    until_matched(sender, judge)
    whole = impacts.block(1)
    forged = replace(
        whole, first=2, data=whole.data[2:5], setup=None, setup_digest=None, model=None
    )
    sender.publish(samples.to_message(forged))
    judge.publish(from_problem("incomplete: of two senders (impact test-1)", "test-1", 10**9))
    assert judge.wait_for_all_acked(Duration(seconds=30.0))
    (recorder,) = served[1].get_nodes()
    deadline = time.monotonic() + 30.0
    while recorder._last["impact_id"] != "test-1":
        assert time.monotonic() < deadline
        served[1].spin_once(timeout_sec=0.01)
    sender.publish(samples.to_message(replace(forged, impact_id="stranger-1")))
    sender.publish(impacts.message(1))
    finish = client.create_client(Trigger, "recorder/finish")
    answer = answered(served, finish.call_async(Trigger.Request()))
    assert answer.success, answer.message
    first, second = open_log(json.loads(answer.message)["path"]).impacts
    assert first.logged == impacts.evaluation
    assert second.impact_id == "test-1" and same_samples(second.record, impacts.record)
    with pytest.raises(LogError, match="incomplete: of two senders"):
        _ = second.logged


def test_without_any_impact_there_is_no_log_to_finish(
    served: list[SingleThreadedExecutor],
) -> None:
    finish = served[0].get_nodes()[0].create_client(Trigger, "recorder/finish")
    assert finish.wait_for_service(30.0)
    answer = answered(served, finish.call_async(Trigger.Request()))
    assert not answer.success and answer.message == "no log is open"
