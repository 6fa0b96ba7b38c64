"""Helmet, neck and risk."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from helmet_sim_ros.biomech import (
    bottoming,
    coupling_energy,
    impulse_ratio,
    instant_force_ratio,
    neck_loads,
    peak_force_ratio,
    restitution,
    risk_bric,
    risk_lognormal,
    risk_prasad_mertz,
)


def ground(normal: object, tangential: object) -> np.ndarray:
    n, t = np.asarray(normal, dtype=float), np.asarray(tangential, dtype=float)
    return np.stack((0.6 * t, -0.8 * t, n), axis=1)


def test_the_peaks_of_the_force_ratio_need_not_coincide() -> None:
    force = ground([0, 1000, 4000, 1000, 0], [0, 900, 500, 100, 0])
    assert peak_force_ratio(force) == pytest.approx(900 / 4000)
    ratio, sample = instant_force_ratio(force)
    assert (ratio, sample) == (pytest.approx(0.9), 1)


def test_the_instant_ratio_ignores_the_first_and_last_touch() -> None:
    force = ground([0, 10, 4000, 10, 0], [0, 100, 500, 100, 0])
    assert instant_force_ratio(force)[0] == pytest.approx(500 / 4000)


def test_the_instant_ratio_begins_at_a_twentieth_of_the_peak_force() -> None:
    force = ground([0, 199, 201, 4000, 0], [0, 190, 150, 500, 0])
    assert instant_force_ratio(force) == (pytest.approx(150 / 201), 2)


def test_the_impulse_ratio_counts_a_reversal() -> None:
    assert impulse_ratio(ground([0, 1, 1, 1, 1, 0], [0, 1, 1, 1, 1, 0])) == pytest.approx(1.0)
    assert impulse_ratio(ground([0, 1, 1, 1, 1, 0], [0, 1, 1, -1, -1, 0])) == pytest.approx(0.0)


def test_the_ground_cannot_pull() -> None:
    assert peak_force_ratio(ground([0, 2000, -9000, 0], [0, 500, 0, 0])) == pytest.approx(0.25)


def test_without_contact_every_ratio_is_0() -> None:
    none = ground(np.zeros(9), np.zeros(9))
    assert peak_force_ratio(none) == impulse_ratio(none) == instant_force_ratio(none)[0] == 0.0


def test_a_loop_absorbs_the_area_between_loading_and_unloading() -> None:
    """Loads with 2e5 N/m to 20 mm, unloads along a parabola that gives back two thirds as much."""
    up = np.linspace(0, 0.02, 400)
    depth = np.concatenate((up, up[-2::-1]))
    force = np.concatenate((2e5 * up, (4000 / 0.02**2) * up[-2::-1] ** 2))
    direction = np.array([-0.6, 0.0, 0.8])
    peak, absorbed = coupling_energy(np.outer(force, direction), np.outer(depth, direction))
    assert peak == pytest.approx(0.5 * 2e5 * 0.02**2, rel=1e-5)
    assert absorbed == pytest.approx(peak * (1 - 2 / 3), rel=1e-4)


def test_an_elastic_coupling_absorbs_nothing() -> None:
    path = np.random.default_rng(0).normal(size=(50, 3)) * 0.01
    path[0] = path[-1] = 0.0
    assert coupling_energy(2e5 * path, path).absorbed == pytest.approx(0.0, abs=1e-9)


def test_restitution_compares_rebound_and_approach() -> None:
    assert restitution([-5.0, -2.0, 0.5, 1.5, 1.2]) == pytest.approx(0.3)
    assert restitution([-5.0, -2.0, -0.5]) is None  # not turned back yet
    assert restitution([1.0, 2.0]) is None  # never approached


def test_bottoming_is_a_share_of_the_liner() -> None:
    assert bottoming(0.03, 0.04) == pytest.approx(0.75)


def test_neck_loads_by_kind() -> None:
    force = [[3.0, -4.0, 100.0], [0.0, 0.0, -40.0]]
    torque = [[0.0, 0.0, 0.0], [-6.0, 8.0, -5.0]]
    loads = neck_loads(force, torque)
    assert list(loads.compression) == [100.0, 0.0]
    assert list(loads.tension) == [0.0, 40.0]
    assert list(loads.shear) == [5.0, 0.0]
    assert list(loads.bending) == [0.0, 10.0]
    assert list(loads.torsion) == [0.0, 5.0]


@pytest.mark.parametrize(
    ("ais", "mean", "deviation"),
    [(2, 6.96352, 0.84664), (3, 7.45231, 0.73998), (4, 7.65605, 0.60580)],
)
def test_the_lognormal_risk_is_the_normal_distribution_of_ln_hic(
    ais: int, mean: float, deviation: float
) -> None:
    for hic15 in (10.0, 700.0, 3000.0):
        expected = norm.cdf((np.log(hic15) - mean) / deviation)
        assert risk_lognormal(hic15, ais) == pytest.approx(expected, rel=1e-9)
    assert risk_lognormal(np.exp(mean), ais) == pytest.approx(0.5)
    assert risk_lognormal(0.0, ais) == 0.0 < risk_lognormal(0.9, ais) < 1e-15


@pytest.mark.parametrize("risk", [risk_prasad_mertz, risk_lognormal, risk_bric])
def test_risk_grows_with_the_load_and_falls_with_the_severity(risk: object) -> None:
    levels = {risk_prasad_mertz: range(1, 7), risk_lognormal: range(2, 5)}.get(risk, range(1, 6))  # type: ignore[call-overload]
    loads = np.linspace(0, 3, 301) if risk is risk_bric else np.linspace(0, 2000, 301)
    curves = np.array([[risk(x, ais) for x in loads] for ais in levels])  # type: ignore[operator]
    assert (np.diff(curves, axis=1) >= 0).all()
    assert (np.diff(curves, axis=0) <= 1e-12).all()
    assert curves[:, 0] == pytest.approx(0.0) and (curves <= 1.0).all()


def test_known_points_of_the_risk_curves() -> None:
    # HIC15 = 700, the limit of 49 CFR 571.208: 31 % AIS 2+ by the lognormal curve.
    assert risk_lognormal(700.0, 2) == pytest.approx(0.31, abs=0.005)
    # 1 - 1/e at BrIC = k
    assert risk_bric(0.987, 3) == pytest.approx(1 - np.exp(-1))
    exact = 1 / (1 + np.exp(4.90 + 200 / 1000 - 0.00351 * 1000))
    assert risk_prasad_mertz(1000.0, 4) == pytest.approx(exact)
    assert risk_prasad_mertz(1e-9, 1) == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("ais", "a", "b"),
    [(1, 1.54, 0.00650), (2, 2.49, 0.00483), (3, 3.39, 0.00372), (4, 4.90, 0.00351),
     (5, 7.82, 0.00429), (6, 12.24, 0.00565)],
)  # fmt: skip
def test_the_expanded_prasad_mertz_curves_are_those_published(ais: int, a: float, b: float) -> None:
    for hic15 in (50.0, 700.0, 2000.0):
        exact = 1.0 / (1.0 + np.exp(a + 200.0 / hic15 - b * hic15))
        assert risk_prasad_mertz(hic15, ais) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    ("ais", "scale"), [(1, 0.120), (2, 0.602), (3, 0.987), (4, 1.204), (5, 1.252)]
)
def test_the_bric_curves_are_those_published(ais: int, scale: float) -> None:
    for share in (0.3, 1.0, 1.5):
        exact = 1.0 - np.exp(-(share**2.84))
        assert risk_bric(share * scale, ais) == pytest.approx(exact, rel=1e-12)
