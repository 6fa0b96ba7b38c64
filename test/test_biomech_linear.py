"""Criteria of the linear acceleration against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import beta

from helmet_sim_ros import biomech

Array = NDArray[np.float64]
PEAK, LENGTH, START = 160.0, 0.0123, 0.00411


def half_sine(step: float) -> Array:
    share = (np.arange(round(0.03 / step)) * step - START) / LENGTH
    return np.where((share > 0) & (share < 1), PEAK * np.sin(np.pi * share), 0.0)


@pytest.mark.parametrize("step", [1e-4, 5e-5, 2e-5])
class TestAHalfSine:
    def test_clip(self, step: float) -> None:
        level, t1, t2 = biomech.clip(half_sine(step), step)
        half = 0.0015 / LENGTH
        assert level == pytest.approx(PEAK * np.cos(np.pi * half), rel=5 * (step / LENGTH) ** 2)
        assert t2 - t1 == pytest.approx(0.003)
        assert (t1 + t2) / 2 == pytest.approx(START + LENGTH / 2, abs=step)

    def test_gsi(self, step: float) -> None:
        # integral of sin^2.5 over half a turn
        exact = PEAK**2.5 * LENGTH * beta(1.75, 0.5) / np.pi
        assert biomech.gsi(half_sine(step), step) == pytest.approx(exact, rel=1e-4)

    def test_sfc_is_the_mean_over_the_hic_window(self, step: float) -> None:
        x = 0.6702296636
        mean = PEAK * 2 * np.sin(np.pi * x / 2) / (np.pi * x)
        # The mean is not stationary in the window, so one sample of it counts.
        assert biomech.sfc(half_sine(step), step).value == pytest.approx(mean, rel=step / LENGTH)

    def test_dwell(self, step: float) -> None:
        for threshold in (20.0, 80.0, 150.0):
            exact = LENGTH * (1 - 2 / np.pi * np.arcsin(threshold / PEAK))
            found = biomech.dwell(half_sine(step), step, threshold)
            assert found == pytest.approx(exact, rel=20 * (step / LENGTH) ** 2)
        assert biomech.dwell(half_sine(step), step, PEAK + 1) == 0.0

    def test_pulse_duration(self, step: float) -> None:
        for level in (0.1, 0.5):
            exact = LENGTH * (1 - 2 / np.pi * np.arcsin(level))
            value, t1, t2 = biomech.pulse_duration(half_sine(step), step, level)
            assert value == pytest.approx(exact, rel=20 * (step / LENGTH) ** 2)
            assert (t1 + t2) / 2 == pytest.approx(START + LENGTH / 2, abs=step)

    def test_velocity_change(self, step: float) -> None:
        exact = 2 / np.pi * PEAK * 9.80665 * LENGTH
        result = biomech.velocity_change(half_sine(step), step)
        assert result.value == pytest.approx(exact, rel=5 * (step / LENGTH) ** 2)


def test_the_clip_of_less_than_a_step_at_the_begin_of_a_record_is_exact() -> None:
    assert biomech.clip([10.0, 0.0, 0.0, 0.0], 1e-3, 0.5e-3) == (5.0, 0.0, 0.5e-3)


def test_the_clip_needs_an_unbroken_interval() -> None:
    """Two peaks of 2 ms each: 4 ms above 100 g in all, but none of 3 ms."""
    values = np.zeros(400)
    values[50:90] = values[150:190] = 200.0
    assert biomech.clip(values, 5e-5).value < 1e-9
    assert biomech.dwell(values, 5e-5, 100.0) == pytest.approx(0.004, rel=0.02)


def test_the_clip_lies_between_windows_of_one_sample_less_and_more() -> None:
    injury = pytest.importorskip("dynars").injury
    random = np.random.default_rng(3)
    for _ in range(40):
        time = np.arange(800) * 5e-5
        values = np.abs(random.normal(size=800))
        for _ in range(4):
            centre, width = random.uniform(0, 0.04), random.uniform(5e-4, 5e-3)
            values += random.uniform(20, 200) * np.exp(-(((time - centre) / width) ** 2))
        level, t1, t2 = biomech.clip(values, 5e-5)
        assert sliding_window_view(values, 61).min(axis=1).max() <= level * (1 + 1e-12)
        assert level <= injury.clip(values, 5e-5) * (1 + 1e-12)  # which takes 60 samples
        fine = np.linspace(t1, t2, 20001)  # and the level is indeed kept
        assert np.interp(fine, time, values).min() >= level * (1 - 1e-9)


@pytest.mark.parametrize("step", [3.7e-4, 1.1e-3, 1.53e-3, 2.9e-3, 3e-3, 5e-3])
def test_the_clip_is_exact_for_coarse_samples(step: float) -> None:
    """Against a signal resampled finely along the same straight lines."""
    fine_step = step / 400
    time = np.arange(39 * 400 + 1) * fine_step
    width = int(np.ceil(0.003 / fine_step - 1e-9)) + 1
    for seed in range(40):
        values = np.abs(np.random.default_rng(seed).normal(size=40)) * 50
        fine = np.interp(time, np.arange(40) * step, values)
        expected = sliding_window_view(fine, width).min(axis=1).max()
        found = biomech.clip(values, step).value
        steepest = np.abs(np.diff(fine)).max()
        assert expected * (1 - 1e-9) <= found <= expected + 2 * steepest


@pytest.mark.parametrize("step", [1e-4, 1.1e-4])
def test_a_clip_at_the_edge_of_the_record(step: float) -> None:
    ramp = np.linspace(0, 100, 101)
    level = 100 - 0.003 / step
    for values in (ramp, ramp[::-1], np.minimum(ramp, 60.0)):
        assert biomech.clip(values, step).value == pytest.approx(min(level, values.max()))
    dip = np.full(61, 50.0)
    dip[-2] = 10.0  # every interval of 60 steps meets it
    assert biomech.clip(dip, 5e-5).value == pytest.approx(10.0)


def test_gsi_agrees_with_an_independent_library() -> None:
    injury = pytest.importorskip("dynars").injury
    values = np.abs(np.cumsum(np.random.default_rng(1).normal(size=700)))
    assert biomech.gsi(values, 1e-4) == pytest.approx(injury.severity_index(values, 1e-4))


def test_hic_is_never_above_the_severity_index() -> None:
    values = half_sine(5e-5)
    assert biomech.hic(values, 5e-5).value < biomech.gsi(values, 5e-5)


def test_a_pulse_at_the_edge_of_the_record_lasts_to_the_edge() -> None:
    ramp = np.linspace(0, 100, 101)
    assert biomech.pulse_duration(ramp, 1e-3).t2 == pytest.approx(0.1)
    assert biomech.pulse_duration(ramp[::-1], 1e-3).t1 == 0.0
    assert biomech.pulse_duration(np.full(50, 3.0), 1e-3).value == pytest.approx(0.049)
    assert biomech.pulse_duration(np.zeros(50), 1e-3).value == 0.0


def test_opposite_accelerations_cancel_in_the_velocity_change() -> None:
    there = np.zeros((300, 3))
    there[:100, 0], there[100:200, 0] = 10.0, -10.0
    value, t1, t2 = biomech.velocity_change(there, 1e-3)
    assert value == pytest.approx(10 * 9.80665 * 0.099)
    assert (t1, t2) == pytest.approx((0.0, 0.1), abs=1.1e-3)


def test_hic_d_is_that_of_the_regulation() -> None:
    assert biomech.hic_d(1000.0) == pytest.approx(920.86)
