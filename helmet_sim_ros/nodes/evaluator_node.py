"""The evaluator node: complete sample blocks in, criteria and head strikes out."""

from __future__ import annotations

import json
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from pydantic import Field
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from helmet_sim_ros.biomech.evaluation import Evaluation, evaluate
from helmet_sim_ros.biomech.record import ImpactRecord, is_fall
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, load_standard
from helmet_sim_ros.errors import HelmetSimError, IncompleteError, NodeError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST, setup_digest
from helmet_sim_ros.mcap_log.strikes import JudgedStrike
from helmet_sim_ros.nodes import diagnostics, samples
from helmet_sim_ros.nodes.conversion import nanoseconds
from helmet_sim_ros.nodes.outgoing import Outgoing
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS, Parameters
from helmet_sim_ros.nodes.process import WALL, answering, run_node
from helmet_sim_ros.nodes.qos import CRITERIA, CRITERIA_IN_FLIGHT, SAMPLES_READER, SERVICE
from helmet_sim_ros.schema import Config, leaves

TOPIC = "evaluation/criteria"
STRIKES = "evaluation/strikes"

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
    """Publishes ``evaluation/criteria`` for every impact and ``evaluation/strikes`` for every fall,
    and why, where there are none."""

    def __init__(self) -> None:
        super().__init__("evaluator", **NODE_OPTIONS)
        self._settings = Parameters(self, leaves(EvaluatorConfig), _configuration)
        self._assembler = Assembler()
        self._last: dict[str, Any] | None = None
        self._outgoing = {
            topic: Outgoing(
                self, self.create_publisher(DiagnosticArray, topic, CRITERIA), CRITERIA_IN_FLIGHT
            )
            for topic in (TOPIC, STRIKES)
        }
        self.create_service(Trigger, "~/last_result", self._last_result, qos_profile=SERVICE)
        # A group of its own: no block is looked at while criteria wait for their readers.
        self.create_subscription(
            Float64MultiArray, samples.TOPIC, self._receive, SAMPLES_READER,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )  # fmt: skip
        self.create_timer(WATCH_PERIOD, self._watch, clock=WALL)

    async def _receive(self, message: Float64MultiArray) -> None:
        try:
            block = samples.from_message(message)
        except IncompleteError as error:
            self.get_logger().error(f"{samples.TOPIC}: {error}")
            return
        for impact in self._assembler.feed(block):
            await self._judge(impact)

    async def _watch(self) -> None:
        if self._assembler.pending and not self.count_publishers(samples.TOPIC):
            for impact in self._assembler.abandon("the simulation is gone"):
                await self._judge(impact)

    async def _judge(self, impact: Assembled) -> None:
        end = 0.0 if impact.record is None else float(impact.record.time[-1])
        time_ns = nanoseconds(impact.start_time, end)
        result, strikes, problem = self._evaluated(impact)
        digest = _digest(impact)
        if result is not None:
            array = diagnostics.from_evaluation(result, impact.impact_id, time_ns, digest)
        elif strikes is not None:
            array = diagnostics.from_strikes(strikes, impact.impact_id, time_ns, digest)
        else:
            self.get_logger().warning(problem)
            array = diagnostics.from_problem(problem, impact.impact_id, time_ns)
        self._last = {
            "impact_id": impact.impact_id,
            SETUP_DIGEST: digest,
            "start_time": impact.start_time,
            "problem": problem,
            "evaluation": result,
            "strikes": strikes,
        }
        await self._outgoing[STRIKES if is_fall(impact.setup) else TOPIC].send(array)

    def _evaluated(
        self, impact: Assembled
    ) -> tuple[Evaluation | None, list[JudgedStrike] | None, str]:
        """Criteria of an impact, or head strikes of a fall, or why there are none."""
        if impact.record is None:
            return None, None, impact.problem
        standard = self._settings.value.standard or None
        try:
            if is_fall(impact.setup):
                return None, judged_strikes(impact.record, standard), ""
            return evaluate(impact.record, standard), None, ""
        except HelmetSimError as error:
            return None, None, f"failed: {error}"
        except Exception as error:
            return None, None, f"failed: unexpected {type(error).__name__}: {error}"

    @answering
    def _last_result(self, request: Any) -> str:
        if self._last is None:
            raise NodeError("no impact has been seen yet")
        text = json.dumps(self._last, default=lambda found: found.as_dict())
        if self._last["problem"]:
            raise NodeError(text)
        return text


def judged_strikes(record: ImpactRecord, standard: str | None = None) -> list[JudgedStrike]:
    """The head strikes of a fall, each judged by a standard over its own window.

    Raises:
        SetupError, PulseError: see :func:`head_strikes` and :func:`evaluate`.
    """
    from helmet_sim_ros.model.fall.strikes import head_strikes  # loads what only falls need

    found = head_strikes(record)
    return [
        JudgedStrike(
            row, strike.evaluation if standard is None else evaluate(strike.record, standard)
        )
        for row, strike in zip(found.rows(), found, strict=True)
    ]


def _digest(impact: Assembled) -> str:
    """Digest of the setup that is judged; empty for one that has none."""
    try:
        return "" if impact.record is None else setup_digest(impact.record.setup)
    except (TypeError, ValueError, RecursionError):  # not from a simulation of ours
        return ""


def _configuration(values: dict[str, Any]) -> EvaluatorConfig:
    config = EvaluatorConfig(**values)
    load_standard(config.standard or DEFAULT_STANDARD)
    return config


def main(args: list[str] | None = None) -> int:
    """Entry point of ``evaluator_node``."""
    return run_node("evaluator", EvaluatorNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
