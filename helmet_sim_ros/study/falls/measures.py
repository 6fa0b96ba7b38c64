"""What a study keeps of a fall: how its worst head strike came about, and the criteria of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from helmet_sim_ros.biomech.record import ImpactRecord

if TYPE_CHECKING:
    from helmet_sim_ros.model.fall.setup import Fall

#: Measures of the worst head strike (that with the highest peak acceleration of the head) of a
#: fall, as columns of a study beside the criteria: unit and meaning.
STRIKE_MEASURES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "strikes": ("-", "head strikes of the fall; 0: no head contact"),
        "strike_time": ("s", "first touch of the worst strike"),
        "strike_normal_velocity": ("m/s", "head into what it strikes"),
        "strike_tangential_velocity": ("m/s", "head along what it strikes"),
        "strike_speed": ("m/s", "head over what it strikes"),
        "strike_angle_deg": ("deg", "of that speed to the surface"),
        "strike_body_angle_deg": ("deg", "trunk to the surface, head down"),
        "strike_azimuth_deg": ("deg", "place on the helmet, 0 front, 90 left"),
        "strike_elevation_deg": ("deg", "place on the helmet, 90 crown"),
        "strike_shape": ("-", "index of the struck shape in the scene"),
    }
)


def judge_fall(
    record: ImpactRecord, standard: str | None, criteria: Sequence[str], setup: Fall | None = None
) -> tuple[str | None, tuple[float | None, ...], tuple[str, ...]]:
    """Verdict, values and notes of a fall: wanted measures and criteria of its worst strike.

    Args:
        record: of a fall.
        standard: limits of the verdict; None: as :func:`.evaluation.evaluate`.
        criteria: names of measures and criteria.
        setup: of the record, where it is at hand.

    Returns:
        The verdict, None without head contact; the values in order, None where there is none; and
        what weakens them, without head contact what the rider suffered.
    """
    from helmet_sim_ros.biomech.evaluation import evaluate
    from helmet_sim_ros.model.fall.strikes import head_strikes

    found = head_strikes(record, setup)
    values: dict[str, float] = {"strikes": float(len(found))}
    worst = found.worst
    if worst is None:
        return None, tuple(values.get(name) for name in criteria), record.notes
    values |= {
        "strike_time": worst.time,
        "strike_normal_velocity": worst.normal_velocity,
        "strike_tangential_velocity": worst.tangential_velocity,
        "strike_speed": worst.speed,
        "strike_angle_deg": worst.angle_deg,
        "strike_body_angle_deg": worst.body_angle_deg,
        "strike_azimuth_deg": worst.location.azimuth_deg,
        "strike_elevation_deg": worst.location.elevation_deg,
        "strike_shape": float(worst.shape),
    }
    wanted = [name for name in criteria if name not in STRIKE_MEASURES]
    result = evaluate(worst.record, standard, wanted)
    values |= {name: result.criteria[name].value for name in wanted if name in result.criteria}
    return result.verdict, tuple(values.get(name) for name in criteria), result.warnings
