"""Injury risk curves. Informative: none was derived from helmeted riders.

All HIC curves are for the 15 ms HIC, from unhelmeted cadaver drops and car occupants; the BrIC
curves come from scaled animal tests and finite-element heads. Constants are general literature
values of the sources named beside them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeVar

from helmet_sim_ros.biomech.pulse import real_number
from helmet_sim_ros.errors import PulseError

Constants = TypeVar("Constants")

#: For whom the curves were derived, for the note of every risk.
POPULATION_HIC = "informative: derived from unhelmeted cadaver heads and car occupants"
POPULATION_BRIC = "informative: derived from scaled animal tests and car-crash dummies"

#: Mean and standard deviation of ln HIC15 at injury, by least AIS (E. Hertz, "A note on the Head
#: Injury Criterion (HIC) as a predictor of the risk of skull fracture", AAAM 1993: AIS 2 is skull
#: fracture; AIS 3 and 4 as extended by NHTSA).
LOGNORMAL = {2: (6.96352, 0.84664), 3: (7.45231, 0.73998), 4: (7.65605, 0.60580)}

#: a, b of 1 / (1 + exp(a + 200 / HIC - b HIC)) by least AIS, 6 = fatal (expanded Prasad-Mertz
#: curves, NHTSA, "Actions to reduce the adverse effects of air bags", 1997).
PRASAD_MERTZ = {
    1: (1.54, 0.00650),
    2: (2.49, 0.00483),
    3: (3.39, 0.00372),
    4: (4.90, 0.00351),
    5: (7.82, 0.00429),
    6: (12.24, 0.00565),
}

#: k of 1 - exp(-(BrIC / k)^2.84) by least AIS, for the MPS-based BrIC (Takhounts et al., 2013).
BRIC_SCALE = {1: 0.120, 2: 0.602, 3: 0.987, 4: 1.204, 5: 1.252}
BRIC_EXPONENT = 2.84
#: Ratio of BrIC to its scale from which on a risk is 1 in every digit, so that no power overflows.
CERTAIN = 10.0


def _curve(curves: Mapping[int, Constants], ais: int) -> Constants:
    try:
        return curves[ais]
    except (KeyError, TypeError):
        raise PulseError(
            f"ais = {ais!r:.80}: must be one of {', '.join(map(str, curves))}"
        ) from None


def risk_lognormal(hic15: float, ais: int) -> float:
    """Probability [-] of an injury of at least ``ais`` (2 to 4) by the lognormal curves.

    Raises:
        PulseError: not a number, or there is no curve for ``ais``; so do the others.
    """
    mean, deviation = _curve(LOGNORMAL, ais)
    hic15 = real_number("hic15", hic15)
    if hic15 <= 0.0:
        return 0.0
    return 0.5 * math.erfc(-(math.log(hic15) - mean) / (deviation * math.sqrt(2.0)))


def risk_prasad_mertz(hic15: float, ais: int) -> float:
    """Probability [-] of an injury of at least ``ais`` (1 to 5; 6: death), expanded curves."""
    a, b = _curve(PRASAD_MERTZ, ais)
    hic15 = real_number("hic15", hic15)
    if hic15 <= 0.0:
        return 0.0
    exponent = a + 200.0 / hic15 - b * hic15
    return 1.0 / (1.0 + math.exp(min(exponent, 700.0)))


def risk_bric(bric_mps: float, ais: int) -> float:
    """Probability [-] of a brain injury of at least ``ais`` (1 to 5) from the MPS-based BrIC."""
    ratio = min(max(real_number("bric_mps", bric_mps), 0.0) / _curve(BRIC_SCALE, ais), CERTAIN)
    return -math.expm1(-(ratio**BRIC_EXPONENT))
