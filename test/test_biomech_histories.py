"""The objective rating of histories, and chatter."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.biomech import Rating, channel_rating, chatter, rating
from helmet_sim_ros.biomech.histories import best_shift, warping_path
from helmet_sim_ros.errors import PulseError

Array = NDArray[np.float64]
TIME = np.arange(300) * 1e-4  # s
#: What objective_rating_metrics 1.3 (PyPI), an independent program for ISO/TS 18571, gives.
RATED = (
    (0.7452049, 0.7058189, 0.6666667, 0.9117518, 0.7359682),
    (0.5249004, 0.5951920, 0.5833333, 0.5495334, 0.3012513),
    (0.7910730, 0.9616948, 1.0000000, 0.7538979, 0.2780773),
)


def pulse(start: float = 0.002, length: float = 0.010, peak: float = 200.0) -> Array:
    share = np.clip((TIME - start) / length, 0.0, 1.0)
    return np.asarray(peak * np.sin(np.pi * share))


class TestTheRating:
    def test_of_the_same_curve_is_one(self) -> None:
        assert rating(pulse(), pulse()) == pytest.approx((1.0,) * 5)
        assert rating(-pulse(), -pulse()).grade == "excellent"

    def test_weighs_its_parts(self) -> None:
        total, corridor, phase, size, slope = rating(pulse(), pulse(0.003, 0.012, 170.0))
        assert total == pytest.approx(0.4 * corridor + 0.2 * (phase + size + slope))
        assert all(0.0 < part < 1.0 for part in (corridor, phase, size, slope))

    def test_of_a_shifted_curve_loses_phase_and_nothing_of_magnitude_or_slope(self) -> None:
        for late in (0.001, 0.003, -0.0015):
            found = rating(pulse(0.004), pulse(0.004 + late))
            assert found.phase == pytest.approx(1.0 - abs(late) / (0.2 * 0.03))
            assert found.magnitude == pytest.approx(1.0) and found.slope == pytest.approx(1.0)
            assert best_shift(pulse(0.004), pulse(0.004 + late)) == round(late / 1e-4)

    def test_takes_the_smallest_of_shifts_that_fit_equally_well(self) -> None:
        wave = np.tile([0.0, 1.0, 0.0, -1.0, 2.0], 60)  # fits itself at every fifth sample
        assert best_shift(wave, wave) == 0
        assert best_shift(wave, np.roll(wave, 2)) == 2

    def test_of_a_scaled_curve_loses_slope_by_the_difference(self) -> None:
        for factor in (0.7, 1.1, 1.4):
            found = rating(pulse(), factor * pulse())
            assert found.phase == 1.0
            assert found.slope == pytest.approx(1.0 - abs(factor - 1.0) / 2.0)

    def test_of_an_offset_is_the_corridors_closed_form(self) -> None:
        # Inside the inner corridor, half way to the outer one, at it, and beyond.
        for offset, expected in ((0.05, 1.0), (0.275, 0.25), (0.5, 0.0), (0.9, 0.0)):
            found = rating(pulse(peak=1.0), pulse(peak=1.0) + 0.999 * offset)
            assert found.corridor == pytest.approx(expected, abs=3e-3)
            assert found.slope == pytest.approx(1.0) and found.phase == 1.0

    def test_falls_with_shift_and_with_scale(self) -> None:
        shifted = [rating(pulse(), pulse(0.002 + d)).total for d in np.arange(0, 0.006, 0.001)]
        scaled = [rating(pulse(), s * pulse()).total for s in (1.0, 1.1, 1.25, 1.5, 2.0, 3.0)]
        shrunk = [rating(pulse(), s * pulse()).total for s in (1.0, 0.9, 0.75, 0.5, 0.2)]
        for totals in (shifted, scaled, shrunk):
            assert all(a > b for a, b in pairwise(totals)), totals

    def test_where_the_reference_has_no_slope_there_may_be_none(self) -> None:
        flat = np.array([0, 0, -1, 1] + 7 * [0] + [-1, 1] + 6 * [0], dtype=float)
        sloping = flat + 0.1 * (np.arange(19) == 9)
        assert best_shift(flat, sloping) == 0
        assert rating(flat, flat).slope == 1.0
        assert rating(flat, sloping).slope == 0.0

    def test_does_not_depend_on_the_unit(self) -> None:
        one, other = pulse(), pulse(0.003, 0.012, 170.0)
        assert rating(9.81 * one, 9.81 * other) == pytest.approx(rating(one, other), abs=1e-12)

    def test_grades_as_the_specification_does(self) -> None:
        for total, grade in ((0.95, "excellent"), (0.94, "good"), (0.80, "fair"), (0.58, "poor")):
            assert Rating(total, 0, 0, 0, 0).grade == grade

    @pytest.mark.parametrize(
        ("other", "expected"),
        [
            (pulse(0.003, 0.012, 170.0), RATED[0]),
            (pulse(0.001, 0.007, 260.0) + 0.3 * pulse(0.012, 0.006), RATED[1]),
            (pulse() + 15.0 * np.sin(2 * np.pi * 400.0 * TIME), RATED[2]),
        ],
    )
    def test_agrees_with_another_program(self, other: Array, expected: tuple[float, ...]) -> None:
        assert rating(pulse(), other) == pytest.approx(expected, abs=1e-6)

    @pytest.mark.parametrize(
        ("reference", "history", "words"),
        [
            (pulse(), pulse()[:-1], "299 samples"),
            (np.ones(300), pulse(), "constant"),
            (pulse()[:10], pulse()[:10], "at least 18"),
            (np.resize(pulse(), 10001), np.resize(pulse(), 10001), "at most 10000"),
            (pulse(), np.where(TIME > 0.01, np.nan, 0.0), "not finite"),
        ],
    )
    def test_refuses_what_cannot_be_rated(
        self, reference: Array, history: Array, words: str
    ) -> None:
        with pytest.raises(PulseError, match=words):
            rating(reference, history)


def test_warping_finds_the_cheapest_path_in_its_window() -> None:
    rng = np.random.default_rng(7)
    for window in (1, 3, 11):
        a, b = rng.normal(size=(2, 12))
        costs = np.full((12, 12), np.inf)  # textbook recursion, sum by sum
        for i in range(12):
            for j in range(max(0, i - window), min(12, i + window + 1)):
                before = [costs[i - 1, j] if i else np.inf, costs[i, j - 1] if j else np.inf,
                          costs[i - 1, j - 1] if i and j else np.inf]  # fmt: skip
                costs[i, j] = (a[i] - b[j]) ** 2 + (min(before) if i or j else 0.0)
        i, j = warping_path(a, b, window)
        assert ((a[i] - b[j]) ** 2).sum() == pytest.approx(costs[-1, -1])
        assert (i[0], j[0], i[-1], j[-1]) == (0, 0, 11, 11)
        assert np.abs(i - j).max() <= window
        assert {*zip(np.diff(i), np.diff(j), strict=True)} <= {(0, 1), (1, 0), (1, 1)}


def test_records_are_rated_by_channel_whatever_their_step_and_length() -> None:
    setup = ImpactSetup(rig="headform", direction="front", normal_velocity=5.0, duration=0.03)
    coarse = simulate(setup)
    fine = simulate(setup.replaced({"time_step": 2e-5, "duration": 0.04}))
    other = simulate(setup.replaced({"normal_velocity": 7.0}))
    assert channel_rating(coarse, fine).total > 0.99
    assert channel_rating(coarse, other).total < channel_rating(coarse, fine).total - 0.05
    changed = coarse.head_acceleration.copy()
    changed[coarse.time > 0.02] = 0.0  # after the interval that is compared
    later = replace(coarse, head_acceleration=changed)
    assert channel_rating(coarse, later, duration=0.015).total > 0.99
    assert channel_rating(coarse, later).total < channel_rating(coarse, later, duration=0.015).total
    with pytest.raises(PulseError, match="head_acceleration"):
        channel_rating(coarse, fine, "head_jerk")
    with pytest.raises(PulseError, match="constant"):
        channel_rating(replace(coarse, head_acceleration=np.zeros_like(fine.time[:601, None])
                               + np.zeros(3)), fine)  # fmt: skip


class TestChatter:
    STEP = 5e-5
    SMOOTH = np.interp(np.arange(600) * STEP, TIME, pulse())

    def with_spike(self, samples: int, height: float = 20.0) -> Array:
        values = self.SMOOTH.copy()
        values[400 : 400 + samples] += height
        return values

    def test_is_nothing_in_a_smooth_pulse_and_its_steep_flanks(self) -> None:
        assert chatter(self.SMOOTH, self.STEP).height < 1.0
        step = np.where(np.arange(600) > 100, 250.0, 0.0)  # a flank without end
        assert chatter(step, self.STEP) == (0.0, 0.0, 0)

    def test_is_a_spike_narrower_than_its_width(self) -> None:
        height, time, spikes = chatter(self.with_spike(6), self.STEP)  # 0.30 ms and less
        assert (height, spikes) == (pytest.approx(20.0, abs=1e-9), 1)
        assert time == pytest.approx(400 * self.STEP)
        assert chatter(self.with_spike(7), self.STEP).spikes == 0

    def test_counts_what_is_above_the_threshold(self) -> None:
        values = self.with_spike(3, 6.0)
        values[450:452] += 4.0
        values[500] += 40.0
        assert chatter(values, self.STEP).spikes == 2
        assert chatter(values, self.STEP, threshold=3.0).spikes == 3
        assert chatter(values, self.STEP, threshold=50.0) == (40.0, 500 * self.STEP, 0)

    def test_is_seen_in_the_resultant(self) -> None:
        axes = np.zeros((600, 3))
        axes[300:303] = (3.0, 4.0, 12.0)
        assert chatter(axes, self.STEP).height == 13.0

    def test_refuses_sampling_that_cannot_show_it(self) -> None:
        with pytest.raises(PulseError, match="half the width"):
            chatter(self.SMOOTH, 2e-4)
        with pytest.raises(PulseError, match="6 samples"):
            chatter(self.SMOOTH[:6], self.STEP)
