"""Criteria and head strikes as ``diagnostic_msgs``, and back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.errors import LogError, NodeError
from helmet_sim_ros.mcap_log.criteria import NOT_EVALUATED, WHOLE, evaluation_of
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST
from helmet_sim_ros.mcap_log.strikes import NO_CONTACT, NOTHING, JudgedStrike, strikes_of
from helmet_sim_ros.nodes.conversion import stamp

#: From this share of its limit on, a criterion that passes is a warning.
CLOSE = 0.9


def from_evaluation(
    evaluation: Evaluation, impact_id: str, time_ns: int, digest: str = ""
) -> DiagnosticArray:
    """One status per criterion; ``hardware_id`` is the impact.

    The values are the fields of :class:`Criterion`, the window as ``t1`` and ``t2``; numbers read
    back bit for bit. What belongs to the whole evaluation is in the first status, also the digest
    of the setup that was judged.
    """
    whole = evaluation.as_dict()
    criteria = whole.pop("criteria")
    statuses: list[DiagnosticStatus] = []
    for criterion in evaluation.criteria.values():
        values = criteria[criterion.name]
        values["t1"], values["t2"] = values.pop("window") or (None, None)
        del values["name"]
        if not statuses:
            values |= {WHOLE + key: value for key, value in whole.items()}
            values[SETUP_DIGEST] = digest
        statuses.append(
            DiagnosticStatus(
                level=_level(criterion),
                name=criterion.name,
                message=_message(criterion),
                hardware_id=impact_id,
                values=_key_values(values),
            )
        )
    return _array(statuses, time_ns)


def from_strikes(
    strikes: Sequence[JudgedStrike], impact_id: str, time_ns: int, digest: str = ""
) -> DiagnosticArray:
    """One status per head strike of a fall; ``hardware_id`` is the fall.

    The values, all JSON, are a row of the table of strikes and, as ``evaluation``, all criteria;
    those of the first also hold the digest of the setup. No head contact is a result: one status.
    """
    statuses = [
        DiagnosticStatus(
            level=max(map(_level, strike.evaluation.criteria.values())),
            name=f"strike {number}",
            message=_strike_message(strike),
            hardware_id=impact_id,
            values=[KeyValue(key=k, value=_json(v)) for k, v in strike.as_dict().items()],
        )
        for number, strike in enumerate(strikes, 1)
    ]
    if not statuses:
        nothing = DiagnosticStatus(name=NO_CONTACT, message=NOTHING, hardware_id=impact_id)
        statuses.append(nothing)
    first = statuses[0]
    first.values = [*first.values, KeyValue(key=SETUP_DIGEST, value=digest)]
    return _array(statuses, time_ns)


def from_problem(problem: str, impact_id: str, time_ns: int) -> DiagnosticArray:
    """The answer for an impact without a result: an error, and no number."""
    status = DiagnosticStatus(
        level=DiagnosticStatus.ERROR, name=NOT_EVALUATED, message=problem, hardware_id=impact_id
    )
    return _array([status], time_ns)


def to_evaluation(array: Any) -> tuple[str, Evaluation]:
    """Impact id and evaluation of a message of :func:`from_evaluation`.

    Raises:
        NodeError: the impact could not be evaluated (the reason), or not such a message.
    """
    try:
        return evaluation_of(array)
    except LogError as error:
        raise NodeError(str(error)) from error


def to_strikes(array: Any) -> tuple[str, tuple[JudgedStrike, ...]]:
    """Fall and strikes of a message of :func:`from_strikes`.

    Raises:
        NodeError: the fall could not be judged (the reason), or not such a message.
    """
    try:
        return strikes_of(array)
    except LogError as error:
        raise NodeError(str(error)) from error


def _level(criterion: Criterion) -> bytes:
    level: bytes = DiagnosticStatus.OK
    if criterion.verdict == "fail":
        level = DiagnosticStatus.ERROR
    elif criterion.limit is not None and criterion.value >= CLOSE * criterion.limit:
        level = DiagnosticStatus.WARN
    return level


def _message(criterion: Criterion) -> str:
    unit = "" if criterion.unit == "-" else f" {criterion.unit}"
    text = f"{criterion.value:.4g}{unit}"
    if criterion.limit is not None:
        text += f", limit {criterion.limit:.4g}{unit}: {criterion.verdict}"
    return text


def _strike_message(strike: JudgedStrike) -> str:
    row, evaluation = strike.row, strike.evaluation
    return (
        f"{row['time']:.3f} s, {row['zone']} on {row['struck']}: {row['normal_velocity']:.1f} m/s "
        f"into it, {row['tangential_velocity']:.1f} m/s along it, "
        f"{evaluation.peak_g.value:.0f} g: {evaluation.verdict}"
    )


def _json(value: object) -> str:
    return json.dumps(value, allow_nan=False)


def _key_values(values: dict[str, Any]) -> list[KeyValue]:
    return [
        KeyValue(key=key, value=value if isinstance(value, str) else _json(value))
        for key, value in values.items()
        if value not in (None, "")
    ]


def _array(statuses: list[DiagnosticStatus], time_ns: int) -> DiagnosticArray:
    array = DiagnosticArray(status=statuses)
    array.header.stamp = stamp(time_ns)
    array.header.frame_id = "head"
    return array
