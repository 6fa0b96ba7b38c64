"""HIC against closed forms, brute force, its own invariances and an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech import hic

Array = NDArray[np.float64]

# Pulse of peak A and length T: shape of t/T, C in HIC = C A^2.5 T, optimum window over T, and C for
# a shorter window x T.
PULSES = {
    "half_sine": (
        lambda u: np.sin(np.pi * u), 0.4146456495, 0.6702296636,
        lambda x: x * (2 * np.sin(np.pi * x / 2) / (np.pi * x)) ** 2.5,
    ),
    "triangle": (
        lambda u: 1 - np.abs(2 * u - 1), 0.2464006574, 4 / 7,
        lambda x: x * (1 - x / 2) ** 2.5,
    ),
    "haversine": (
        lambda u: np.sin(np.pi * u) ** 2, 0.3029388550, 0.5075918124,
        lambda x: x * (0.5 * (1 + np.sin(np.pi * x) / (np.pi * x))) ** 2.5,
    ),
}  # fmt: skip
RATES = (1e-4, 5e-5, 2e-5)
#: Relative error against the continuous pulse: at most this times (time step / pulse length)^2.
GRID_ERROR = 8.0


def sampled(shape: str, peak: float, length: float, start: float, step: float) -> Array:
    share = (np.arange(round(0.03 / step)) * step - start) / length
    inside = (share > 0) & (share < 1)
    return np.where(inside, peak * PULSES[shape][0](np.clip(share, 0, 1)), 0.0)


def brute_force(values: Array, step: float, window: float | None = None) -> float:
    """Every pair of samples, and every window of the limit's length with an end on a sample."""
    time = np.arange(len(values)) * step
    speed = np.concatenate(([0.0], np.cumsum((values[1:] + values[:-1]) / 2))) * step
    limit = time[-1] if window is None else window
    pairs = [(a, b) for a in time for b in time if 0 < b - a <= limit * (1 + 1e-12)]
    if limit < time[-1]:
        pairs += [(a, a + limit) for a in time if a + limit <= time[-1]]
        pairs += [(b - limit, b) for b in time if b >= limit]
    start, end = np.array(pairs).T
    gain = np.interp(end, time, speed) - np.interp(start, time, speed)
    return float(((end - start) * (gain / (end - start)) ** 2.5).max())


@pytest.mark.parametrize("step", RATES)
@pytest.mark.parametrize("shape", PULSES)
@pytest.mark.parametrize("length", [0.003, 0.0117])
def test_an_unlimited_window_gives_the_closed_form(shape: str, step: float, length: float) -> None:
    _, c, share, _ = PULSES[shape]
    for start in (0.0, 0.00503, 0.0123456):
        result = hic(sampled(shape, 180.0, length, start, step), step)
        error = GRID_ERROR * (step / length) ** 2
        assert result.value == pytest.approx(c * 180.0**2.5 * length, rel=error)
        assert result.t2 - result.t1 == pytest.approx(share * length, abs=2.01 * step)
        assert (result.t1 + result.t2) / 2 == pytest.approx(start + length / 2, abs=1.01 * step)


@pytest.mark.parametrize("step", RATES)
@pytest.mark.parametrize("shape", PULSES)
@pytest.mark.parametrize("share", [0.2, 0.31234, 0.45])
def test_a_window_that_cuts_the_optimum_gives_the_closed_form(
    shape: str, step: float, share: float
) -> None:
    length = 0.015
    window = share * length  # no multiple of the time step
    result = hic(sampled(shape, 90.0, length, 0.00707, step), step, window)
    exact = PULSES[shape][3](share) * 90.0**2.5 * length
    assert result.value == pytest.approx(exact, rel=GRID_ERROR * (step / window) ** 2)
    assert result.t2 - result.t1 == pytest.approx(window, rel=1e-9)


@pytest.mark.parametrize("step", RATES)
@pytest.mark.parametrize("window", [None, 0.004, 0.0010123])
def test_a_square_pulse_is_exact(step: float, window: float | None) -> None:
    values = np.zeros(round(0.02 / step) + 1)
    first, last = round(0.005 / step), round(0.013 / step)
    values[first : last + 1] = 120.0
    length = 0.008 if window is None else window
    result = hic(values, step, window)
    assert result.value == pytest.approx(120.0**2.5 * length, rel=1e-12)
    assert 0.005 - 1e-12 <= result.t1 < result.t2 <= 0.013 + 1e-12


def test_the_error_is_of_second_order_in_the_time_step() -> None:
    exact = PULSES["half_sine"][1] * 100**2.5 * 0.01

    def worst(step: float) -> float:
        starts = np.linspace(0.001, 0.001 + step, 11)
        values = [hic(sampled("half_sine", 100, 0.01, s, step), step).value for s in starts]
        return max(abs(v / exact - 1) for v in values)

    assert worst(1e-4) / worst(2.5e-5) > 10.0


