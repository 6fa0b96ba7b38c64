"""The evaluator node: complete sample blocks in, criteria out."""

from __future__ import annotations

import json
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from pydantic import Field
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from helmet_sim_ros.biomech.evaluation import Evaluation, evaluate
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, load_standard
from helmet_sim_ros.errors import HelmetSimError, IncompleteError, NodeError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler
from helmet_sim_ros.nodes import diagnostics, samples
from helmet_sim_ros.nodes.conversion import nanoseconds
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS, Parameters
from helmet_sim_ros.nodes.process import WALL, answering, run_node
from helmet_sim_ros.nodes.qos import CRITERIA, SAMPLES_READER
from helmet_sim_ros.schema import Config, leaves

TOPIC = "evaluation/criteria"

#: How often the node looks whether the sender of an unfinished impact is still there [s].
WATCH_PERIOD = 0.5


class EvaluatorConfig(Config):
    """Parameters of the evaluator."""

    standard: str = Field(
        "",
        description="name in config/standards, or path to a YAML file; empty: peak and HIC limits "
        "of ECE R22.05, whatever the impact conditions",
    )


class EvaluatorNode(Node):
    """Publishes ``evaluation/criteria`` for every impact, and why, where there are none."""

    def __init__(self) -> None:
        super().__init__("evaluator", **NODE_OPTIONS)
        self._settings = Parameters(self, leaves(EvaluatorConfig), _configuration)
        self._assembler = Assembler()
        self._last: dict[str, Any] | None = None
        self._publisher = self.create_publisher(DiagnosticArray, TOPIC, CRITERIA)
        self.create_service(Trigger, "~/last_result", self._last_result)
        self.create_subscription(Float64MultiArray, samples.TOPIC, self._receive, SAMPLES_READER)
        self.create_timer(WATCH_PERIOD, self._watch, clock=WALL)

    def _receive(self, message: Float64MultiArray) -> None:
        try:
            block = samples.from_message(message)
        except IncompleteError as error:
            self.get_logger().error(f"{samples.TOPIC}: {error}")
            return
        for impact in self._assembler.feed(block):
            self._judge(impact)

    def _watch(self) -> None:
        if self._assembler.pending and not self.count_publishers(samples.TOPIC):
            for impact in self._assembler.abandon("the simulation is gone"):
                self._judge(impact)

    def _judge(self, impact: Assembled) -> None:
        end = 0.0 if impact.record is None else float(impact.record.time[-1])
        time_ns = nanoseconds(impact.start_time, end)
        result, problem = self._evaluated(impact)
        if result is not None:
            array = diagnostics.from_evaluation(result, impact.impact_id, time_ns)
        else:
            self.get_logger().warning(problem)
            array = diagnostics.from_problem(problem, impact.impact_id, time_ns)
        self._publisher.publish(array)
        self._last = {
            "impact_id": impact.impact_id,
            "start_time": impact.start_time,
            "problem": problem,
            "evaluation": result.as_dict() if result else None,
        }

    def _evaluated(self, impact: Assembled) -> tuple[Evaluation | None, str]:
        if impact.record is None:
            return None, impact.problem
        try:
            return evaluate(impact.record, self._settings.value.standard or None), ""
        except HelmetSimError as error:
            return None, f"failed: {error}"
        except Exception as error:
            return None, f"failed: unexpected {type(error).__name__}: {error}"

    @answering
    def _last_result(self, request: Any) -> str:
        if self._last is None:
            raise NodeError("no impact has been seen yet")
        text = json.dumps(self._last)
        if self._last["problem"]:
            raise NodeError(text)
        return text


def _configuration(values: dict[str, Any]) -> EvaluatorConfig:
    config = EvaluatorConfig(**values)
    load_standard(config.standard or DEFAULT_STANDARD)
    return config


def main(args: list[str] | None = None) -> int:
    """Entry point of ``evaluator_node``."""
    return run_node("evaluator", EvaluatorNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
