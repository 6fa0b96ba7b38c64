"""From compression tests to a foam for liners: a table, its rate and the law nearest to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from scipy.optimize import least_squares

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.foams import POINTS, Foam
from helmet_sim_ros.model.force.foam import (
    RATE,
    RATE_EXPONENT,
    SOLID_DENSITY,
    foam_row,
    loading_stress,
    rows_of,
)
from helmet_sim_ros.study.foams.curve import Curve

STEEPEST = 0.3  # power of the strain rate, at most
#: Densities for which a table is used, over the tested one: stresses follow a power of it.
SPREAD = 0.25
STRAINS = np.linspace(0.05, 0.6, 56)  # where rates are compared: past yield, before densification
LAST = 0.95  # of the strain without pores, end of the table


@dataclass(frozen=True)
class FoamFit:
    """A foam made of tests.

    Attributes:
        foam: with a table.
        law: the analytic law nearest to it, without.
        curves: the tests.
        strain, stress: of the table, (n,).
        error: root mean square of the law's stress less the table's, over the plateau's, up to the
            last tested strain [-]; ``worst`` its largest amount.
        exponent: m of stress ~ rate^m; None for a single rate.
        exponent_error: standard deviation over the strains.
        notes: in words.
    """

    foam: Foam
    law: Foam
    curves: tuple[Curve, ...]
    strain: FloatArray
    stress: FloatArray
    error: float
    worst: float
    exponent: float | None
    exponent_error: float
    notes: tuple[str, ...]

    def law_stress(self, strain: FloatArray) -> FloatArray:
        """The law's stress at strains, (n,) [Pa]."""
        return _stresses(self.law, strain)


def fit_foam(
    curves: Sequence[Curve],
    density: float,
    source: str = "",
    solid_density: float = SOLID_DENSITY,
    rate: float = RATE,
) -> FoamFit:
    """A foam of tests at one density.

    Of several rates, ln s = a(e) + m ln(rate) gives m, and the table is that of ``rate``: between
    tested rates by interpolation, beyond them by the power; the liner then follows the power from
    there. A single test is the table, for its own rate if that is told; the liner follows EPS's
    power. Beyond the last tested strain it follows the fitted law up to 95 % of the strain without
    pores.

    Args:
        curves: of one foam.
        density: tested [kg/m^3].
        source: where the tests come from.
        solid_density: of the polymer [kg/m^3].
        rate: for which the table of several tests is made [1/s].

    Raises:
        SetupError: no curve, or a foam that no liner is made of.
    """
    if not curves:
        raise SetupError.of("foam", "no curve", "needs at least one test")
    exponent, spread = rate_exponent(curves) if len(curves) > 1 else (None, 0.0)
    notes = [_told(curve) for curve in curves]
    base = _nearest(curves, rate)
    factor, power = 1.0, None
    if exponent is not None and base.rate is not None:
        factor = (rate / base.rate) ** exponent
        power = min(max(exponent, 0.0), STEEPEST)
        notes.append(
            f"stress ~ rate^{exponent:.3f} (+-{spread:.3f} over the strains); the table is for "
            f"{rate:g} 1/s, {factor:.3f} times the test at {base.rate:g} 1/s; other rates follow "
            f"rate^{power:.3f}"
        )
    elif not base.rate:
        rate = RATE
        notes.append(
            f"one test, at an unknown rate: taken as {RATE:g} 1/s, that of impacts, where foams "
            "are stiffer than in slow tests"
        )
    else:
        rate = base.rate
        notes.append(
            f"one test, at {rate:g} 1/s: the table; other rates follow rate^{RATE_EXPONENT:g} (EPS)"
        )
    tested = Curve(base.strain, factor * base.stress, rate, base.raised)
    law = _fitted_law(tested, density, solid_density)
    limit = min(LAST * (1.0 - density / solid_density), 0.97)
    strain = np.linspace(0.0, limit, POINTS)
    stress = np.interp(strain, np.r_[0.0, tested.strain[1:]], np.r_[0.0, tested.stress[1:]])
    end = float(tested.strain[-1])
    beyond = strain > end
    if beyond.any():
        ratio = tested.stress[-1] / _stresses(law, np.array([end]))[0]
        stress[beyond] = ratio * _stresses(law, strain[beyond])
        notes.append(f"beyond the tested strain of {end:.2f} the table follows the fitted law")
    rise = 1e-6 * tested.plateau  # a table must rise; a plateau may not
    stress = np.maximum.accumulate(stress) + rise * np.arange(POINTS)
    stress[0] = 0.0
    within = strain <= end
    apart = (_stresses(law, strain[within]) - stress[within]) / tested.plateau
    error, worst = float(np.sqrt(np.mean(apart**2))), float(np.abs(apart).max())
    notes.append(
        f"fitted law: yield {law.yield_stress:.3g} Pa, modulus {law.modulus:.3g} Pa, gas "
        f"{law.gas_pressure:.3g} Pa; its error {100 * error:.1f} % of the plateau, at most "
        f"{100 * worst:.1f} %"
    )
    spread_of = (max(10.0, (1 - SPREAD) * density), min(300.0, (1 + SPREAD) * density))
    foam = law.replaced(
        {
            "description": f"Table of {len(curves)} compression tests at {density:g} kg/m^3.",
            "source": source,
            "densities": spread_of,
            "rate": rate,
            "rate_exponent": power,
            "limit": limit,
            "stress": tuple(float(f"{s:.6g}") for s in stress),
            "yield_stress": tested.plateau,
        }
    )
    return FoamFit(
        foam, law, tuple(curves), strain, np.array(foam.stress), error, worst, exponent, spread,
        tuple(notes),
    )  # fmt: skip


