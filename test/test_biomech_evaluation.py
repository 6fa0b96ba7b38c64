"""evaluate(): one verdict from one record, exact through JSON."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech import (
    Evaluation,
    ImpactRecord,
    damage,
    evaluate,
    gsi,
    hic,
    klc,
    ric,
    risk_bric,
    risk_lognormal,
    risk_prasad_mertz,
    sfc,
    ubric,
)
from helmet_sim_ros.biomech.record import (
    CHANNELS,
    SHELL,
    block_labels,
    from_block,
    same_samples,
    to_block,
)
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.resources import share_directory

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
    arrays["ground_force"][:, 0] = arrays["ground_friction"][:, 0] = -0.3 * 4.5 * pulse
    arrays["coupling_displacement"][:, 1] = -pulse / pulse.max() * 0.02
    return ImpactRecord(time=time, **arrays)


def test_a_half_sine_drop_has_the_criteria_of_its_closed_form() -> None:
    result = evaluate(drop_record())
    assert float(result.peak_g) == pytest.approx(200.0, rel=1e-9)
    assert result.peak_g.time == pytest.approx(0.005)
    exact = 0.4146456495 * 200**2.5 * 0.010
    for name in ("hic", "hic15", "hic36"):
        criterion = result.criteria[name]
        assert criterion.value == pytest.approx(exact, rel=2e-4)
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


def test_an_unknown_criterion_is_an_attribute_error_that_names_the_nearest_or_all() -> None:
    result = evaluate(drop_record())
    with pytest.raises(AttributeError, match=r"'peak_gee'.*did you mean 'peak_g'\?$"):
        _ = result.peak_gee
    with pytest.raises(AttributeError, match=r"'zzz'; criteria: peak_g, .*hic"):
        _ = result.zzz


def test_a_record_at_its_shortest_step_turns_evenly_between_its_samples() -> None:
    record = drop_record(step=5e-3, duration=0.02)
    half = np.array([0.0, 0.2, 0.4, 0.6, 0.8])  # rad
    turned = np.stack((np.sin(half), 0 * half, 0 * half, np.cos(half)), axis=1)
    time = np.array([0.0, 0.1, 0.2, 0.25, 0.3])
    uniform = replace(record, time=time, head_orientation=turned).uniform()
    assert uniform.time == pytest.approx(np.arange(7) * 0.05)
    expected = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8])
    assert uniform.head_orientation[:, 0] == pytest.approx(np.sin(expected), abs=1e-12)
    assert uniform.head_orientation[:, 3] == pytest.approx(np.cos(expected), abs=1e-12)


def test_a_uniform_record_is_its_own_uniform_form() -> None:
    record = drop_record()
    assert record.is_uniform and record.uniform() is record


def test_a_head_that_hardly_moves_says_nothing_about_the_unit_of_its_acceleration() -> None:
    record = drop_record(peak_g=0.05)  # changes its velocity by 3 mm/s
    for factor in (G, 1.0 / G):
        changed = replace(record, head_acceleration=record.head_acceleration * factor)
        assert evaluate(changed).peak_g.value == pytest.approx(0.05 * factor)
    record = drop_record(peak_g=200.0)
    for factor in (G, 1.0 / G):
        with pytest.raises(PulseError, match=r"9\.81"):
            evaluate(replace(record, head_acceleration=record.head_acceleration * factor))


def test_a_record_without_joints_makes_a_block() -> None:
    record = drop_record()
    bare = replace(record, joint_positions=np.zeros((0, 0)), joint_velocities=np.zeros((0, 0)))
    block = to_block(bare)
    assert block.shape == (len(record.time), len(block_labels(())))
    none = np.zeros((len(record.time), 0))
    again = replace(record, joint_positions=none, joint_velocities=none)
    assert same_samples(from_block(block_labels(()), block), again)


def test_a_block_gives_back_its_record_bit_for_bit() -> None:
    turns = np.linspace(0.0, 0.3, 801)[:, None]
    record = replace(
        drop_record(), joint_names=("neck",), joint_positions=turns, joint_velocities=-turns
    )
    labels, block = block_labels(record.joint_names), to_block(record)
    assert same_samples(from_block(labels, block), record)
    kept = [i for i, label in enumerate(labels) if not label.startswith("ground_friction")]
    older = from_block([labels[i] for i in kept], block[:, kept])  # all ground was flat then
    assert same_samples(older, record)
    with pytest.raises(PulseError, match=r"no column 'ground_force\.z'"):
        from_block([label.replace("ground_force.z", "other") for label in labels], block)


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


def test_the_result_follows_its_json_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    path = share_directory() / "config" / "evaluation.schema.json"
    validator = jsonschema.Draft202012Validator(json.loads(path.read_text(encoding="utf-8")))
    for standard in ("ece_r22_05", "fmvss_218"):
        validator.validate(json.loads(evaluate(drop_record(), standard).to_json()))
    wrong = evaluate(drop_record()).as_dict()
    del wrong["criteria"]["hic"]["limit"]
    assert not validator.is_valid(wrong)


def test_filtered_values_stand_beside_raw_ones() -> None:
    record = drop_record()
    record.head_acceleration[::2, 0] += 30 * G  # 10 kHz ringing
    record.head_acceleration[1::2, 0] -= 30 * G
    result = evaluate(record)
    assert result.peak_g.value == pytest.approx(np.hypot(200, 30), rel=1e-3)
    assert result.peak_g_cfc1000.value == pytest.approx(200, rel=1e-3)
    assert result.hic_cfc1000.value == pytest.approx(0.4146456495 * 200**2.5 * 0.01, rel=1e-3)


def test_notes_of_a_record_are_among_the_warnings() -> None:
    noted = replace(drop_record(), extras={"notes": ["the liner is crushed by 147 %"]})
    assert evaluate(noted).warnings == ("the liner is crushed by 147 %",)
    assert evaluate(noted, "ece_r22_05").warnings[0] == "the liner is crushed by 147 %"


def test_a_record_that_ends_in_its_pulse_is_said() -> None:
    (warning,) = evaluate(drop_record(duration=0.005), criteria=["peak_g"]).warnings
    assert "ends while the head has 200 g, 100 % of the peak" in warning
    (warning,) = evaluate(drop_record(duration=0.008), criteria=["bric"]).warnings
    assert "118 g, 59 % of the peak" in warning
    assert evaluate(drop_record(duration=0.009), criteria=["peak_g"]).warnings == ()
    # Nobody misses the end of a free fall.
    falling = replace(drop_record(), head_acceleration=np.tile([0.0, 0.0, -G], (801, 1)))
    assert not any("ends while" in text for text in evaluate(falling).warnings)


def test_a_low_sample_rate_is_said() -> None:
    assert evaluate(drop_record()).warnings == ()
    slow = evaluate(drop_record(step=1.25e-4))
    assert any("needs at least 10 kHz" in line for line in slow.warnings)
    slower = evaluate(drop_record(step=5e-4))
    assert any("no CFC 1000 values" in line for line in slower.warnings)
    assert "peak_g_cfc1000" not in slower.criteria and slower.peak_g.value > 190


@pytest.mark.parametrize(
    ("factor", "words"), [(1 / G, "looks like g where m/s\\^2 is meant"), (G, "larger than m/s")]
)
@pytest.mark.parametrize("peak_g", [20.0, 200.0])
def test_an_acceleration_in_the_wrong_unit_is_given_away_by_the_velocity(
    factor: float, words: str, peak_g: float
) -> None:
    record = drop_record(peak_g=peak_g)
    wrong = replace(record, head_acceleration=record.head_acceleration * factor)
    with pytest.raises(PulseError, match=f"head_acceleration: {words}"):
        evaluate(wrong)


def test_a_record_shorter_than_3_ms_has_no_clip() -> None:
    result = evaluate(drop_record(length=0.002, duration=0.0025))
    assert "clip_3ms" not in result.criteria
    assert any("shorter than 3 ms" in line for line in result.warnings)


@pytest.mark.parametrize("step", [1e-4, 5e-5, 1e-3 / 15])
def test_a_record_of_just_3_ms_has_a_clip(step: float) -> None:
    whole = drop_record(length=0.01, step=step, duration=0.003)
    lowest = np.linalg.norm(whole.head_acceleration, axis=1).min() / G
    assert evaluate(whole).clip_3ms.value == pytest.approx(lowest, abs=1e-9)
    shorter = drop_record(length=0.01, step=step, duration=0.003 - step)
    assert "clip_3ms" not in evaluate(shorter).criteria


def test_rotation_is_judged_in_head_axes() -> None:
    """The same motion of the head, whatever way it faces in the world."""
    time = drop_record().time
    omega = np.outer(np.sin(np.pi * time / time[-1]) ** 2, [30.0, 10.0, 5.0])
    alpha = np.gradient(omega, time, axis=0)
    results = []
    for turn in (Rotation.identity(), Rotation.from_euler("xyz", [20, -50, 130], degrees=True)):
        record = replace(
            drop_record(),
            head_orientation=np.tile(turn.as_quat(), (len(time), 1)),
            head_angular_velocity=turn.apply(omega),
            head_angular_acceleration=turn.apply(alpha),
        )
        results.append(evaluate(record))
    for name in ("bric", "bric_mps", "bric_csdm", "ubric", "damage", "ric"):
        first, second = (r.criteria[name].value for r in results)
        assert first > 0 and second == pytest.approx(first, rel=1e-9), name
    first = results[0]
    assert first.damage.value == pytest.approx(damage(alpha, 5e-5))
    assert first.ric.value == pytest.approx(ric(alpha, 5e-5).value)
    assert first.ubric.value == pytest.approx(ubric(omega, alpha))
    assert first.klc.value == pytest.approx(
        klc(first.peak_angular_velocity.value, first.hic36.value)
    )
    assert first.risk_bric_ais3.value == pytest.approx(risk_bric(first.bric_mps.value, 3))
    assert first.bric.value == pytest.approx(np.hypot(np.hypot(30 / 66.25, 10 / 56.45), 5 / 42.87))


def test_a_record_names_its_columns_and_their_units_as_they_are() -> None:
    record = drop_record()
    shell = np.arange(3.0 * len(record.time)).reshape(-1, 3)
    for whole, further in (
        (record, []), (replace(record, extras={SHELL: shell, "notes": ["x"]}), ["x", "y", "z"]),
    ):  # fmt: skip
        block, labels = to_block(whole), whole.labels
        assert block.shape[1] == len(labels) == len(whole.units)
        assert [name for name in labels if name.startswith(SHELL)] == [
            f"{SHELL}.{axis}" for axis in further
        ]
        units = dict(zip(labels, whole.units, strict=True))
        assert (units["time"], units["head_acceleration.x"]) == ("s", "m/s^2")
        assert {units[name] for name in labels if name.startswith(SHELL)} <= {"m"}
    assert block[:, labels.index(f"{SHELL}.y")].tolist() == shell[:, 1].tolist()


def test_helmet_and_neck_criteria_come_from_their_channels() -> None:
    record = drop_record()
    pulse = record.ground_force[:, 2]
    record.coupling_force[:, 1] = -pulse
    record.neck_force[:, 2] = -0.5 * pulse
    record.neck_force[:, 0] = 0.1 * pulse
    record.neck_torque[:, 1] = 0.01 * pulse
    setup = {"helmet.liner.thickness": 0.04}
    result = evaluate(replace(record, setup=setup))
    assert result.bottoming.value == pytest.approx(0.5)
    assert result.energy_peak.value == pytest.approx(0.5 * pulse.max() * 0.02, rel=1e-3)
    assert result.energy_absorbed.value == pytest.approx(0.0, abs=1e-6)
    assert result.restitution.value == pytest.approx(1.0)
    assert result.peak_neck_axial.value == pytest.approx(0.5 * pulse.max())
    assert result.peak_neck_axial.note == "tension"
    assert result.peak_neck_compression.value == 0.0
    assert result.peak_neck_shear.value == pytest.approx(0.1 * pulse.max())
    assert result.peak_neck_bending.value == pytest.approx(0.01 * pulse.max())
    assert result.impulse_ratio.value == pytest.approx(0.3)
    record.neck_force[:, 2] *= -0.5
    pressed = evaluate(replace(record, setup=setup))
    assert pressed.peak_neck_axial.note == "compression"
    assert pressed.peak_neck_axial.value == pressed.peak_neck_compression.value
    assert pressed.peak_neck_compression.value == pytest.approx(0.25 * pulse.max())


def test_every_risk_says_that_it_is_informative() -> None:
    result = evaluate(drop_record())
    risks = [c for name, c in result.criteria.items() if name.startswith("risk_")]
    assert len(risks) == 14
    assert all(c.note.startswith("informative: derived from") for c in risks)
    assert all(0.0 <= c.value <= 1.0 for c in risks)
    long = evaluate(drop_record(peak_g=60.0, length=0.05, duration=0.06))
    assert long.hic15.value < 0.9 * long.hic36.value
    assert long.risk_skull_fracture.value == pytest.approx(risk_lognormal(long.hic15.value, 2))
    assert long.klc.value == pytest.approx(klc(0.0, long.hic36.value))
    assert long.risk_hic_fatal.value == pytest.approx(risk_prasad_mertz(long.hic15.value, 6))


@pytest.mark.parametrize("length", [0.010, 0.040, 0.080])
def test_every_hic_window_is_that_of_the_function(length: float) -> None:
    record = drop_record(peak_g=80.0, length=length, duration=0.1, step=1e-4)
    result = evaluate(record)
    acceleration = record.head_acceleration / G
    for name, window in (("hic", None), ("hic15", 0.015), ("hic36", 0.036)):
        value, t1, t2 = hic(acceleration, 1e-4, window)
        criterion = result.criteria[name]
        assert criterion.value == pytest.approx(value, rel=1e-12), name
        assert criterion.window == pytest.approx((t1, t2), abs=1e-12)
    assert result.sfc.value == pytest.approx(sfc(acceleration, 1e-4).value)
    assert result.gsi.value == pytest.approx(gsi(acceleration, 1e-4))


def test_evaluation_is_deterministic_and_leaves_the_record_alone() -> None:
    record, untouched = drop_record(), drop_record()
    assert evaluate(record).to_json() == evaluate(record).to_json()
    assert same_samples(record, untouched)
