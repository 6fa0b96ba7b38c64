"""CFC filters: frequency response, no distortion at the record's ends, warnings."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from helmet_sim_ros.biomech import SampleRateWarning, cfc, cfc_coefficients
from helmet_sim_ros.biomech.filters import _design
from helmet_sim_ros.biomech.recursion import recursion
from helmet_sim_ros.errors import PulseError

CLASSES = (60, 180, 600, 1000)


def response_db(channel_class: float, frequency: float, step: float) -> float:
    """Gain of a sine, measured well inside a long record."""
    periods = max(40, round(40 * frequency / channel_class))
    time = np.arange(round(periods / frequency / step)) * step
    output = cfc(np.sin(2 * np.pi * frequency * time), channel_class, step)
    middle = slice(len(time) // 4, 3 * len(time) // 4)
    basis = np.exp(-2j * np.pi * frequency * time[middle])
    window = np.hanning(len(basis))
    return float(20 * np.log10(2 * abs((output[middle] * basis * window).sum()) / window.sum()))


@pytest.mark.parametrize("channel_class", CLASSES)
class TestTheCorridorOfSaeJ211:
    """Passband flat to 0.5 dB, -1 dB at the class, -4 dB at FN = class / 0.6, then a slope between
    9 and 24 dB per octave at first."""

    def step(self, channel_class: int) -> float:
        return 1.0 / (40 * channel_class)

    def test_the_passband_is_flat(self, channel_class: int) -> None:
        for share in (0.05, 0.2, 0.5):
            gain = response_db(channel_class, share * channel_class, self.step(channel_class))
            assert -0.5 <= gain <= 0.5

    def test_at_the_class_it_is_down_at_most_one_decibel(self, channel_class: int) -> None:
        gain = response_db(channel_class, channel_class, self.step(channel_class))
        assert -1.0 <= gain <= 0.5

    def test_the_corner_is_at_minus_three_decibels(self, channel_class: int) -> None:
        gain = response_db(channel_class, channel_class / 0.6, self.step(channel_class))
        assert gain == pytest.approx(-3.01, abs=0.15)

    @pytest.mark.parametrize("octaves", [1, 2, 3])
    def test_the_stopband_falls_within_the_slopes(self, channel_class: int, octaves: int) -> None:
        step = self.step(channel_class)
        gain = response_db(channel_class, channel_class / 0.6 * 2**octaves, step)
        assert gain <= 0.5 - 9 * octaves
        # The corridor's lower edge, with what the bilinear transform adds near half the rate.
        assert gain >= -4 - 24 * octaves - 12 * (octaves == 3)


def test_the_corner_of_cfc_1000_is_five_percent_off_at_10_khz() -> None:
    """Why records are at 20 kHz or more."""
    assert response_db(1000, 1.051 * 1000 / 0.6, 1e-4) == pytest.approx(-3.01, abs=0.03)
    assert response_db(1000, 1.003 * 1000 / 0.6, 2e-5) == pytest.approx(-3.01, abs=0.03)


@pytest.mark.parametrize("channel_class", CLASSES)
def test_the_coefficients_are_those_of_the_standard(channel_class: int) -> None:
    step = 1e-5
    w = np.tan(2 * np.pi * channel_class * 2.0775 * step / 2)
    scale = 1 + np.sqrt(2) * w + w * w
    b, a = cfc_coefficients(channel_class, step)
    assert b == pytest.approx(np.array([1, 2, 1]) * w * w / scale, rel=1e-14)
    # y = b0 x0 + b1 x1 + b2 x2 + b3 y1 + b4 y2
    assert -a[1] == pytest.approx(-2 * (w * w - 1) / scale, rel=1e-14)
    assert -a[2] == pytest.approx((-1 + np.sqrt(2) * w - w * w) / scale, rel=1e-14)
    assert b.sum() == pytest.approx(a.sum())  # unit gain at rest


@pytest.mark.parametrize("channel_class", CLASSES)
def test_a_pulse_at_the_start_is_as_if_it_came_later(channel_class: int) -> None:
    step = 5e-5
    pulse = 100 * np.sin(np.pi * np.arange(201) / 200)
    long = np.concatenate((np.zeros(4000), pulse, np.zeros(4000)))
    short = np.concatenate((pulse, np.zeros(300)))
    expected = cfc(long, channel_class, step)[4000:4501]
    assert cfc(short, channel_class, step) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("channel_class", CLASSES)
def test_a_constant_stays_and_a_step_at_the_edge_is_not_smeared(channel_class: int) -> None:
    assert cfc(np.full(100, 7.0), channel_class, 5e-5) == pytest.approx(7.0, rel=1e-9)
    square = np.concatenate((np.full(2000, 50.0), np.zeros(2000)))
    assert cfc(square, channel_class, 5e-5)[:100] == pytest.approx(50.0, rel=1e-6)


@pytest.mark.parametrize("channel_class", [60, 180, 600, 1000])
def test_the_corner_may_come_near_to_half_the_sampling_rate_but_not_to_it(
    channel_class: int,
) -> None:
    limit = 1.0 / (2.0 * 2.0775 * channel_class)  # the time step where it is there
    assert np.isfinite(cfc_coefficients(channel_class, limit * (1.0 - 1e-9))).all()
    with pytest.raises(PulseError, match="too coarse"):
        cfc_coefficients(channel_class, limit * (1.0 + 1e-9))


@pytest.mark.parametrize("channel_class", [60, 180, 600, 1000])
def test_the_second_pass_begins_where_the_first_has_settled(channel_class: int) -> None:
    design = _design(channel_class, 1e-5)
    drive = np.zeros(3 * design.tail)
    drive[1:4] = 1.0, 2.0, 1.0
    answer = np.abs(recursion(design.a, drive))
    assert 1e-12 < answer[1 + design.tail :].max() / answer.max() < 2e-12


def test_time_reversed_is_reversed() -> None:
    """Forward and backward leave no phase shift."""
    signal = np.concatenate((np.zeros(500), np.random.default_rng(2).normal(size=300), [0] * 500))
    there, back = cfc(signal, 600, 5e-5), cfc(signal[::-1], 600, 5e-5)[::-1]
    assert there == pytest.approx(back, abs=1e-9)


def test_three_components_are_filtered_each() -> None:
    signal = np.cumsum(np.random.default_rng(4).normal(size=(400, 3)), axis=0)
    together = cfc(signal, 180, 1e-4)
    for i in range(3):
        assert together[:, i] == pytest.approx(cfc(signal[:, i], 180, 1e-4), rel=1e-12)


def test_an_independent_library_agrees_inside() -> None:
    signal = pytest.importorskip("dynars").signal
    values = np.concatenate((np.zeros(2000), np.random.default_rng(9).normal(size=500), [0] * 2000))
    for channel_class in CLASSES:
        expected = np.asarray(signal.cfc(values, float(channel_class), 5e-5))
        assert cfc(values, channel_class, 5e-5) == pytest.approx(expected, abs=1e-9)


def test_a_low_rate_warns_and_an_impossible_one_is_refused() -> None:
    values = np.zeros(100)
    with pytest.warns(SampleRateWarning, match="needs at least 10 kHz"):
        cfc(values, 1000, 1 / 8000)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cfc(values, 1000, 1e-4)
    with pytest.raises(PulseError, match="too coarse for CFC 1000"):
        cfc(values, 1000, 1 / 4000)


@pytest.mark.parametrize("channel_class", CLASSES)
def test_ten_samples_per_class_are_enough_and_a_hundredth_less_is_not(channel_class: int) -> None:
    values, limit = np.zeros(100), 1.0 / (10.0 * channel_class)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cfc(values, channel_class, limit)
    with pytest.warns(SampleRateWarning, match=f"CFC {channel_class} needs"):
        cfc(values, channel_class, 1.01 * limit)
