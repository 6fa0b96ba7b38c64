"""Logs for tests: written by the recorder's own session, or as ros2 bag would."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from helmet_sim_ros import ImpactRecord, ImpactSetup, evaluate
from helmet_sim_ros.mcap_log.blocks import Assembled, Block
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.diagnostics import from_evaluation
from helmet_sim_ros.nodes.log_session import LogSession
from helmet_sim_ros.nodes.recorder_config import RecorderConfig

ROWS = 100
FIRST_START, SPACING = 1.1, 0.1


def simulated(setup: ImpactSetup) -> tuple[Impact, ImpactRecord]:
    impact = Impact(setup)
    impact.advance(impact.total)
    return impact, impact.record()


def blocks(impact: Impact, impact_id: str, start_time: float) -> Iterable[Block]:
    for first in range(0, impact.total, ROWS):
        last = min(first + ROWS, impact.total)
        yield Block(
            impact_id, first, impact.total, start_time, tuple(impact.labels),
            impact.block(first, last),
            setup=impact.setup.described() if first == 0 else None,
            model=impact.model_xml() if first == 0 else None,
            extras=dict(impact.record().extras) if last == impact.total else None,
        )  # fmt: skip


def add_impact(
    session: LogSession, impact: Impact, impact_id: str, start_time: float, judged: bool = True
) -> None:
    for block in blocks(impact, impact_id, start_time):
        session.add(block, serialize_message(samples.to_message(block)))
    record = impact.record()
    session.end_impact(Assembled(impact_id, start_time, impact.total, record))
    if judged:
        session.add_criteria(from_evaluation(evaluate(record), impact_id, session.end_ns))


def session(path: Path, scenario: str = "") -> LogSession:
    config = RecorderConfig(scenario_name="test", scenario_text=scenario)
    return LogSession(path, config, lambda t: "/" + t.lstrip("/"))


def write_log(path: Path, setups: Sequence[ImpactSetup], judged: bool = True) -> list[ImpactRecord]:
    """A log of the recorder with impacts ``test-0``, ``test-1``, ...; the true records."""
    log, records = session(path), []
    for number, setup in enumerate(setups):
        impact, record = simulated(setup)
        add_impact(log, impact, f"test-{number}", FIRST_START + number * SPACING, judged)
        records.append(record)
    log.close()
    return records


def write_bag(
    folder: Path, setups: Sequence[ImpactSetup], wall_clock: bool = True, namespace: str = ""
) -> list[ImpactRecord]:
    """What ``ros2 bag record -s mcap`` makes of samples and criteria, by an independent writer."""
    store = get_typestore(Stores.ROS2_JAZZY)
    records = []
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {
            name: bag.add_connection(namespace + topic, kind, typestore=store)
            for name, topic, kind in (
                ("samples", "/impact/samples", "std_msgs/msg/Float64MultiArray"),
                ("criteria", "/evaluation/criteria", "diagnostic_msgs/msg/DiagnosticArray"),
            )
        }
        now = time.time_ns() if wall_clock else 10**9
        for number, setup in enumerate(setups):
            impact, record = simulated(setup)
            impact_id = f"bag-{number}"
            for block in blocks(impact, impact_id, FIRST_START + number * SPACING):
                now += 1_000_000
                bag.write(topics["samples"], now, serialize_message(samples.to_message(block)))
            message = from_evaluation(evaluate(record), impact_id, now)
            bag.write(topics["criteria"], now, serialize_message(message))
            records.append(record)
    return records
