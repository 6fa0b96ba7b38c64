"""The one evaluation of an impact: live, from a log and in a sweep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from helmet_sim_ros.biomech.catalogue import CATALOGUE, SPOKEN, entry
from helmet_sim_ros.biomech.measured import MeasuredPulse
from helmet_sim_ros.biomech.measures import measure
from helmet_sim_ros.biomech.record import DENSE, ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, Limit, Standard, load_standard
from helmet_sim_ros.errors import PulseError

__all__ = ["Criterion", "Evaluation", "evaluate"]

#: What is said of a limit that nobody checked against the standard itself.
UNVERIFIED = "limit not verified against the primary text"
#: How far the speed of an impact may be from the standard's before it is said.
SPEED_TOLERANCE = 0.02


def evaluate(
    record: ImpactRecord | MeasuredPulse,
    standard: str | None = None,
    criteria: Iterable[str] | None = None,
) -> Evaluation:
    """The criteria of an impact, judged by a standard.

    Deterministic: the same samples give bit for bit the same result, and the same value of a
    criterion whatever else is asked for.

    Args:
        record: the complete impact, all of whose channels are checked, whatever is asked for; or
            a measured pulse, which gives the criteria of what was measured. A fall, whose samples
            are dense where the head strikes, is interpolated.
        standard: name in ``config/standards``, or path of a YAML file; None: the limits of
            ECE R22.05 that the coupling paper quotes, whatever the impact's speed.
        criteria: names of the criteria to compute beside those that the standard limits;
            None: all.

    Raises:
        PulseError: a channel is not finite, the time is not uniform, the acceleration is in
            another unit, a name in criteria is unknown, or the standard limits what cannot be
            computed from this record.
        SetupError: unknown standard, or a limit on an unknown criterion.
    """
    if isinstance(record, ImpactRecord) and DENSE in record.extras:
        record = record.uniform()
    name = DEFAULT_STANDARD if standard is None else standard
    rules = load_standard(name)
    wanted = CATALOGUE if criteria is None else criteria
    if isinstance(wanted, str):  # would be read letter by letter
        raise PulseError(f"criteria = {wanted!r}: must be several names, not one text")
    found, reasons = measure(record, [*wanted, *rules.limits])
    for key, limit in rules.limits.items():
        if key not in found:
            raise PulseError(
                f"{key}: {name} limits it, but this record does not give it; {'; '.join(reasons)}"
            )
        found[key] = _judged(found[key], limit)
    warnings = list(reasons)
    if isinstance(record, ImpactRecord):
        warnings += record.notes
    if standard is not None:
        warnings += _other_speed(record.setup, rules)
    return Evaluation(name, rules.title, found, _messages(found, rules), tuple(warnings))


def _judged(criterion: Criterion, limit: Limit) -> Criterion:
    notes = [criterion.note, "" if limit.verified else UNVERIFIED]
    return criterion._replace(
        limit=limit.max,
        verdict="pass" if criterion.value <= limit.max else "fail",
        note="; ".join(filter(None, notes)),
        source=limit.source,
        verified=limit.verified,
    )


def _messages(criteria: Mapping[str, Criterion], rules: Standard) -> tuple[str, ...]:
    judged = [criteria[name] for name in rules.limits]
    judged.sort(key=lambda criterion: criterion.verdict == "pass")
    return tuple(map(_message, judged))


def _message(criterion: Criterion) -> str:
    unit, factor = SPOKEN.get(criterion.unit, (criterion.unit, 1.0))
    limit = criterion.limit or 0.0
    over = criterion.value - limit

    def spoken(value: float) -> str:
        return f"{factor * value:.4g} {unit}".rstrip()

    words = "exceeds" if criterion.verdict == "fail" else "is within"
    text = f"{criterion.name} ({entry(criterion.name).meaning}): {spoken(criterion.value)} {words} "
    text += f"the limit of {spoken(limit)} by {spoken(abs(over))}"
    if limit > 0.0:
        text += f" ({abs(over) / limit:.1%})"
    return text if criterion.verified else f"{text}; {UNVERIFIED}"


def _other_speed(setup: Mapping[str, object], rules: Standard) -> list[str]:
    """Say if the impact was not at the speed that the standard prescribes."""
    speed, due = setup.get("impact.normal_velocity"), rules.normal_velocity
    if due is None or not isinstance(speed, int | float):
        return []
    if abs(speed - due) <= SPEED_TOLERANCE * due:
        return []
    return [
        f"the impact was at {speed:g} m/s, the standard's test is at {due:g} m/s: the verdict "
        "compares numbers, it is not a result of that test"
    ]
