"""Whatever is asked of a criterion: a number, or the package's own error."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from helmet_sim_ros.biomech import filters, helmet, linear, neck, risk, rotation
from helmet_sim_ros.biomech.hic import hic
from helmet_sim_ros.biomech.pulse import LARGEST_VALUE, finite_array, positive, uniform_time_step
from helmet_sim_ros.errors import PulseError

#: Bounded and the same in every run.
BOUNDED = settings(max_examples=60, deadline=None, derandomize=True, database=None)
#: Numbers at which powers, quotients and conversions overflow, and what is no number.
ODD = [0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e-3, 1.0, 1e3, 1e14, LARGEST_VALUE, 1.1e15, 1e154, 1e300,
       math.inf, -math.inf, math.nan, 10**400, -1.0, None, "x", True, [1.0], 1j]  # fmt: skip


def signal(columns: int) -> st.SearchStrategy[np.ndarray]:
    """Short signals of every magnitude, sometimes with a value that is none."""
    values = st.one_of(
        st.floats(-1e4, 1e4), st.floats(allow_nan=True, allow_infinity=True, width=64)
    )
    return st.integers(0, 30).flatmap(lambda n: arrays(np.float64, (n, columns), elements=values))


numbers = st.one_of(st.sampled_from(ODD), st.floats(1e-6, 1e6))
steps = st.one_of(st.sampled_from([1e-4, 5e-5, 1e-5]), numbers)


def refuses_or_gives(action: Callable[..., object], *arguments: object) -> object:
    """The answer, None where it was refused; anything else that is raised fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return action(*arguments)
        except PulseError:
            return None


@given(signal(3), steps, st.one_of(st.none(), numbers))
@BOUNDED
def test_hic_is_finite_or_refused(acceleration, step, window) -> None:
    found = refuses_or_gives(hic, acceleration, step, window)
    if found is not None:
        assert all(map(math.isfinite, found))
        assert found.value >= 0.0 and found.t1 <= found.t2


@given(signal(3), steps, numbers)
@BOUNDED
def test_linear_criteria_are_finite_or_refused(acceleration, step, argument) -> None:
    for action in (linear.clip, linear.pulse_duration, linear.dwell):
        found = refuses_or_gives(action, acceleration, step, argument)
        assert found is None or np.isfinite(found).all()
    for action in (linear.gsi, linear.sfc, linear.velocity_change):
        found = refuses_or_gives(action, acceleration, step)
        assert found is None or np.isfinite(found).all()


@given(signal(3), signal(3), steps)
@BOUNDED
def test_rotational_and_helmet_criteria_are_finite_or_refused(one, other, step) -> None:
    for action in (rotation.ubric, helmet.coupling_energy, neck.neck_loads):
        found = refuses_or_gives(action, one, other)
        assert found is None or all(np.isfinite(value).all() for value in np.atleast_1d(found))
    for action in (rotation.damage, rotation.ric):
        found = refuses_or_gives(action, one, step)
        assert found is None or np.isfinite(found).all()
    found = refuses_or_gives(rotation.bric, one)
    assert found is None or np.isfinite(found)


@given(signal(3), st.one_of(st.sampled_from([60.0, 180.0, 1000.0]), numbers), steps)
@BOUNDED
def test_a_filtered_signal_has_its_shape_and_is_finite_or_refused(values, channel_class, step):
    found = refuses_or_gives(filters.cfc, values, channel_class, step)
    assert found is None or (found.shape == values.shape and np.isfinite(found).all())


@pytest.mark.parametrize("curve", [risk.risk_lognormal, risk.risk_prasad_mertz, risk.risk_bric])
def test_a_risk_is_a_probability_or_refused(curve) -> None:
    for value in ODD:
        for ais in (0, 1, 2, 3, 4, 5, 6, 7, None, "2", [2]):
            found = refuses_or_gives(curve, value, ais)
            assert found is None or 0.0 <= found <= 1.0
    assert curve(1e300, 4) == curve(10**400, 4) == curve(math.inf, 4) == 1.0
    with pytest.raises(PulseError, match="must be a number"):
        curve("x", 4)
    with pytest.raises(PulseError, match=r"ais = 9: must be one of"):
        curve(1.0, 9)


