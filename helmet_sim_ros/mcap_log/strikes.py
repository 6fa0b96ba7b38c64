"""Head strikes of falls as they stand in a log: ``diagnostic_msgs/DiagnosticArray``, one status
each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import LogError, PulseError
from helmet_sim_ros.mcap_log.criteria import first_status
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST

#: Name of the only status of a fall in which the head touched nothing, and what it says.
NO_CONTACT = "no_head_contact"
NOTHING = "no head contact"
#: Value of a status that holds all criteria of the strike, as JSON.
EVALUATION = "evaluation"


@dataclass(frozen=True)
class JudgedStrike:
    """One head strike of a fall as it was judged.

    Attributes:
        row: what stands in a table of strikes, by name: time [s], what is struck, velocities...
        evaluation: all criteria over the window of the strike.
    """

    row: Mapping[str, object]
    evaluation: Evaluation

    def as_dict(self) -> dict[str, object]:
        """It as plain data."""
        return dict(self.row) | {EVALUATION: self.evaluation.as_dict()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> JudgedStrike:
        """The inverse of :meth:`as_dict`.

        Raises:
            PulseError: no evaluation of the right form.
        """
        row = {name: value for name, value in data.items() if name != EVALUATION}
        return cls(row, Evaluation.from_dict(data.get(EVALUATION, {})))


def strikes_of(array: Any) -> tuple[str, tuple[JudgedStrike, ...]]:
    """Fall and head strikes of a message; without head contact none.

    Args:
        array: a ``DiagnosticArray``, of rclpy or decoded from a log.

    Raises:
        LogError: the fall could not be judged (the reason), or not such a message.
    """
    first = first_status(array, "head strikes")
    if first.name == NO_CONTACT:
        return first.hardware_id, ()
    try:
        strikes = [
            JudgedStrike.from_dict(
                {p.key: json.loads(p.value) for p in status.values if p.key != SETUP_DIGEST}
            )
            for status in array.status
        ]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, PulseError) as error:
        raise LogError(f"not head strikes of a fall: {error}") from error
    return first.hardware_id, tuple(strikes)
