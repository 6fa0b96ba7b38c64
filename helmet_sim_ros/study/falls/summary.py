"""What many falls say together: how often, how fast, at which angle and where the head strikes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.placement import SITES

#: Measures and criteria of which mean and deviation are told, with unit and factor from their own.
TOLD = (
    ("strike_speed", "m/s", 1.0),
    ("strike_normal_velocity", "m/s", 1.0),
    ("strike_tangential_velocity", "m/s", 1.0),
    ("strike_angle_deg", "deg", 1.0),
    ("strike_body_angle_deg", "deg", 1.0),
    ("peak_g", "g", 1.0),
    ("hic", "-", 1.0),
    ("bric", "-", 1.0),
    ("peak_angular_velocity", "rad/s", 1.0),
    ("peak_angular_acceleration", "krad/s^2", 1e-3),
)


@dataclass(frozen=True)
class Distribution:
    """A measure of the worst strikes: mean, standard deviation and percentiles in ``unit``."""

    name: str
    unit: str
    mean: float
    deviation: float
    low: float
    median: float
    high: float


@dataclass(frozen=True)
class Summary:
    """A group of falls.

    Attributes:
        group: what its falls have in common: empty for all.
        falls: how many were simulated; ``struck``: of them with head contact.
        measures: of their worst strikes; 5th and 95th percentile as low and high.
        zones: share of the worst strikes on each zone of the helmet.
    """

    group: str
    falls: int
    struck: int
    measures: tuple[Distribution, ...]
    zones: Mapping[str, float]


def summarise(columns: Mapping[str, Sequence[object]], by: Sequence[str] = ()) -> list[Summary]:
    """Summaries of a study of falls, one per group.

    Args:
        columns: of its results, with ``status``, ``strikes`` and some of ``TOLD``.
        by: names of columns of which each combination of values is one group.
    """
    groups: dict[str, list[int]] = {}
    for i, status in enumerate(columns["status"]):
        if status == "ok":
            groups.setdefault(", ".join(str(columns[name][i]) for name in by), []).append(i)
    return [_summary(group, rows, columns) for group, rows in groups.items()]


def _summary(group: str, rows: list[int], columns: Mapping[str, Sequence[object]]) -> Summary:
    def numbers(name: str, of: Sequence[int]) -> FloatArray:
        column = columns[name]
        return np.array([math.nan if column[i] is None else column[i] for i in of], dtype=float)

    count = numbers("strikes", rows)
    struck = [i for i, n in zip(rows, count, strict=True) if n > 0]
    measures = []
    for name, unit, factor in TOLD:
        if name not in columns or not struck:
            continue
        values = factor * numbers(name, struck)
        values = values[np.isfinite(values)]
        if len(values):
            low, median, high = (float(v) for v in np.percentile(values, [5.0, 50.0, 95.0]))
            deviation = float(values.std(ddof=1)) if len(values) > 1 else 0.0
            measures.append(
                Distribution(name, unit, float(values.mean()), deviation, low, median, high)
            )
    zones: dict[str, float] = dict.fromkeys(SITES, 0.0)
    if struck and "strike_azimuth_deg" in columns and "strike_elevation_deg" in columns:
        places = zip(
            numbers("strike_azimuth_deg", struck), numbers("strike_elevation_deg", struck),
            strict=True,
        )  # fmt: skip
        for azimuth, elevation in places:
            zones[zone_of(azimuth, elevation)] += 1.0 / len(struck)
    return Summary(group, len(rows), len(struck), tuple(measures), zones)


def direction(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """Unit vector in the helmet frame, (3,)."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def zone_of(azimuth_deg: float, elevation_deg: float) -> str:
    """The nearest of front, back, left, right and top."""
    struck = direction(azimuth_deg, elevation_deg)
    return max(SITES, key=lambda zone: float(direction(*SITES[zone]) @ struck))
