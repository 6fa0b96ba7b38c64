"""The criteria of a record, before any standard judges them: one formula per name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from helmet_sim_ros.biomech import catalogue, helmet, linear, neck, risk, rotation
from helmet_sim_ros.biomech.hic import maximum_window
from helmet_sim_ros.biomech.measured import MeasuredPulse, MeasuredSignals
from helmet_sim_ros.biomech.pulse import FloatArray
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion
from helmet_sim_ros.biomech.signals import FilteredSignals, NotGiven, RawSignals, Signals

#: A record that ends above this share of a peak of more than so many g cuts a pulse off: choices.
CUT_OFF, SMALL_PEAK = 0.5, 10.0
#: The setup value that ``bottoming`` needs.
THICKNESS = "helmet.liner.thickness"


class Found(NamedTuple):
    """What a formula finds.

    Attributes:
        value: in the catalogue's unit.
        window: the interval that it belongs to, from the first sample on [s].
        sample: where the peak is.
        note: what a reader of this one number must know.
    """

    value: float
    window: tuple[float, float] | None = None
    sample: int | None = None
    note: str = ""


Formula = Callable[[Any], Found]


def measure(
    record: ImpactRecord | MeasuredPulse, wanted: Iterable[str]
) -> tuple[dict[str, Criterion], tuple[str, ...]]:
    """The wanted criteria of a record, as far as it gives them, and what weakens them, in words.

    A value does not depend on what else is wanted.

    Args:
        record: the impact, or what was measured of one.
        wanted: names, in any order.

    Returns:
        The criteria by name, in the order of ``FORMULAS``, then further dwell times.

    Raises:
        PulseError: unknown name, or the record is refused (see :class:`RawSignals`).
    """
    plan = _plan(tuple(wanted))
    raw = MeasuredSignals(record) if isinstance(record, MeasuredPulse) else RawSignals(record)
    filtered = FilteredSignals(raw)
    criteria, warnings = {}, []
    start = float(record.time[0])
    for name, unit, is_filtered, formula in plan:
        try:
            value, window, sample, note = formula(filtered if is_filtered else raw)
        except NotGiven as reason:
            warnings.append(str(reason))
            continue
        if window is not None:
            window = (start + window[0], start + window[1])
        time = None if sample is None else float(record.time[sample])
        criteria[name] = Criterion(name, float(value), unit, window, time, note=note)
    warnings += [filtered.warning, _cut_off(raw)]
    return criteria, tuple(dict.fromkeys(filter(None, warnings)))


def _cut_off(signals: Signals) -> str:
    """What is to be said of a record that ends before its pulse."""
    last, peak = float(signals.resultant[-1]), float(signals.resultant.max())
    if peak <= SMALL_PEAK or last <= CUT_OFF * peak:
        return ""
    return (
        f"the record ends while the head has {last:.0f} g, {100.0 * last / peak:.0f} % of the peak "
        "in it: what comes after that is in no number here"
    )


@lru_cache(maxsize=64)
def _plan(wanted: tuple[str, ...]) -> list[tuple[str, str, bool, Formula]]:
    """In order: name, unit, whether from filtered signals, formula."""
    units = {name: catalogue.entry(name).unit for name in wanted}
    further = sorted(units.keys() - FORMULAS.keys())
    found = {name: FORMULAS[name] for name in FORMULAS if name in units}
    found |= {name: _dwell(name) for name in further}
    return [(name, units[name], *how) for name, how in found.items()]


def _peak(signal: FloatArray, note: str = "") -> Found:
    i = int(signal.argmax())
    return Found(float(signal[i]), sample=i, note=note)


def _over(found: tuple[float, float, float]) -> Found:
    """A value with its window."""
    return Found(found[0], window=found[1:])


def _above(level: float) -> Formula:
    return lambda s: Found(linear.time_above(s.resultant, s.step, level))


def _dwell(name: str) -> tuple[bool, Formula]:
    return name.endswith("_cfc1000"), _above(catalogue.dwell_threshold(name) or 0.0)


def _neck_axial(s: Signals) -> Found:
    pressed, pulled = neck.compression(s.neck_force), neck.tension(s.neck_force)
    kind = "compression" if pressed.max() >= pulled.max() else "tension"
    return _peak(pressed + pulled, note=kind)


def _bottoming(s: RawSignals) -> Found:
    if THICKNESS not in s.record.setup:
        raise NotGiven
    share = helmet.bottoming(float(s.compression.max()), s.record.setup[THICKNESS])
    return Found(share, note="EPS densifies from about 0.65 on")


def _instant_force_ratio(s: RawSignals) -> Found:
    value, sample = helmet.largest_ratio(*s.ground_amounts)
    return Found(value, sample=sample)


def _restitution(s: RawSignals) -> Found:
    ratio = helmet.rebound_ratio(s.normal_velocity)
    if ratio is None:
        raise NotGiven("restitution: the head does not approach and rebound")
    return Found(ratio)


def _hic_risk(curve: Callable[[float, int], float], ais: int) -> Formula:
    return lambda s: Found(curve(s.hic15.value, ais), note=risk.POPULATION_HIC)


def _bric_risk(ais: int) -> Formula:
    def formula(s: RawSignals) -> Found:
        value = risk.risk_bric(rotation.bric_of(s.rate_peaks, "mps"), ais)
        return Found(value, note=risk.POPULATION_BRIC)

    return formula


_LINEAR: Mapping[str, Formula] = {
    "peak_g": lambda s: _peak(s.resultant),
    "hic": lambda s: _over(s.hic),
    "hic15": lambda s: _over(s.hic15),
    "hic36": lambda s: _over(s.hic36),
    "sfc": lambda s: _over(linear.mean_of_window(s.hic15)),
    "hic_d": lambda s: Found(linear.hic_d(s.hic36.value)),
    "gsi": lambda s: Found(linear.severity(s.resultant, s.step)),
    "clip_3ms": lambda s: _over(s.clip_3ms),
    "dwell_150g": _above(150.0),
    "dwell_200g": _above(200.0),
    "pulse_duration": lambda s: _over(
        linear.span_about_peak(s.resultant, s.step, linear.DURATION_LEVEL)
    ),
    "velocity_change": lambda s: _over(linear.largest_change(s.gained, s.step)),
}
_ROTATION: Mapping[str, Formula] = {
    "peak_angular_velocity": lambda s: _peak(s.rate),
    "peak_angular_acceleration": lambda s: _peak(s.spin),
    "bric": lambda s: Found(rotation.bric_of(s.rate_peaks, "average")),
    "bric_mps": lambda s: Found(rotation.bric_of(s.rate_peaks, "mps")),
    "bric_csdm": lambda s: Found(rotation.bric_of(s.rate_peaks, "csdm")),
    "ubric": lambda s: Found(rotation.ubric_of(s.angular_velocity, s.angular_acceleration)),
    "damage": lambda s: Found(rotation.brain_strain(s.angular_acceleration, s.step)),
    "ric": lambda s: _over(maximum_window(s.spin, s.step, rotation.RIC_WINDOW)),
    "klc": lambda s: Found(rotation.klc(float(s.rate.max()), s.hic36.value)),
}
_HELMET: Mapping[str, Formula] = {
    "peak_normal_force": lambda s: _peak(s.ground_amounts[0]),
    "peak_tangential_force": lambda s: _peak(s.ground_amounts[1]),
    "force_ratio": lambda s: Found(helmet.ratio_of_peaks(*s.ground_amounts)),
    "instant_force_ratio": _instant_force_ratio,
    "impulse_ratio": lambda s: Found(helmet.ratio_of_impulses(*s.ground_parts)),
    "peak_compression": lambda s: _peak(s.compression),
    "bottoming": _bottoming,
    "energy_peak": lambda s: Found(s.energy.peak),
    "energy_absorbed": lambda s: Found(s.energy.absorbed),
    "restitution": _restitution,
}
_NECK: Mapping[str, Formula] = {
    "peak_neck_axial": _neck_axial,
    "peak_neck_compression": lambda s: _peak(neck.compression(s.neck_force)),
    "peak_neck_tension": lambda s: _peak(neck.tension(s.neck_force)),
    "peak_neck_shear": lambda s: _peak(neck.across(s.neck_force)),
    "peak_neck_bending": lambda s: _peak(neck.across(s.neck_torque)),
    "peak_neck_torsion": lambda s: _peak(neck.torsion(s.neck_torque)),
}
_RISK: Mapping[str, Formula] = {
    "risk_skull_fracture": _hic_risk(risk.risk_lognormal, 2),
    "risk_head_ais3": _hic_risk(risk.risk_lognormal, 3),
    "risk_head_ais4": _hic_risk(risk.risk_lognormal, 4),
    **{f"risk_hic_ais{ais}": _hic_risk(risk.risk_prasad_mertz, ais) for ais in range(1, 6)},
    "risk_hic_fatal": _hic_risk(risk.risk_prasad_mertz, 6),
    **{f"risk_bric_ais{ais}": _bric_risk(ais) for ais in risk.BRIC_SCALE},
}
_RAW = {**_LINEAR, **_ROTATION, **_HELMET, **_NECK, **_RISK}

#: How each criterion of the catalogue is found: from the filtered signals or not, by what formula.
FORMULAS: Mapping[str, tuple[bool, Formula]] = {
    **{name: (False, formula) for name, formula in _RAW.items()},
    **{
        catalogue.filtered_name(name): (True, formula)
        for name, formula in _RAW.items()
        if catalogue.filtered_name(name) in catalogue.CATALOGUE
    },
}
