"""Measured pulses: the same numbers as a simulated impact, and no wrong unit or column by guess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helmet_sim_ros.biomech import MeasuredPulse, evaluate, read_pulse
from helmet_sim_ros.errors import PulseError

STEP = 5e-5
TIME = np.arange(400) * STEP
PULSE = np.where(TIME < 0.008, 1500.0 * np.sin(np.pi * TIME / 0.008), 0.0)  # m/s^2
ACCELERATION = np.column_stack([PULSE, 0.2 * PULSE, -0.1 * PULSE])
SPIN = np.column_stack([0.0 * TIME, 30.0 * np.sin(np.pi * TIME / 0.02), 0.0 * TIME])


def write(path, header, columns, separator=",", decimal=".", above=""):
    rows = [separator.join(f"{value:.9g}".replace(".", decimal) for value in row)
            for row in np.column_stack(columns)]  # fmt: skip
    path.write_text(above + "\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def test_what_was_measured_gives_the_criteria_of_a_record_with_the_same_samples():
    from helmet_sim_ros import ImpactSetup, simulate

    record = simulate(ImpactSetup(rig="headform", normal_velocity=6.0, duration=0.02))
    pulse = MeasuredPulse(record.time, record.head_acceleration)
    whole, part = evaluate(record).criteria, evaluate(pulse).criteria
    assert {"peak_g", "hic", "hic15", "hic_cfc1000", "clip_3ms", "gsi", "velocity_change"} <= set(
        part
    )
    for name, criterion in part.items():
        assert criterion == whole[name], name


def test_a_standard_judges_a_measured_pulse_and_the_speed_is_compared():
    pulse = MeasuredPulse(TIME, ACCELERATION, normal_velocity=7.5)
    assert evaluate(pulse, "ece_r22_06_linear_medium").verdict == "pass"
    harder = replace(pulse, acceleration=2.2 * ACCELERATION, normal_velocity=6.0)
    result = evaluate(harder, "ece_r22_06_linear_medium")
    assert result.verdict == "fail"
    assert any("the impact was at 6 m/s" in text for text in result.warnings)


def test_what_was_not_measured_is_left_out_and_said_and_a_limit_on_it_is_refused():
    result = evaluate(MeasuredPulse(TIME, ACCELERATION))
    assert not {"bric", "force_ratio", "peak_neck_axial", "restitution"} & set(result.criteria)
    assert any("angular velocity was not measured" in text for text in result.warnings)
    with pytest.raises(PulseError, match=r"limits it.*angular acceleration was not measured"):
        evaluate(MeasuredPulse(TIME, ACCELERATION, SPIN), "ece_r22_06_oblique")
    spun = MeasuredPulse(TIME, ACCELERATION, SPIN, 100.0 * SPIN)
    assert evaluate(spun, "ece_r22_06_oblique").bric.value == pytest.approx(30.0 / 56.45, rel=1e-4)


@pytest.mark.parametrize(
    "kind", ["brackets", "row of units", "semicolon", "tab", "renamed", "m/s²"]
)
def test_the_same_pulse_is_read_from_every_kind_of_file(tmp_path, kind):
    path, g = tmp_path / "a.csv", ACCELERATION.T / 9.80665
    plain = "time,acceleration_x,acceleration_y,acceleration_z"
    names = "time [ms],acceleration_x [g],acceleration_y [g],acceleration_z [g]"
    options = {}
    if kind == "brackets":
        write(path, names, [TIME * 1e3, *g], above="# from the laboratory\n\n")
    elif kind == "row of units":
        write(path, f"{plain}\ns,g,g,g", [TIME, *g])
    elif kind == "semicolon":
        write(path, names.replace(",", ";"), [TIME * 1e3, *g], ";", ",")
    elif kind == "tab":
        write(path, names.replace(",", "\t"), [TIME * 1e3, *g], "\t")
    elif kind == "renamed":
        write(path, "T (s),AX (g),AY (g),AZ (g)", [TIME, *g])
        options = {"columns": {"time": "T", "acceleration_x": "ax", "acceleration_y": "AY",
                               "acceleration_z": "AZ"}}  # fmt: skip
    else:
        write(path, names.replace("[g]", "[m/s²]"), [TIME * 1e3, *ACCELERATION.T])
    pulse = read_pulse(path, **options)
    assert np.allclose(pulse.time, TIME, rtol=0, atol=1e-9)
    assert np.allclose(pulse.acceleration, ACCELERATION, atol=1e-4)


def test_rotation_and_a_single_axis_are_read(tmp_path):
    header = ("time [s],acceleration [m/s^2],angular_velocity_x [rad/s],angular_velocity_y [deg/s],"
              "angular_velocity_z [rad/s]")  # fmt: skip
    path = write(tmp_path / "a.csv", header,
                 [TIME, PULSE, SPIN[:, 0], np.degrees(SPIN[:, 1]), SPIN[:, 2]])  # fmt: skip
    pulse = read_pulse(path, normal_velocity=6.0)
    assert pulse.acceleration.shape == (400,) and pulse.angular_acceleration is None
    assert np.allclose(pulse.angular_velocity, SPIN, atol=1e-6)
    assert evaluate(pulse).peak_g.value == pytest.approx(1500.0 / 9.80665, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("time [s],acceleration [g]\n", "at least 2"),
        ("time [s],acc [g]\n0,1\n1,2\n", "no column 'acceleration'; there are: time, acc"),
        ("time [s],acceleration\n0,1\n1,2\n", "column 'acceleration': no unit; must be one of g"),
        ("time [h],acceleration [g]\n0,1\n1,2\n", "column 'time': unit 'h'"),
        ("time [s],acceleration [g]\n0,1\n1,x\n", "line 3, column 'acceleration': 'x'"),
        ("time [s],acceleration [g]\n0,1\n1\n", "line 3, column 'acceleration': ''"),
        ("time [s],acceleration [g]\n0,1\n1,nan\n", "acceleration: not finite"),
        ("time [s],acceleration [g]\n0,1\n0,2\n", "time: must increase"),
        ("time [s],time [s],acceleration [g]\n0,0,1\n1,1,2\n", "'time' is there 2 times"),
        ("time [s],acceleration_x [g]\n0,1\n1,2\n", "no column 'acceleration_y'"),
        ("time [ms],acceleration [g]\n0,2000\n10,2500\n20,0\n", "no head impact in g"),
    ],
)
def test_a_bad_file_is_refused_with_what_is_wrong_and_where(tmp_path, text, said):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(PulseError) as refused:
        read_pulse(path)
    assert str(path) in str(refused.value) and said in str(refused.value)


def test_a_missing_file_and_an_unknown_name_are_refused(tmp_path):
    with pytest.raises(PulseError, match="cannot be read"):
        read_pulse(tmp_path / "none.csv")
    path = write(tmp_path / "a.csv", "time [s],acceleration [g]", [TIME, PULSE / 9.8])
    with pytest.raises(PulseError, match="unknown name 'accel'; known: time, acceleration,"):
        read_pulse(path, {"accel": "acceleration"})
    with pytest.raises(PulseError, match="angular_velocity: 5 samples, but time has 400"):
        MeasuredPulse(TIME, PULSE, SPIN[:5])


@pytest.mark.parametrize(
    ("quantity", "unit", "si"),
    [
        ("time", "s", 1.0), ("time", "ms", 1e-3), ("time", "us", 1e-6), ("time", "µs", 1e-6),
        ("acceleration", "g", 9.80665), ("acceleration", "m/s^2", 1.0),
        ("angular_velocity", "rad/s", 1.0), ("angular_velocity", "°/s", np.pi / 180.0),
        ("angular_acceleration", "rad/s²", 1.0), ("angular_acceleration", "krad/s^2", 1e3),
        ("angular_acceleration", "deg/s^2", np.pi / 180.0),
    ],
)  # fmt: skip
def test_every_unit_becomes_si(tmp_path, quantity, unit, si):
    units = {"time": "s", "acceleration": "m/s^2", "angular_velocity": "rad/s",
             "angular_acceleration": "rad/s^2"} | {quantity: unit}  # fmt: skip
    names = []
    for name, said in units.items():
        axes = ("_x", "_y", "_z") if name.startswith("angular") else ("",)
        names += [f"{name}{axis} [{said}]" for axis in axes]
    numbers = np.arange(5.0)
    path = write(tmp_path / "a.csv", ",".join(names), [numbers] * len(names))
    pulse = read_pulse(path)
    for name in units:
        factor = si if name == quantity else 1.0
        for column in getattr(pulse, name).reshape(5, -1).T:
            assert column == pytest.approx(factor * numbers, rel=1e-12)