@settings(max_examples=60, deadline=None)
@given(
    values=arrays(np.float64, st.integers(2, 70), elements=st.floats(0, 300)),
    share=st.floats(0.05, 1.5),
)
def test_the_search_finds_what_brute_force_finds(values: Array, share: float) -> None:
    step = 1e-4
    assert hic(values, step).value == pytest.approx(brute_force(values, step), rel=1e-9)
    window = share * step * (len(values) - 1)
    result = hic(values, step, window)
    assert result.value == pytest.approx(brute_force(values, step, window), rel=1e-9)
    assert result.t2 - result.t1 <= window * (1 + 1e-9)


def test_the_limit_cuts_with_either_end_on_a_sample() -> None:
    for seed in range(20):
        values = np.random.default_rng(seed).random(40) * 100
        window = 1e-4 * np.random.default_rng(seed + 100).uniform(5, 30)
        assert hic(values, 1e-4, window).value == pytest.approx(brute_force(values, 1e-4, window))


def noisy(seed: int, samples: int) -> Array:
    random = np.random.default_rng(seed)
    return np.abs(np.cumsum(random.normal(size=samples))) + 20 * random.random(samples)


seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, samples=st.integers(2, 600), scale=st.floats(0.1, 3))
def test_hic_scales_with_the_power_2_5(seed: int, samples: int, scale: float) -> None:
    values = noisy(seed, samples)
    for window in (None, 0.015):
        scaled = hic(scale * values, 1e-4, window).value
        assert scaled == pytest.approx(scale**2.5 * hic(values, 1e-4, window).value, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, samples=st.integers(2, 400), delay=st.integers(0, 300))
def test_a_pulse_may_come_later(seed: int, samples: int, delay: int) -> None:
    values = np.concatenate(([0.0], noisy(seed, samples), [0.0]))
    now = hic(values, 1e-4, 0.015)
    later = hic(np.concatenate((np.zeros(delay), values)), 1e-4, 0.015)
    assert later.value == pytest.approx(now.value, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, a=st.floats(2e-4, 0.06), b=st.floats(2e-4, 0.06))
def test_a_longer_window_never_gives_less(seed: int, a: float, b: float) -> None:
    values = noisy(seed, 300)
    short, long = sorted((a, b))
    least = hic(values, 1e-4, short).value
    assert hic(values, 1e-4, long).value >= least * (1 - 1e-12)
    assert hic(values, 1e-4).value >= least * (1 - 1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=seeds, start=st.floats(0, 1), end=st.floats(0, 1), window=st.floats(1e-3, 0.04))
def test_no_single_window_exceeds_hic(seed: int, start: float, end: float, window: float) -> None:
    """Any window whatever of the velocity, which is linear between samples."""
    values, step = noisy(seed, 300), 1e-4
    time = np.arange(300) * step
    speed = np.concatenate(([0.0], np.cumsum((values[1:] + values[:-1]) / 2))) * step
    t1 = start * time[-1]
    t2 = min(t1 + max(end * window, 1e-6), time[-1])
    if t2 > t1:
        mean = np.diff(np.interp([t1, t2], time, speed))[0] / (t2 - t1)
        assert hic(values, step, window).value >= (t2 - t1) * mean**2.5 * (1 - 1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=seeds)
def test_the_axes_do_not_matter(seed: int) -> None:
    random = np.random.default_rng(seed)
    components = np.cumsum(random.normal(size=(300, 3)), axis=0) * 5
    turned = Rotation.from_quat(random.normal(size=4)).apply(components)
    expected = hic(components, 1e-4, 0.015)
    assert hic(turned, 1e-4, 0.015).value == pytest.approx(expected.value, rel=1e-9)
    resultant = np.linalg.norm(components, axis=1)
    assert hic(resultant, 1e-4, 0.015).value == pytest.approx(expected.value, rel=1e-9)


@pytest.mark.parametrize("window", [0.015, 0.036, 0.0101])
def test_an_independent_library_agrees_on_multi_pulse_signals(window: float) -> None:
    injury = pytest.importorskip("dynars").injury
    random = np.random.default_rng(7)
    for _ in range(30):
        time = np.arange(int(random.integers(250, 2000))) * 5e-5
        values = np.zeros(len(time))
        for _ in range(4):
            centre, width = random.uniform(0, time[-1]), random.uniform(5e-4, 5e-3)
            values += random.uniform(20, 200) * np.exp(-(((time - centre) / width) ** 2))
        expected = injury.hic(values, 5e-5, window)
        assert hic(values, 5e-5, window).value == pytest.approx(expected, rel=1e-9)


def test_nothing_gives_nothing() -> None:
    assert hic(np.zeros(50), 1e-4) == hic(np.zeros((50, 3)), 1e-4, 0.015) == (0.0, 0.0, 0.0)


def test_one_axis_counts_by_its_amount() -> None:
    values = sampled("half_sine", 100.0, 0.01, 0.002, 1e-4)
    assert hic(-values, 1e-4) == hic(values, 1e-4)
