"""Names, units and meanings of every criterion."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from helmet_sim_ros.errors import PulseError, did_you_mean


class Entry(NamedTuple):
    """What a criterion is.

    Attributes:
        unit: SI, g for head accelerations, - without dimension.
        meaning: in a few words, fit to begin a sentence about its value.
    """

    unit: str
    meaning: str


_LINEAR = {
    "peak_g": Entry("g", "peak head acceleration"),
    "hic": Entry("-", "HIC, unlimited window"),
    "hic15": Entry("-", "HIC, 15 ms window"),
    "hic36": Entry("-", "HIC, 36 ms window"),
    "hic_d": Entry("-", "HIC(d) of the free-motion headform"),
    "gsi": Entry("-", "Gadd Severity Index"),
    "clip_3ms": Entry("g", "acceleration kept for 3 ms"),
    "sfc": Entry("g", "Skull Fracture Correlate, mean acceleration over the HIC15 window"),
    "dwell_150g": Entry("s", "time above 150 g"),
    "dwell_200g": Entry("s", "time above 200 g"),
    "pulse_duration": Entry("s", "duration of the pulse above 10 % of its peak"),
    "velocity_change": Entry("m/s", "largest change of velocity of the head"),
}

_FILTERED = {
    "peak_angular_acceleration": Entry("rad/s^2", "peak angular acceleration of the head"),
    "peak_neck_compression": Entry("N", "peak compression of the neck"),
    "peak_neck_tension": Entry("N", "peak tension of the neck"),
    "peak_neck_shear": Entry("N", "peak shear force of the neck"),
    "peak_neck_bending": Entry("N m", "peak bending moment of the neck"),
}

_UNFILTERED = {
    "peak_angular_velocity": Entry("rad/s", "peak angular velocity of the head"),
    "bric": Entry("-", "BrIC, average critical values"),
    "bric_mps": Entry("-", "BrIC, critical values for principal strain"),
    "bric_csdm": Entry("-", "BrIC, critical values for cumulative strain"),
    "ubric": Entry("-", "UBrIC"),
    "damage": Entry("-", "DAMAGE"),
    "ric": Entry("-", "Rotational Injury Criterion, 36 ms window"),
    "klc": Entry("-", "Kleiven's linear combination"),
    "peak_normal_force": Entry("N", "peak normal force of the ground"),
    "peak_tangential_force": Entry("N", "peak tangential force of the ground"),
    "force_ratio": Entry("-", "peak tangential over peak normal force"),
    "instant_force_ratio": Entry("-", "largest tangential over normal force at one instant"),
    "impulse_ratio": Entry("-", "tangential over normal impulse"),
    "peak_compression": Entry("m", "peak compression of the coupling"),
    "bottoming": Entry("-", "share of the liner's thickness used up"),
    "energy_peak": Entry("J", "most energy held by the coupling"),
    "energy_absorbed": Entry("J", "energy absorbed by the coupling"),
    "restitution": Entry("-", "rebound over approach speed of the head"),
    "peak_neck_axial": Entry("N", "peak axial force of the neck"),
    "peak_neck_torsion": Entry("N m", "peak torsion moment of the neck"),
    "risk_skull_fracture": Entry("-", "risk of skull fracture (AIS 2+, lognormal, HIC15)"),
    "risk_head_ais3": Entry("-", "risk of head injury AIS 3+ (lognormal, HIC15)"),
    "risk_head_ais4": Entry("-", "risk of head injury AIS 4+ (lognormal, HIC15)"),
    **{
        f"risk_hic_ais{ais}": Entry("-", f"risk of head injury AIS {ais}+ (Prasad-Mertz, HIC15)")
        for ais in range(1, 6)
    },
    "risk_hic_fatal": Entry("-", "risk of death (Prasad-Mertz, HIC15)"),
    **{
        f"risk_bric_ais{ais}": Entry("-", f"risk of brain injury AIS {ais}+ (BrIC)")
        for ais in range(1, 6)
    },
}

#: Filter class of SAE J211 for the channel behind a criterion: 1000 but for neck moments.
MOMENT_CLASS = 600


def channel_class(name: str) -> int:
    """The channel frequency class of a criterion that also exists filtered."""
    return MOMENT_CLASS if name == "peak_neck_bending" else 1000


def filtered_name(name: str) -> str:
    """The name of the same criterion of the filtered channel, ``peak_g_cfc1000``."""
    return f"{name}_cfc{channel_class(name)}"


def _with_filtered() -> dict[str, Entry]:
    entries = dict(_LINEAR)
    for name, entry in (_LINEAR | _FILTERED).items():
        label = f"{entry.meaning} (CFC {channel_class(name)})"
        entries |= {name: entry, filtered_name(name): Entry(entry.unit, label)}
    return entries | _UNFILTERED


#: Every criterion of :func:`~helmet_sim_ros.biomech.evaluate`, by name.
CATALOGUE: Mapping[str, Entry] = _with_filtered()

#: Units that read better in a sentence: unit -> (shown unit, factor).
SPOKEN: Mapping[str, tuple[str, float]] = {"s": ("ms", 1e3), "m": ("mm", 1e3), "-": ("", 1.0)}

#: What a short table shows.
HEADLINE: tuple[str, ...] = (
    "peak_g", "hic", "hic15", "hic36", "clip_3ms", "pulse_duration", "peak_angular_velocity",
    "peak_angular_acceleration", "bric", "peak_normal_force", "peak_tangential_force",
    "force_ratio", "peak_compression",
)  # fmt: skip

_DWELL = re.compile(r"dwell_(\d{1,3})g(_cfc1000)?")


def dwell_threshold(name: str) -> float | None:
    """The threshold [g] behind ``dwell_NNNg`` or ``dwell_NNNg_cfc1000``, for any whole number."""
    match = _DWELL.fullmatch(name)
    return float(match[1]) if match and int(match[1]) > 0 else None


def entry(name: str) -> Entry:
    """The entry of a criterion, also of a dwell time above any whole number of g.

    Raises:
        PulseError: unknown name; the nearest known ones are listed.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    threshold = dwell_threshold(name)
    if threshold is None:
        import difflib

        near = difflib.get_close_matches(name, CATALOGUE, 3) or list(CATALOGUE)
        hint = did_you_mean(name, CATALOGUE)
        raise PulseError(f"unknown criterion {name!r}; known: {', '.join(near)}{hint}")
    return Entry("s", f"time above {threshold:g} g" + " (CFC 1000)" * name.endswith("_cfc1000"))