def rate_exponent(curves: Sequence[Curve]) -> tuple[float, float]:
    """m of stress ~ rate^m by least squares at each strain; mean and standard deviation over them.

    Args:
        curves: at two or more rates.

    Raises:
        SetupError: all at the same rate.
    """
    logs = np.log([curve.rate or 0.0 for curve in curves])
    if np.ptp(logs) == 0.0:
        raise SetupError.of("rate", curves[0].rate, "several tests need different rates")
    at = np.array([np.log(np.interp(STRAINS, c.strain, c.stress)) for c in curves])
    slopes = (logs - logs.mean()) @ (at - at.mean(axis=0)) / ((logs - logs.mean()) ** 2).sum()
    return float(slopes.mean()), float(slopes.std())


def write_foam(fit: FoamFit, path: Path) -> None:
    """Write a foam file for ``liner.foam: PATH``.

    Raises:
        SetupError: it exists, or cannot be written.
    """
    values = {k: v for k, v in fit.foam.model_dump(mode="json").items() if v is not None}
    text = "".join(f"# {note}\n" for note in fit.notes)
    text += yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=100)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise SetupError.of("output", str(path), f"cannot be written: {error.strerror}") from error


def _nearest(curves: Sequence[Curve], rate: float) -> Curve:
    """The test whose rate is nearest by ratio."""
    known = [curve for curve in curves if curve.rate]
    return min(known, key=lambda c: abs(np.log((c.rate or 1.0) / rate))) if known else curves[0]


def _fitted_law(curve: Curve, density: float, solid_density: float) -> Foam:
    """The analytic law through a curve, by least squares of the stress over the plateau's."""
    plateau = curve.plateau
    strain = np.linspace(0.0, float(curve.strain[-1]), 200)[1:]
    stress = np.interp(strain, curve.strain, curve.stress)

    def law(logs: FloatArray) -> Foam:
        yield_stress, modulus, gas = np.exp(logs).tolist()
        return Foam(
            density=density, densities=(density, density), solid_density=solid_density,
            yield_stress=yield_stress, modulus=modulus, gas_pressure=gas,
        )  # fmt: skip

    def apart(logs: FloatArray) -> FloatArray:
        return (_stresses(law(logs), strain) - stress) / plateau

    start = np.log([plateau, max(25.0 * plateau, 2e4), 0.2 * plateau])
    low = np.log([1e3, 1e4, 1.0])
    high = np.log([2e7, 1e9, 1e6])
    result = least_squares(apart, np.clip(start, low, high), bounds=(low, high))
    return law(result.x)


def _stresses(foam: Foam, strain: FloatArray) -> FloatArray:
    density = np.array([foam.density])
    row = rows_of(foam, density, 0.05)[0]
    return np.array([loading_stress(float(e), row) for e in strain])


def eps_stresses(density: float, strain: FloatArray) -> FloatArray:
    """The shipped law of EPS at a density, (n,) [Pa], to compare with."""
    row = foam_row(density, 0.05)
    return np.array([loading_stress(float(e), row) for e in strain])


def _told(curve: Curve) -> str:
    rate = "rate not told" if curve.rate is None else f"{curve.rate:g} 1/s"
    return (
        f"{rate}: {len(curve.strain)} points to strain {curve.strain[-1]:.2f}, plateau "
        f"{curve.plateau:.3g} Pa"
        + (f", smoothed by at most {100 * curve.raised:.1f} % of it" if curve.raised > 0 else "")
    )
