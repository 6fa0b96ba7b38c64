"""The one evaluation of an impact: live, from a log and in a sweep."""

from __future__ import annotations

from dataclasses import replace

from helmet_sim_ros.biomech.helmet import compression, ground_components, peak_force_ratio
from helmet_sim_ros.biomech.hic import maximum_window
from helmet_sim_ros.biomech.linear import DURATION_LEVEL, kept_level, span_about_peak
from helmet_sim_ros.biomech.pulse import (
    STANDARD_GRAVITY,
    FloatArray,
    finite_array,
    magnitude,
    uniform_time_step,
)
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, Limit, Standard, load_standard
from helmet_sim_ros.errors import SetupError

__all__ = ["Criterion", "Evaluation", "evaluate"]


def evaluate(record: ImpactRecord, standard: str | None = None) -> Evaluation:
    """Every criterion of an impact, judged by a standard.

    Args:
        record: the complete impact.
        standard: name in ``config/standards``, or path of a YAML file; None: ECE R22.05.

    Raises:
        PulseError: a channel is not finite, or the time is not uniform; names the channel.
        SetupError: unknown standard, or a limit on an unknown criterion.
    """
    name = DEFAULT_STANDARD if standard is None else standard
    rules = load_standard(name)
    criteria = {criterion.name: criterion for criterion in _measure(record)}
    for key, limit in rules.limits.items():
        if key not in criteria:
            known = ", ".join(criteria)
            raise SetupError.of(f"limits.{key}", limit.max, f"unknown criterion; known: {known}",
                                name)  # fmt: skip
        criteria[key] = _judged(criteria[key], limit)
    return Evaluation(name, rules.title, criteria, _messages(criteria, rules))


def _measure(record: ImpactRecord) -> list[Criterion]:
    step = uniform_time_step(record.time)
    start = float(record.time[0])
    acceleration = finite_array("head_acceleration", record.head_acceleration, 3)
    resultant = magnitude(acceleration) / STANDARD_GRAVITY

    def peak(name: str, signal: FloatArray, unit: str) -> Criterion:
        i = int(signal.argmax())
        return Criterion(name, float(signal[i]), unit, time=float(record.time[i]))

    found = [peak("peak_g", resultant, "g")]
    for name, window in (("hic", None), ("hic15", 0.015), ("hic36", 0.036)):
        value, t1, t2 = maximum_window(resultant, step, window)
        found.append(Criterion(name, value, "-", window=(start + t1, start + t2)))
    if (len(resultant) - 1) * step >= 0.003:
        value, t1, t2 = kept_level(resultant, step, 0.003 / step)
        found.append(Criterion("clip_3ms", value, "g", window=(start + t1, start + t2)))
    value, t1, t2 = span_about_peak(resultant, step, DURATION_LEVEL)
    found.append(Criterion("pulse_duration", value, "s", window=(start + t1, start + t2)))

    normal, tangential = ground_components(record.ground_force)
    found += [
        peak("peak_normal_force", normal, "N"),
        peak("peak_tangential_force", tangential, "N"),
        Criterion("force_ratio", peak_force_ratio(record.ground_force), "-"),
        peak("peak_compression", compression(record.coupling_displacement), "m"),
    ]
    return found


def _judged(criterion: Criterion, limit: Limit) -> Criterion:
    return replace(
        criterion,
        limit=limit.max,
        verdict="pass" if criterion.value <= limit.max else "fail",
        source=limit.source,
        verified=limit.verified,
    )


def _messages(criteria: dict[str, Criterion], rules: Standard) -> tuple[str, ...]:
    judged = [criteria[name] for name in rules.limits]
    judged.sort(key=lambda criterion: criterion.verdict == "pass")
    return tuple(map(_message, judged))


def _message(criterion: Criterion) -> str:
    value, limit, unit = criterion.value, criterion.limit or 0.0, criterion.unit
    unit = "" if unit == "-" else f" {unit}"
    word = "exceeds" if criterion.verdict == "fail" else "is within"
    text = f"{criterion.name} {value:.4g}{unit} {word} the limit of {limit:.4g}{unit}"
    if limit > 0.0:
        text += f" by {abs(value - limit) / limit:.1%}"
    if not criterion.verified:
        text += " (limit not verified against the primary text)"
    return text
