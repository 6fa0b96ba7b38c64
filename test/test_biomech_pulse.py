"""Bad signals are refused by name, by every function that takes one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from helmet_sim_ros import biomech
from helmet_sim_ros.biomech.pulse import uniform_time_step
from helmet_sim_ros.errors import PulseError

STEP = 5e-5
PULSE = 150.0 * np.sin(np.pi * np.arange(201) / 200)
VECTORS = np.outer(PULSE, [0.6, 0.0, 0.8])

OF_ACCELERATION: dict[str, Callable[..., object]] = {
    "hic": biomech.hic,
    "hic15": partial(biomech.hic, window=0.015),
    "clip": biomech.clip,
    "gsi": biomech.gsi,
    "sfc": biomech.sfc,
    "dwell": partial(biomech.dwell, threshold=100.0),
    "pulse_duration": biomech.pulse_duration,
    "velocity_change": biomech.velocity_change,
}


@pytest.mark.parametrize("function", OF_ACCELERATION.values(), ids=OF_ACCELERATION.keys())
class TestEveryCriterionOfTheLinearAcceleration:
    def test_takes_one_resultant_or_three_components(self, function: Callable[..., object]) -> None:
        one, three = np.array(function(PULSE, STEP)), np.array(function(VECTORS, STEP))
        assert three == pytest.approx(one)

    @pytest.mark.parametrize(
        ("values", "words"),
        [
            ([], "0 samples"),
            ([1.0], "1 samples"),
            (5.0, "shape"),
            (np.zeros((9, 2)), "shape"),
            (np.zeros((3, 9)), "shape"),
            (np.zeros((3, 3, 3)), "shape"),
            (["a", "b"], "real numbers"),
            ([1.0, None], "real numbers|not finite"),
            (np.array([1.0, 1j]), "real numbers"),
            ([0.0, np.nan, 0.0], "not finite at sample 1"),
            ([0.0, 0.0, -np.inf], "not finite at sample 2"),
            ([np.inf, -np.inf, 0.0], "not finite at sample 0"),
        ],
    )
    def test_refuses_a_bad_signal(
        self, function: Callable[..., object], values: object, words: str
    ) -> None:
        with pytest.raises(PulseError, match=f"acceleration_g: .*({words})"):
            function(values, STEP)

    @pytest.mark.parametrize("step", [0.0, -1e-4, np.nan, np.inf, "fast", None])
    def test_refuses_a_bad_time_step(self, function: Callable[..., object], step: object) -> None:
        with pytest.raises(PulseError, match="time_step"):
            function(PULSE, step)

    def test_refuses_metres_per_second_squared(self, function: Callable[..., object]) -> None:
        with pytest.raises(PulseError, match=r"acceleration_g: .*look like m/s\^2"):
            function(PULSE * 9.80665, STEP)


@pytest.mark.parametrize(
    ("peak", "length"),
    [
        (1000.0, 0.0015),  # bare headform on steel
        (400.0, 0.008),  # helmet bottoming
        (60.0, 0.1),  # sled test
        (8.0, 2.0),
    ],
)
def test_no_plausible_head_impact_is_taken_for_a_wrong_unit(peak: float, length: float) -> None:
    time = np.arange(round(length / STEP) + 1) * STEP
    assert biomech.hic(peak * np.sin(np.pi * time / length), STEP).value > 0


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda bad: biomech.hic(PULSE, STEP, bad), "window"),
        (lambda bad: biomech.clip(PULSE, STEP, bad), "duration"),
        (lambda bad: biomech.dwell(PULSE, STEP, bad), "threshold"),
        (lambda bad: biomech.pulse_duration(PULSE, STEP, bad), "level"),
        (lambda bad: biomech.cfc(PULSE, bad, STEP), "channel_class"),
        (lambda bad: biomech.bottoming(0.02, bad), "thickness"),
    ],
)
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_a_bad_argument_is_named(call: Callable[[float], object], name: str, bad: float) -> None:
    with pytest.raises(PulseError, match=name):
        call(bad)


GOOD = np.zeros((20, 3))
UNIT = np.tile([0.0, 0.0, 0.0, 1.0], (20, 1))


@pytest.mark.parametrize(
    ("call", "good", "name"),
    [
        (biomech.bric, GOOD, "angular_velocity"),
        (lambda x: biomech.ubric(x, GOOD), GOOD, "angular_velocity"),
        (lambda x: biomech.ubric(GOOD, x), GOOD, "angular_acceleration"),
        (lambda x: biomech.damage(x, STEP), GOOD, "angular_acceleration"),
        (lambda x: biomech.ric(x, STEP), GOOD, "angular_acceleration"),
        (lambda x: biomech.to_head_axes(x, UNIT), GOOD, "vectors"),
        (lambda x: biomech.to_head_axes(GOOD, x), UNIT, "head_orientation"),
        (biomech.peak_force_ratio, GOOD, "ground_force"),
        (biomech.instant_force_ratio, GOOD, "ground_force"),
        (biomech.impulse_ratio, GOOD, "ground_force"),
        (lambda x: biomech.coupling_energy(x, GOOD), GOOD, "coupling_force"),
        (lambda x: biomech.coupling_energy(GOOD, x), GOOD, "coupling_displacement"),
        (biomech.restitution, GOOD[:, 0], "normal_velocity"),
        (lambda x: biomech.neck_loads(x, GOOD), GOOD, "neck_force"),
        (lambda x: biomech.neck_loads(GOOD, x), GOOD, "neck_torque"),
        (lambda x: biomech.cfc(x, 1000, STEP), GOOD, "values"),
    ],
)
def test_every_other_signal_is_checked(
    call: Callable[[object], object], good: np.ndarray, name: str
) -> None:
    call(good)
    for value in (np.nan, np.inf):
        bad = good.copy()
        bad[7] = value
        with pytest.raises(PulseError, match=f"{name}: not finite at sample 7"):
            call(bad)
    for bad in (good[:0], good[:1], good[..., None], np.zeros((20, 5))):
        with pytest.raises(PulseError, match=f"{name}: "):
            call(bad)


def test_a_quaternion_must_be_one() -> None:
    with pytest.raises(PulseError, match="not a unit quaternion at sample 0"):
        biomech.to_head_axes(GOOD, 2 * UNIT)
    with pytest.raises(PulseError, match="head_orientation: 20 samples"):
        biomech.to_head_axes(GOOD[:5], UNIT)


def test_an_unknown_set_of_critical_values_names_the_known() -> None:
    with pytest.raises(PulseError, match="average, mps, csdm"):
        biomech.bric(GOOD, "max")  # type: ignore[arg-type]


def test_stamps_rounded_to_nanoseconds_are_uniform() -> None:
    stamps = np.round(np.arange(2000) * (1 / 22050), 9) + 12.0
    assert uniform_time_step(stamps) == pytest.approx(1 / 22050, rel=1e-6)


def test_a_clip_longer_than_the_pulse_is_refused() -> None:
    with pytest.raises(PulseError, match="shorter than the duration"):
        biomech.clip(PULSE, STEP, 0.011)


@pytest.mark.parametrize("share", [-1.0, 1.0])
def test_one_interval_may_be_off_by_a_thousandth_of_the_mean(share: float) -> None:
    stamps = np.arange(1000) * STEP
    stamps[500] += share * 0.9e-3 * STEP
    assert uniform_time_step(stamps) == pytest.approx(STEP)
    stamps[500] += share * 0.15e-3 * STEP
    with pytest.raises(PulseError, match="must be uniform"):
        uniform_time_step(stamps)


def test_the_severest_impact_that_is_one_has_a_severity_of_1e5() -> None:
    level = (1e5 / (201 * STEP)) ** 0.4
    assert biomech.clip(np.full(201, 0.9999 * level), STEP).value == pytest.approx(0.9999 * level)
    with pytest.raises(PulseError, match="no head impact in g"):
        biomech.clip(np.full(201, 1.0001 * level), STEP)


def test_a_quaternion_may_be_rounded_to_three_digits() -> None:
    for factor in (1.0 - 0.9e-3, 1.0 + 0.9e-3):
        biomech.to_head_axes(GOOD, np.sqrt(factor) * UNIT)
    for factor in (1.0 - 1.05e-3, 1.0 + 1.05e-3):
        with pytest.raises(PulseError, match="not a unit quaternion"):
            biomech.to_head_axes(GOOD, np.sqrt(factor) * UNIT)
