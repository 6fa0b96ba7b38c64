"""What the charts show: histories of one or two impacts on common times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.helmet import ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation

#: Points of a chart per impact; more cannot be told apart at its size.
MOST_POINTS = 500
#: A limit is drawn while it is at most so many times the peak: further off it would flatten it.
_LIMIT_IN_SIGHT = 1.7


@dataclass(frozen=True)
class Chart:
    """One chart.

    Attributes:
        title: with the unit.
        series: label and history of each curve of an impact.
        limited: criterion whose limit is drawn, and the factor from its unit to the chart's.
    """

    title: str
    series: tuple[tuple[str, Callable[[ImpactRecord], FloatArray]], ...]
    limited: tuple[str, float] | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the curves."""
        return tuple(label for label, _ in self.series)


CHARTS: tuple[Chart, ...] = (
    Chart(
        "Head acceleration [g]",
        (("head", lambda r: magnitude(r.head_acceleration) / STANDARD_GRAVITY),),
        ("peak_g", 1.0),
    ),
    Chart(
        "Force on the helmet [kN]",
        (
            ("normal", lambda r: ground_components(r.ground_force, r.ground_friction)[0] / 1e3),
            ("tangential", lambda r: ground_components(r.ground_force, r.ground_friction)[1] / 1e3),
        ),
    ),
    Chart(
        "Angular acceleration of the head [krad/s²]",
        (("head", lambda r: magnitude(r.head_angular_acceleration) / 1e3),),
        ("peak_angular_acceleration", 1e-3),
    ),
    Chart(
        "Angular velocity of the head [rad/s]",
        (("head", lambda r: magnitude(r.head_angular_velocity)),),
    ),
)


def chart_data(chart: Chart, records: Sequence[ImpactRecord | None]) -> list[FloatArray]:
    """Times [ms] and the curves of every record in turn, on these times.

    The times are those of all records together, so that every peak is met exactly; outside its
    own times a curve is NaN, and so are the curves of a record that is None, but for one 0.
    """
    kept = [None if r is None else _kept(r, chart) for r in records]
    times = np.unique(np.concatenate([np.zeros(1), *(k[0] for k in kept if k is not None)]))
    columns = [times]
    for drawn in kept:
        for number in range(len(chart.series)):
            if drawn is None:
                columns.append(_nothing(len(times)))
            else:
                own, histories = drawn
                columns.append(
                    np.interp(times, own, histories[number], left=np.nan, right=np.nan)
                )  # fmt: skip
    return columns


def limit_of(chart: Chart, evaluations: Sequence[Evaluation | None]) -> float | None:
    """The limit of a chart's criterion in the chart's unit; None where the standard sets none."""
    if chart.limited is None:
        return None
    name, factor = chart.limited
    found = [e.criteria[name].limit for e in evaluations if e is not None and name in e.criteria]
    return None if not found or found[0] is None else factor * found[0]  # one standard judges all


def limit_line(limit: float, data: Sequence[FloatArray]) -> FloatArray:
    """A limit on the times of a chart; nothing where it is far above the curves."""
    peak = max(float(np.nanmax(curve)) for curve in data[1:])
    count = len(data[0])
    return np.full(count, limit) if limit <= _LIMIT_IN_SIGHT * peak else _nothing(count)


def at_time(record: ImpactRecord, index: int) -> Mapping[str, float]:
    """What the replay says of one sample: time [ms], acceleration [g], forces [kN], rate."""
    tangential = record.ground_friction[index]
    normal = record.ground_force[index] - tangential
    return {
        "time": 1e3 * float(record.time[index]),
        "acceleration": float(np.linalg.norm(record.head_acceleration[index])) / STANDARD_GRAVITY,
        "normal": float(np.linalg.norm(normal)) / 1e3,
        "tangential": float(np.linalg.norm(tangential)) / 1e3,
        "rate": float(np.linalg.norm(record.head_angular_velocity[index])),
    }


def _nothing(count: int) -> FloatArray:
    """A curve that is not seen: uPlot finds no scale for one without any number."""
    curve = np.full(count, np.nan)
    curve[0] = 0.0
    return curve


def _kept(record: ImpactRecord, chart: Chart) -> tuple[FloatArray, list[FloatArray]]:
    """Times [ms] and histories, thinned out evenly; every curve keeps its peak."""
    histories = [history(record) for _, history in chart.series]
    peaks = [int(np.argmax(history)) for history in histories]
    even = np.linspace(0, len(record) - 1, min(MOST_POINTS, len(record))).astype(int)
    keep = np.unique(np.concatenate([even, peaks]))
    return record.time[keep] * 1e3, [history[keep] for history in histories]
