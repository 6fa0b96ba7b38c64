"""evaluate(): one verdict from one record, exact through JSON."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from helmet_sim_ros.biomech import Evaluation, ImpactRecord, evaluate
from helmet_sim_ros.biomech.record import CHANNELS
from helmet_sim_ros.errors import PulseError, SetupError

G = 9.80665


def drop_record(
    peak_g: float = 200.0, length: float = 0.010, step: float = 5e-5, duration: float = 0.04
) -> ImpactRecord:
    """A head of 4.5 kg stopped by a half-sine force; the ground pushes with friction 0.3."""
    time = np.arange(round(duration / step) + 1) * step
    inside = time < length
    pulse = np.where(inside, np.sin(np.pi * time / length), 0.0) * peak_g * G
    speed = np.where(inside, (1 - np.cos(np.pi * time / length)) / 2, 1.0) * (
        2 * length / np.pi * peak_g * G
    )
    n = len(time)
    arrays: dict[str, NDArray[np.float64]] = {
        name: np.zeros((n, len(labels))) for name, (labels, _) in CHANNELS.items()
    }
    arrays["head_orientation"][:, 3] = arrays["helmet_orientation"][:, 3] = 1.0
    arrays["head_acceleration"][:, 2] = pulse
    arrays["head_velocity"][:, 2] = speed - speed[-1] / 2
    arrays["ground_force"][:, 2] = 4.5 * pulse
    arrays["ground_force"][:, 0] = -0.3 * 4.5 * pulse
    arrays["coupling_displacement"][:, 1] = -pulse / pulse.max() * 0.02
    return ImpactRecord(time=time, **arrays)


def test_a_half_sine_drop_has_the_criteria_of_its_closed_form() -> None:
    result = evaluate(drop_record())
    assert float(result.peak_g) == pytest.approx(200.0, rel=1e-9)
    assert result.peak_g.time == pytest.approx(0.005)
    hic = 0.4146456495 * 200**2.5 * 0.010
    for name in ("hic", "hic15", "hic36"):
        criterion = result.criteria[name]
        assert criterion.value == pytest.approx(hic, rel=2e-4)
        assert criterion.window == pytest.approx((0.00164885, 0.00835115), abs=5e-5)
    assert result.clip_3ms.value == pytest.approx(200 * np.cos(np.pi * 0.15), rel=1e-4)
    assert result.pulse_duration.value == pytest.approx(
        0.010 * (1 - 2 / np.pi * np.arcsin(0.1)), rel=1e-4
    )
    assert result.peak_normal_force.value == pytest.approx(200 * G * 4.5)
    assert result.peak_tangential_force.value == pytest.approx(0.3 * 200 * G * 4.5)
    assert result.force_ratio.value == pytest.approx(0.3)
    assert result.peak_compression.value == pytest.approx(0.02)


def test_the_default_limits_are_275_g_and_hic_2400() -> None:
    good = evaluate(drop_record(peak_g=200.0))
    bad = evaluate(drop_record(peak_g=300.0))
    assert good.verdict == "pass" and bad.verdict == "fail"
    assert (bad.peak_g.limit, bad.hic.limit) == (275.0, 2400.0)
    assert bad.peak_g.verdict == bad.hic.verdict == "fail"
    assert bad.hic15.verdict == "info" and bad.hic15.limit is None
    assert bad.messages[0].startswith(
        "peak_g (peak head acceleration): 300 g exceeds the limit of 275 g by 25 g (9.1%)"
    )


def test_times_are_those_of_the_record() -> None:
    record = drop_record()
    later = evaluate(replace(record, time=record.time + 2.0))
    assert later.peak_g.time == pytest.approx(2.005)
    assert later.hic.window == pytest.approx((2.00165, 2.00835), abs=6e-5)


def test_an_evaluation_survives_json_and_pickle_bit_for_bit() -> None:
    result = evaluate(drop_record(peak_g=213.7, length=0.0083))
    assert Evaluation.from_json(result.to_json()) == result
    assert Evaluation.from_dict(json.loads(json.dumps(result.as_dict()))) == result
    assert pickle.loads(pickle.dumps(result)) == result


def test_an_unknown_criterion_is_an_attribute_error_that_lists_the_known() -> None:
    with pytest.raises(AttributeError, match="peak_g"):
        _ = evaluate(drop_record()).peak_gee


@pytest.mark.parametrize("data", [{}, {"standard": "x"}, [], None, {"criteria": 3}])
def test_data_that_is_no_evaluation_is_refused(data: object) -> None:
    with pytest.raises(PulseError, match="evaluation"):
        Evaluation.from_dict(data)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["head_acceleration", "ground_force", "coupling_displacement"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_refused_by_channel(name: str, value: float) -> None:
    record = drop_record()
    getattr(record, name)[17, 1] = value
    with pytest.raises(PulseError, match=f"{name}: not finite at sample 17"):
        evaluate(record)


def test_bad_time_is_refused() -> None:
    record = drop_record()
    gap = np.delete(np.arange(len(record) + 1), 100) * 5e-5
    for time, words in (
        (record.time[::-1], "must increase"),
        (np.zeros(len(record)), "must increase"),
        (gap, "must be uniform"),
        (np.where(record.time > 0.02, np.nan, record.time), "not finite"),
    ):
        with pytest.raises(PulseError, match=f"time: {words}"):
            evaluate(replace(record, time=time))


@pytest.mark.parametrize("samples", [0, 1])
def test_too_few_samples_are_refused(samples: int) -> None:
    record = drop_record()
    arrays = {name: getattr(record, name)[:samples] for name in CHANNELS}
    with pytest.raises(PulseError, match="time: "):
        evaluate(ImpactRecord(time=record.time[:samples], **arrays))


def test_an_unknown_standard_names_the_known() -> None:
    with pytest.raises(SetupError, match="ece_r22_05"):
        evaluate(drop_record(), "ece_r99")
