"""What the charts of an impact show over time: g, kN, mm, rad/s, krad/s² and ms."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from helmet_sim_ros.biomech.filters import CORNER, filtered
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.biomech.rotation import to_head_axes
from helmet_sim_ros.report.page.quantity import quantity

#: Samples drawn per history of a page with few impacts; longer records are thinned out.
MOST_SAMPLES = 2001
#: The same of a page with many, and samples drawn in all in between.
FEWEST_SAMPLES, ALL_SAMPLES = 401, 100_000

#: Marked peaks: chart -> (criterion, curve, factor from the criterion's unit, words).
_MARKS: Mapping[str, tuple[tuple[str, str, float, str], ...]] = {
    "acceleration": (
        ("peak_g", "resultant", 1.0, ""),
        ("peak_g_cfc1000", "resultant, CFC 1000", 1.0, "CFC 1000: "),
    ),
    "force": (
        ("peak_normal_force", "ground, normal", 1e-3, ""),
        ("peak_tangential_force", "ground, tangential", 1e-3, ""),
    ),
    "compression": (("peak_compression", "resultant", 1e3, ""),),
    "spin": (("peak_angular_acceleration", "resultant", 1e-3, ""),),
    "rate": (("peak_angular_velocity", "resultant", 1.0, ""),),
}
#: Limits drawn as lines: chart -> (criterion, factor).
_LIMITS = {
    "acceleration": ("peak_g", "peak_g_cfc1000"),
    "spin": ("peak_angular_acceleration", "peak_angular_acceleration_cfc1000"),
}
_FACTOR = {"acceleration": 1.0, "spin": 1e-3}


def stride_of(record: ImpactRecord, impacts: int = 1) -> int:
    """One sample in so many is drawn on a page with so many impacts."""
    most = min(MOST_SAMPLES, max(FEWEST_SAMPLES, ALL_SAMPLES // impacts))
    return math.ceil((len(record) - 1) / (most - 1))


def histories(
    record: ImpactRecord, evaluation: Evaluation, stride: int
) -> tuple[dict[str, object], dict[str, FloatArray]]:
    """Plain data and arrays for :func:`~helmet_sim_ros.report.page.blocks.packed`."""
    step = record.time_step
    acceleration = record.head_acceleration / STANDARD_GRAVITY
    friction = record.ground_friction
    crush = record.coupling_displacement * 1e3
    spin = to_head_axes(record.head_angular_acceleration, record.head_orientation) / 1e3
    rate = to_head_axes(record.head_angular_velocity, record.head_orientation)
    arrays = {
        "fn": magnitude(record.ground_force - friction) / 1e3,
        "ft": magnitude(friction) / 1e3,
        "fc": magnitude(record.coupling_force) / 1e3,
    }
    for name, values in (("a", acceleration), ("d", crush), ("s", spin), ("w", rate)):
        arrays |= {f"{name}{axis}": values[:, i] for i, axis in enumerate("xyz")}
    if 2.0 * CORNER * 1000.0 * step < 1.0:
        arrays["cfc"] = magnitude(filtered(acceleration, 1000, step))
    criteria = evaluation.criteria
    window = criteria["hic"].window if "hic" in criteria else None
    plain: dict[str, object] = {
        "count": len(record.time[::stride]),
        "start": float(record.time[0]) * 1e3,
        "step": step * stride * 1e3,
        "window": None if window is None else [1e3 * t for t in window],
        "limits": _limits(record, criteria),
        "marks": {chart: _marks(criteria, chart) for chart in _MARKS},
    }
    return plain, {name: np.asarray(values)[::stride] for name, values in arrays.items()}


def _limits(
    record: ImpactRecord, criteria: Mapping[str, Criterion]
) -> dict[str, list[dict[str, object]]]:
    found: dict[str, list[dict[str, object]]] = {chart: [] for chart in _MARKS}
    for chart, names in _LIMITS.items():
        for name in names:
            criterion = criteria.get(name)
            if criterion is not None and criterion.limit is not None:
                text = f"limit {quantity(criterion.limit, criterion.unit)}"
                text += " (CFC 1000)" * name.endswith("_cfc1000")
                found[chart].append({"value": criterion.limit * _FACTOR[chart], "label": text})
    thickness = record.setup.get("helmet.liner.thickness")
    if isinstance(thickness, int | float):
        text = f"liner thickness {quantity(thickness, 'm')}"
        found["compression"].append({"value": thickness * 1e3, "label": text})
    return found


def _marks(criteria: Mapping[str, Criterion], chart: str) -> list[dict[str, object]]:
    """The marked peaks of a chart; two that read the same are marked once."""
    marks: list[dict[str, object]] = []
    for name, series, factor, words in _MARKS[chart]:
        criterion = criteria.get(name)
        if criterion is None or criterion.time is None:
            continue
        text = words + quantity(criterion.value, criterion.unit)
        said = {"series": series, "time": criterion.time * 1e3,
                "value": criterion.value * factor, "label": text}  # fmt: skip
        marks.append(said)
    return marks