def test_what_overflowed_is_refused_by_name() -> None:
    pulse = np.full((10, 3), 1e200)
    with pytest.raises(PulseError, match=r"acceleration_g: beyond 1e\+15 at sample 0"):
        hic(pulse, 1e-4)
    with pytest.raises(PulseError, match=r"time_step = 1e-300: must be from 1e-12"):
        hic(np.ones(10), 1e-300)
    with pytest.raises(PulseError, match="window"):
        hic(np.ones(10), 1e-4, 1e-320)
    with pytest.raises(PulseError, match="too fine for CFC 60"):
        filters.cfc(np.ones(10), 60, 1e-10)
    with pytest.raises(PulseError, match="array of real numbers"):
        finite_array("signal", [10**400, 1.0])
    with pytest.raises(PulseError, match="number above 0"):
        positive("window", 10**400)
    with pytest.raises(PulseError, match="coupling_force has 3"):
        helmet.coupling_energy(np.ones((3, 3)), np.ones((2, 3)))
    for action in (neck.neck_loads, rotation.ubric):
        with pytest.raises(PulseError, match=r"2 samples, .* has 3"):
            action(np.ones((3, 3)), np.ones((2, 3)))
    with pytest.raises(PulseError, match="critical"):
        rotation.bric(np.ones((3, 3)), ["mps"])
    with pytest.raises(PulseError, match="level"):
        linear.pulse_duration(np.ones(10), 1e-4, None)


def test_the_clip_of_next_to_no_time_is_the_peak() -> None:
    pulse = np.array([0.0, 40.0, 90.0, 30.0, 10.0])
    assert linear.clip(pulse, 1.0, 1e-12).value == pytest.approx(90.0)


# invariances


pulses = arrays(np.float64, st.integers(20, 120), elements=st.floats(0.0, 150.0))


@given(pulses, st.integers(1, 40))
@BOUNDED
def test_hic_grows_with_its_window_and_not_with_rest_around_the_pulse(pulse, rest) -> None:
    short, long, free = (hic(pulse, 1e-4, w).value for w in (0.001, 0.004, None))
    assert short <= long * (1 + 1e-12) and long <= free * (1 + 1e-12)
    calm = np.concatenate([np.zeros(rest + 1), pulse, np.zeros(rest)])
    edged = np.concatenate([[0.0], pulse, [0.0]])
    assert hic(calm, 1e-4).value == pytest.approx(hic(edged, 1e-4).value, rel=1e-9)


@given(pulses, st.floats(0.1, 3.0), st.floats(0.5, 4.0))
@BOUNDED
def test_hic_scales_with_amplitude_and_time_and_does_not_know_their_direction(
    pulse, factor, stretch
) -> None:
    value = hic(pulse, 1e-4).value
    assert hic(factor * pulse, 1e-4).value == pytest.approx(factor**2.5 * value, rel=1e-9)
    assert hic(pulse, stretch * 1e-4).value == pytest.approx(stretch * value, rel=1e-9)
    assert hic(pulse[::-1], 1e-4).value == pytest.approx(value, rel=1e-9)


@given(
    arrays(np.float64, (60, 3), elements=st.floats(-100.0, 100.0)),
    st.floats(-2.0, 2.0), st.floats(-2.0, 2.0),
)  # fmt: skip
@BOUNDED
def test_the_filter_is_linear_and_turns_with_time(values, a, b) -> None:
    other = values[:, ::-1] ** 2
    together = filters.cfc(a * values + b * other, 1000, 5e-5)
    apart = a * filters.cfc(values, 1000, 5e-5) + b * filters.cfc(other, 1000, 5e-5)
    assert np.allclose(together, apart, atol=1e-7 * (1.0 + np.abs(other).max()))
    constant = filters.cfc(np.full((50, 3), a), 1000, 5e-5)
    assert np.allclose(constant, a, atol=1e-9)


@given(arrays(np.float64, (40, 3), elements=st.floats(-300.0, 300.0)), st.permutations([0, 1, 2]))
@BOUNDED
def test_the_resultant_does_not_know_its_axes(acceleration, order) -> None:
    turned = acceleration[:, order] * [1, -1, 1]
    for action in (hic, linear.gsi, linear.velocity_change):
        one = refuses_or_gives(action, acceleration, 1e-5)
        assert np.allclose(one, refuses_or_gives(action, turned, 1e-5), rtol=1e-9, atol=1e-12)


@given(st.integers(2, 200), st.floats(1e-6, 1e-2), st.floats(-1.0, 1.0), st.data())
@BOUNDED
def test_uniform_time_gives_its_step_and_a_gap_is_refused(count, step, start, data) -> None:
    time = start + step * np.arange(count)
    assert uniform_time_step(time) == pytest.approx(step, rel=1e-6)
    if count > 3:
        gap = data.draw(st.integers(1, count - 2))
        with pytest.raises(PulseError):
            uniform_time_step(np.delete(time, gap))
