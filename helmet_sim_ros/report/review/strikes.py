"""Head strikes of logged falls, to be reviewed and shown as impacts are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import LogError, SetupError
from helmet_sim_ros.mcap_log import LoggedImpact
from helmet_sim_ros.mcap_log.strikes import JudgedStrike
from helmet_sim_ros.model.fall.strikes import HeadStrikes, Strike, head_strikes
from helmet_sim_ros.report.replay.scene import setup_of


@dataclass(frozen=True)
class LoggedStrike:
    """One head strike of a logged fall.

    Attributes:
        fall: of the log.
        number: of the strike, from 1.
        found: it, found in the logged samples.
        judged: it as logged; None: the log has no strikes of this fall.
    """

    fall: LoggedImpact
    number: int
    found: Strike
    judged: JudgedStrike | None

    @property
    def impact_id(self) -> str:
        """Identity of the fall, and the number."""
        return f"{self.fall.impact_id}, strike {self.number}"

    @property
    def start_time(self) -> float:
        """Simulation time of its window's first sample [s]."""
        return self.fall.start_time + float(self.record.time[0])

    @property
    def samples(self) -> int:
        """Number of samples of its window."""
        return len(self.record)

    @property
    def record(self) -> ImpactRecord:
        """The samples of its window, uniform."""
        return self.found.record

    @cached_property
    def setup(self) -> Mapping[str, Any]:
        """The fall's setup, and how the helmet is struck, by the names that an impact has."""
        return dict(self.fall.setup) | {
            "impact.direction": self.found.location.zone,
            "impact.normal_velocity": self.found.normal_velocity,
            "impact.tangential_velocity": self.found.tangential_velocity,
        }

    @property
    def model_hash(self) -> str:
        """That of the fall."""
        return self.fall.model_hash

    @property
    def model_problem(self) -> str:
        """That of the fall."""
        return self.fall.model_problem

    @property
    def logged(self) -> Evaluation | None:
        """Its criteria as they were logged."""
        return None if self.judged is None else self.judged.evaluation

    def evaluate(self, standard: str | None = None) -> Evaluation:
        """Its criteria computed from the logged samples."""
        return self.found.evaluation if standard is None else evaluate(self.record, standard)


def found_strikes(fall: LoggedImpact) -> HeadStrikes:
    """The head strikes in the samples of a logged fall, also where its helmet file is not on this
    machine; of an imported helmet after ``admit_helmets``.

    Raises:
        LogError: the samples are damaged, or this version does not know the setup.
    """
    record = fall.record
    try:
        known = replace(record, setup=setup_of(record)[0].described())
        return HeadStrikes(
            replace(strike, samples=replace(strike.samples, setup=record.setup))
            for strike in head_strikes(known)
        )
    except SetupError as error:
        raise LogError(f"fall {fall.impact_id}: {error}") from error


def beside_logged(
    fall: LoggedImpact, found: HeadStrikes, judged: Sequence[JudgedStrike]
) -> list[LoggedStrike]:
    """Head strikes as found, each beside what was logged of it."""
    return [
        LoggedStrike(fall, number, strike, judged[number - 1] if number <= len(judged) else None)
        for number, strike in enumerate(found, 1)
    ]
