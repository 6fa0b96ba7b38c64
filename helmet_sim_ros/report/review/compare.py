"""Two logs side by side: paired impacts, differences of their criteria, overlaid histories."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.helmet import compression, ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact
from helmet_sim_ros.report.review.summary import label

#: Setup values by which impacts of two logs belong together; helmet and rider may differ.
PAIRED_BY = (
    "impact.rig", "impact.direction", "impact.normal_velocity", "impact.tangential_velocity",
    "impact.tangential_heading_deg", "impact.body_angle_deg",
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


def paired(first: ImpactLog, second: ImpactLog) -> list[Pair]:
    """Impacts of two logs with the same direction, speeds and pose, in the order of the first.

    Several impacts of one kind pair in their order.
    """
    waiting: dict[tuple[Any, ...], list[LoggedImpact]] = {}
    for impact in second:
        waiting.setdefault(_key(impact), []).append(impact)
    pairs = []
    for impact in first:
        same = waiting.get(_key(impact), [])
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


def overlay_figure(pairs: Sequence[Pair], names: tuple[str, str]) -> Figure:
    """Acceleration, ground force and compression of each pair, one row per pair."""
    both = [pair for pair in pairs if pair.a is not None and pair.b is not None]
    figure = Figure(figsize=(12.0, 2.7 * max(len(both), 1) + 0.6), layout="constrained")
    grid = figure.subplots(max(len(both), 1), 3, sharex=True, squeeze=False)
    for row, pair in zip(grid, both, strict=False):
        for impact, name, style in zip((pair.a, pair.b), names, ("-", "--"), strict=True):
            assert impact is not None
            record = impact.record
            for ax, (_, history) in zip(row, _histories(record), strict=True):
                ax.plot(record.time * 1e3, history, style, lw=1.3, label=name)
        for ax, (unit, _) in zip(row, _histories(record), strict=True):
            ax.set_ylabel(unit, fontsize=8)
            ax.grid(alpha=0.3)
        row[0].set_title(pair.label, fontsize=9, loc="left")
        row[0].legend(fontsize=7)
    for ax in grid[-1]:
        ax.set_xlabel("time [ms]")
    return figure


def _histories(record: ImpactRecord) -> Iterable[tuple[str, FloatArray]]:
    normal, _ = ground_components(record.ground_force)
    return (
        ("head acceleration [g]", magnitude(record.head_acceleration) / STANDARD_GRAVITY),
        ("normal ground force [kN]", normal / 1e3),
        ("compression [mm]", compression(record.coupling_displacement) * 1e3),
    )


def _key(impact: LoggedImpact) -> tuple[Any, ...]:
    values = [impact.setup.get(name) for name in PAIRED_BY]
    return tuple(round(v, 9) if isinstance(v, float | np.floating) else v for v in values)


def _value(criteria: Mapping[str, Any], name: str) -> float | None:
    return float(criteria[name].value) if name in criteria else None
