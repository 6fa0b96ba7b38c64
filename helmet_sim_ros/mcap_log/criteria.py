"""Criteria as they stand in a log: ``diagnostic_msgs/DiagnosticArray``, one status each."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import LogError, PulseError
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST

#: Name of the only status of an impact that could not be evaluated.
NOT_EVALUATED = "not_evaluated"
#: Prefix, in the first status, of the values that belong to the whole evaluation.
WHOLE = "evaluation."

#: Values that are plain text; all others are JSON.
_TEXTS = {"name", "unit", "verdict", "note", "source"}
_TEXTS |= {WHOLE + f.name for f in fields(Evaluation) if f.type == "str"} | {WHOLE + "verdict"}


def first_status(array: Any, what: str) -> Any:
    """The first status of a ``DiagnosticArray`` with ``what``, which holds what belongs to all.

    Raises:
        LogError: there is none, or it says why nothing could be evaluated.
    """
    if not array.status:
        raise LogError(f"no {what} in this message")
    first = array.status[0]
    if first.name == NOT_EVALUATED:
        raise LogError(first.message)
    return first


def evaluation_of(array: Any) -> tuple[str, Evaluation]:
    """Impact id and evaluation of a message with criteria.

    Args:
        array: a ``DiagnosticArray``, of rclpy or decoded from a log.

    Raises:
        LogError: the impact could not be evaluated (the reason), or not such a message.
    """
    first = first_status(array, "criteria")
    try:
        data: dict[str, Any] = {"criteria": {}}
        for status in array.status:
            values = {
                pair.key: _parsed(pair.key, pair.value)
                for pair in status.values
                if pair.key != SETUP_DIGEST
            }
            data |= {
                key.removeprefix(WHOLE): values.pop(key)
                for key in list(values)
                if key.startswith(WHOLE)
            }
            t1, t2 = values.pop("t1", None), values.pop("t2", None)
            window = None if t1 is None else [t1, t2]
            data["criteria"][status.name] = values | {"name": status.name, "window": window}
        return first.hardware_id, Evaluation.from_dict(data)
    except (ValueError, TypeError, RecursionError, PulseError) as error:
        raise LogError(f"not criteria of an impact: {error}") from error


def digest_of(array: Any) -> str:
    """Digest of the setup that was judged (``setup_digest``); empty where there is none."""
    first = array.status[0].values if array.status else ()
    return next((str(pair.value) for pair in first if pair.key == SETUP_DIGEST), "")


def _parsed(key: str, value: str) -> Any:
    return value if key in _TEXTS else json.loads(value)
