"""Two logs side by side: paired impacts, and the differences of their criteria."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.histories import Chatter, Rating, channel_rating, chatter
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY
from helmet_sim_ros.biomech.result import Criterion
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact
from helmet_sim_ros.report.review.strikes import LoggedStrike
from helmet_sim_ros.report.review.summary import label

#: Channels whose histories are rated.
RATED = ("head_acceleration", "head_angular_velocity")

#: Setup values by which impacts of two logs belong together; helmet and rider may differ.
PAIRED_BY = (
    "impact.rig", "impact.direction", "impact.normal_velocity", "impact.tangential_velocity",
    "impact.tangential_heading_deg", "impact.body_angle_deg", "fall.preset", "fall.scene",
    "fall.speed", "fall.heading_deg", "fall.pitch_deg", "fall.roll_deg", "fall.height",
)  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """An impact in one log and its counterpart in another; None where there is none."""

    a: LoggedImpact | None
    b: LoggedImpact | None

    @property
    def label(self) -> str:
        """The impact in words."""
        impact = self.a or self.b
        return "" if impact is None else label(impact.setup)


@dataclass(frozen=True)
class Change:
    """One criterion in both logs.

    Attributes:
        name, unit: of the criterion.
        a, b: its values; None where a log does not give it.
        tolerance: largest relative difference that counts as none.
    """

    name: str
    unit: str
    a: float | None
    b: float | None
    tolerance: float

    @property
    def relative(self) -> float:
        """Difference over the larger amount [-]; infinite where one value is missing."""
        if self.a is None or self.b is None:
            return math.inf
        scale = max(abs(self.a), abs(self.b))
        return (self.b - self.a) / scale if scale > 0.0 else 0.0

    @property
    def differs(self) -> bool:
        """Whether the difference is above the tolerance."""
        return abs(self.relative) > self.tolerance


@dataclass(frozen=True)
class Likeness:
    """How alike the histories of a pair are.

    Attributes:
        ratings: of B against A by channel (ISO/TS 18571).
        chatter: of the head acceleration of A and of B.
        problem: why there is none of it, in words; else empty.
    """

    ratings: Mapping[str, Rating]
    chatter: tuple[Chatter, ...] = ()
    problem: str = ""


def likeness(pair: Pair) -> Likeness:
    """The histories of both impacts of a pair against each other; both are there."""
    assert pair.a is not None and pair.b is not None
    records = pair.a.record.uniform(), pair.b.record.uniform()
    try:
        return Likeness(
            {channel: channel_rating(*records, channel) for channel in RATED},
            tuple(chatter(r.head_acceleration / STANDARD_GRAVITY, r.time_step) for r in records),
        )
    except PulseError as error:
        return Likeness({}, problem=str(error))


def paired(first: ImpactLog, second: ImpactLog) -> list[Pair]:
    """Impacts of two logs with the same direction, speeds and pose, in the order of the first.

    Several impacts of one kind pair in their order.
    """
    waiting: dict[tuple[object, ...], list[LoggedImpact]] = {}
    for impact in second:
        waiting.setdefault(pairing_key(impact), []).append(impact)
    pairs = []
    for impact in first:
        same = waiting.get(pairing_key(impact), [])
        pairs.append(Pair(impact, same.pop(0) if same else None))
    return pairs + [Pair(None, impact) for rest in waiting.values() for impact in rest]


def changes(
    pair: Pair, names: Sequence[str] | None, tolerance: float, standard: str | None = None
) -> Iterator[Change]:
    """The criteria of a pair, computed from the samples of both logs by this program.

    Args:
        pair: both impacts are there.
        names: of the criteria; None: all.
        tolerance: relative.
        standard: as for :func:`helmet_sim_ros.evaluate`.

    Raises:
        PulseError: an unknown criterion, or no criteria can be computed.
    """
    assert pair.a is not None and pair.b is not None
    a, b = (impact.evaluate(standard).criteria for impact in (pair.a, pair.b))
    wanted = list(dict.fromkeys([*a, *b])) if names is None else names
    for name in wanted:
        if name not in a and name not in b:
            raise PulseError(f"{name}: no such criterion; known: {', '.join(a)}")
        unit = (a.get(name) or b[name]).unit
        yield Change(name, unit, _value(a, name), _value(b, name), tolerance)


def pairing_key(impact: LoggedImpact | LoggedStrike) -> tuple[object, ...]:
    """What impacts of several logs that belong together share."""
    values = [impact.setup.get(name) for name in PAIRED_BY]
    return tuple(round(v, 9) if isinstance(v, float | np.floating) else v for v in values)


def _value(criteria: Mapping[str, Criterion], name: str) -> float | None:
    return float(criteria[name].value) if name in criteria else None
