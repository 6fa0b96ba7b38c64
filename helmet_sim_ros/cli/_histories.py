"""Complete samples of impacts of a sweep, as a log that ``helmet-sim review`` reads. Needs ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from rclpy.serialization import serialize_message

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.mcap_log.blocks import Assembled, Block
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.fall.setup import Fall, setup_or_fall
from helmet_sim_ros.model.fall.strikes import head_strikes
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.nodes import diagnostics, samples
from helmet_sim_ros.nodes.conversion import nanoseconds
from helmet_sim_ros.nodes.log_session import LogSession
from helmet_sim_ros.nodes.recorder_config import RecorderConfig
from helmet_sim_ros.study.falls.measures import judge_fall
from helmet_sim_ros.study.sweeps.study import Row
from helmet_sim_ros.study.sweeps.sweep import SweepResult

FILE = "histories.mcap"
#: Impacts start at whole multiples of this in the log [s]; the first one after one second, because
#: ROS takes 0 for "no time yet".
SPACING = 0.1
BEGIN = 1.0


def write_histories(
    result: SweepResult, progress: Callable[[int, int, int], None]
) -> tuple[Path, list[str]]:
    """Simulate the impacts that the study wants kept once more, and log them.

    An impact gives the same samples each time, so nothing but criteria needs to be kept or sent
    while the sweep runs.

    Returns:
        The log, and a line for each impact whose criterion is not what the sweep had: computed by
        workers on another kind of processor.

    Raises:
        LogError: the log cannot be written.
    """
    wanted = result.study.file.histories
    if wanted is None:
        raise ValueError("the study keeps no histories")
    rows: Sequence[Row] = result.worst(wanted.by, wanted.worst)
    path = result.folder / FILE
    for old in (path, path.with_name(path.name + ".part")):
        old.unlink(missing_ok=True)
    session = LogSession(path, RecorderConfig(scenario_name=result.study.name), _absolute)
    differing, unit = [], result.study.unit[:-1]
    start = BEGIN
    for done, row in enumerate(rows):
        progress(done, len(rows), 0)
        kept = result.table[wanted.by][row.index].as_py()
        again, start = _add(session, result, row, wanted.by, start)
        if again != kept:
            differing.append(f"{unit} {row.index}: {wanted.by} is {again!r} here, was {kept!r}")
    progress(len(rows), len(rows), 0)
    return session.close(), differing


def _absolute(topic: str) -> str:
    return "/" + topic.lstrip("/")


def log_impacts(path: Path, name: str, impacts: Sequence[tuple[str, ImpactSetup]]) -> None:
    """Simulate impacts and log their samples and criteria.

    Args:
        path: of a log that is not there yet.
        name: what the log says they belong to.
        impacts: identity and setup of each.

    Raises:
        LogError: the log cannot be written.
        DivergedError: an impact leaves physics.
    """
    session = LogSession(path, RecorderConfig(scenario_name=name), _absolute)
    start = BEGIN
    for identity, setup in impacts:
        _, start = _log(session, identity, setup, None, start)
    session.close()


def _add(
    session: LogSession, result: SweepResult, row: Row, criterion: str, start: float
) -> tuple[float, float]:
    """Log one impact; its criterion, and when the next one may start."""
    setup, standard = setup_or_fall(row.values), result.study.file.standard
    name = f"{result.study.name}-{row.index:06d}"
    if isinstance(setup, Fall):  # its worst strike is logged, as the impact that it is
        record = simulate(setup)
        _, (again,), _ = judge_fall(record, standard, (criterion,))
        worst = head_strikes(record).worst
        if worst is None or again is None:
            return math.nan, start
        _, start = _log(session, name, worst.setup(), standard, start)
        return again, start
    evaluation, start = _log(session, name, setup, standard, start)
    return evaluation.criteria[criterion].value, start


def _log(
    session: LogSession, name: str, setup: ImpactSetup, standard: str | None, start: float
) -> tuple[Evaluation, float]:
    """Log one impact; its evaluation, and when the next one may start."""
    impact = Impact(setup)
    impact.run()
    record = impact.record()
    described = setup.described()
    digest = setup_digest(described)
    block = Block(
        name, 0, impact.total, start, tuple(impact.labels), impact.block(0, impact.total),
        setup=described, setup_digest=digest, model=impact.model_xml(),
    )  # fmt: skip
    session.add(block, serialize_message(samples.to_message(block)))
    session.end_impact(Assembled(name, start, impact.total, record))
    evaluation = evaluate(record, standard)
    end = float(record.time[-1])
    time_ns = nanoseconds(start, end)
    session.add_criteria(diagnostics.from_evaluation(evaluation, name, time_ns, digest))
    return evaluation, (math.floor((start + end) / SPACING) + 1) * SPACING
