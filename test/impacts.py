"""Impacts one like the other, as they arrive at a recorder."""

from __future__ import annotations

from pathlib import Path

from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.mcap_log.blocks import Assembled, Block
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.diagnostics import from_evaluation
from helmet_sim_ros.nodes.log_session import LogSession
from helmet_sim_ros.nodes.recorder_config import RecorderConfig

SETUP = ImpactSetup(rig="headform", duration=1e-3, time_step=1e-4)
#: From the start of one impact to that of the next [s].
SPACING = 0.1


class Impacts:
    """The samples and criteria of :data:`SETUP`, under as many names as wanted."""

    def __init__(self) -> None:
        impact = Impact(SETUP)
        impact.advance(impact.total)
        described = SETUP.described()
        self.digest = setup_digest(described)
        self.record, self.evaluation = impact.record(), evaluate(impact.record())
        self._impact, self._described = impact, described

    def block(self, number: int) -> Block:
        """All samples of an impact."""
        total = self._impact.total
        return Block(
            f"test-{number}", 0, total, 1.0 + number * SPACING, tuple(self._impact.labels),
            self._impact.block(0, total), setup=self._described, setup_digest=self.digest,
            model=self._impact.model_xml(),
        )  # fmt: skip

    def message(self, number: int) -> Float64MultiArray:
        """The same as message."""
        return samples.to_message(self.block(number))

    def write(self, session: LogSession, number: int) -> None:
        """One impact with its criteria into a log; it is on disk when this returns."""
        block = self.block(number)
        name, start, total = block.impact_id, block.start_time, block.total
        session.add(block, serialize_message(samples.to_message(block)))
        session.end_impact(Assembled(name, start, total, self.record))
        time_ns = round((start + float(self.record.time[-1])) * 1e9)
        session.add_criteria(from_evaluation(self.evaluation, name, time_ns, self.digest))


def session(path: Path) -> LogSession:
    """A new log."""
    return LogSession(path, RecorderConfig(), lambda topic: "/" + topic.lstrip("/"))
