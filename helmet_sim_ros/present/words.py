"""Impacts and numbers in a few words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from helmet_sim_ros.biomech.catalogue import SPOKEN
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation


def impact_label(setup: Mapping[str, Any]) -> str:
    """``rider, left, 5 m/s, 10 m/s along the surface`` of ``setup.described()``."""
    normal, tangential = (setup.get(f"impact.{k}_velocity") for k in ("normal", "tangential"))
    parts = [str(setup[name]) for name in ("impact.rig", "impact.direction") if name in setup]
    if isinstance(normal, int | float):
        parts.append(f"{normal:g} m/s")
    if isinstance(tangential, int | float) and tangential:
        parts.append(f"{tangential:g} m/s along the surface")
    return ", ".join(parts) or "impact"


def unit_text(unit: str) -> str:
    """``kg/m³`` for ``kg/m^3``, ``N·m`` for ``N m``."""
    return unit.replace("^2", "²").replace("^3", "³").replace(" ", "·")


def quantity_text(value: float, unit: str) -> str:
    """``124.7 g``, ``14.36 mm``."""
    return f"{number_text(value, unit)} {spoken_unit(unit)}".rstrip()


def number_text(value: float, unit: str) -> str:
    """The number of :func:`quantity_text`."""
    number = value * SPOKEN.get(unit, (unit, 1.0))[1]
    return f"{number:.0f}" if abs(number) >= 1000.0 else f"{number:.4g}"


def spoken_unit(unit: str) -> str:
    """The unit of :func:`quantity_text`."""
    return unit_text(SPOKEN.get(unit, (unit, 1.0))[0])


def value_text(value: object) -> str:
    """A setup value."""
    if value is None:
        return "unset"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(value_text, value))
    return str(value)


def record_text(record: ImpactRecord) -> str:
    """One line about a record."""
    if not len(record):
        return "<ImpactRecord: no samples>"
    peak = float((record.head_acceleration**2).sum(axis=1).max()) ** 0.5 / STANDARD_GRAVITY
    duration = float(record.time[-1] - record.time[0]) * 1e3
    return (
        f"<ImpactRecord: {impact_label(record.setup)}; {len(record)} samples in {duration:g} ms, "
        f"peak {peak:.1f} g>"
    )


def evaluation_text(evaluation: Evaluation) -> str:
    """One line about an evaluation."""
    limited = [c for c in evaluation.criteria.values() if c.limit is not None]
    parts = [
        f"{c.name} {quantity_text(c.value, c.unit)} (limit {quantity_text(c.limit or 0.0, c.unit)})"
        for c in limited
    ]
    more = len(evaluation.criteria) - len(limited)
    parts += [f"{more} more criteria"] if more else []
    return f"<Evaluation by {evaluation.standard}: {evaluation.verdict}; {', '.join(parts)}>"
