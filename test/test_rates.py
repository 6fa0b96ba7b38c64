"""Several rates: the same motion as at a single one, at a fraction of the large steps."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.errors import DivergedError, SetupError
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup

#: Peaks that a study asks for, and how far they may be from those of a single rate [-]. The peak of
#: a head over a shell that chatters on a kerb differs by 2.8e-3 with the shortest large steps.
CLOSE = {
    "peak_g": 4e-3, "hic": 3e-3, "peak_normal_force": 3e-3, "peak_angular_acceleration": 1e-2,
    "peak_neck_compression": 1e-2,
}  # fmt: skip


def impact_of(rates: str, form: str = "spring", **values: object) -> Impact:
    overrides = {"sim.rates": rates, "helmet.coupling": form}
    return Impact(ImpactSetup(**{"tangential_velocity": 5.0, **values}, overrides=overrides))  # type: ignore[arg-type]


def finished(impact: Impact) -> Impact:
    impact.advance(impact.total)
    return impact


def fixed(impact: Impact, length: float) -> Impact:
    """The same with large steps of one length [s]."""
    carrier = impact._rates.carrier._replace(tolerance=1.0, longest=length)
    impact._rates = impact._rates._replace(carrier=carrier)
    carrier.steps[1] = round(length / impact.model.opt.timestep)
    return impact


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize(
    "values",
    [
        {"rig": "rider", "normal_velocity": 7.5},
        {"rig": "headform", "direction": "front"},
        {"rig": "rider", "direction": "back", "surface": "kerbstone"},
    ],
)
def test_peaks_are_those_of_a_single_rate(form: str, values: dict[str, object]) -> None:
    fine = {"time_step": 1e-5, **values}
    several = evaluate(finished(impact_of("several", form, **fine)).record()).criteria
    single = evaluate(finished(impact_of("single", form, **fine)).record()).criteria
    for name, close in CLOSE.items():
        expected = single[name].value
        if expected:
            assert several[name].value == pytest.approx(expected, rel=close), name


def test_the_error_falls_with_the_square_of_the_large_step() -> None:
    """Before the neck meets its stops, where the motion is smooth."""

    def state(length: float) -> np.ndarray:
        impact = fixed(impact_of("several", duration=0.0048, time_step=2.5e-5), length)
        return finished(impact)._rows.qvel[-1]

    exact = state(2.5e-5)
    errors = [np.abs(state(length) - exact).max() for length in (8e-4, 4e-4, 2e-4)]
    assert errors[0] > 2.5 * errors[1] > 6.0 * errors[2] > 0.0


def test_large_steps_adapt_to_the_blow() -> None:
    impact = impact_of("several")
    lengths = set()
    while impact.done_samples < impact.total:
        impact.advance(1)
        lengths.add(int(impact._rates.carrier.steps[1]))
    assert min(lengths) <= 2
    assert max(lengths) == 8  # 0.4 ms of 50 us


@pytest.mark.parametrize("form", ["spring", "foam"])
def test_large_steps_are_long_where_only_their_length_changes(form: str) -> None:
    """The mean damping of a step is less the longer it is, which is no error of either."""
    impact = impact_of("several", form, normal_velocity=7.5, direction="left")
    steps = set()
    while impact.done_samples < impact.total:
        impact.advance(1)
        steps.add(int(impact._rates.carrier.steps[0]))
    assert len(steps) < 300  # of 801 samples; 242 and 220


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("samples", [1, 37])
def test_slices_of_any_length_give_the_same_bits(form: str, samples: int) -> None:
    whole = finished(impact_of("several", form, duration=0.01))
    sliced = impact_of("several", form, duration=0.01)
    seen = []
    while sliced.done_samples < sliced.total:
        before = sliced.done_samples
        after = sliced.advance(samples)
        assert after == min(before + samples, sliced.total)
        seen.append(sliced._rows.sensors[before:after].copy())
    assert (np.concatenate(seen) == whole._rows.sensors).all()  # finished is final
    for ours, theirs in zip(whole._rows, sliced._rows, strict=True):
        assert (ours == theirs).all()


@pytest.mark.parametrize("rig", ["rider", "headform"])
@pytest.mark.parametrize("form", ["spring", "foam"])
def test_momentum_changes_by_the_impulse(rig: str, form: str) -> None:
    checked = balance(finished(impact_of("several", form, rig=rig, normal_velocity=7.5)))
    assert checked.momentum_error < 2e-3
    assert checked.mechanical[-1] < 0.95 * checked.mechanical[0]


@pytest.mark.parametrize("form", ["spring", "foam"])
def test_head_and_helmet_stand_where_their_joints_say(form: str) -> None:
    impact = finished(impact_of("several", form, normal_velocity=7.5))
    model, layout = impact.model, impact.layout
    data, sensors = mujoco.MjData(model), impact._rows.sensors
    for i, (position, velocity) in enumerate(impact.states()):
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_forward(model, data)
        row = sensors[i : i + 1]
        assert layout.read(row, "head_position")[0] == pytest.approx(
            data.body("head").xpos, abs=2e-6
        )
        turn = abs(layout.read(row, "helmet_orientation")[0] @ data.body("helmet").xquat)
        assert turn == pytest.approx(1.0, abs=1e-8)
        spin = layout.read(row, "head_angular_velocity")[0]
        moved = data.sensor("head_angular_velocity").data
        assert spin == pytest.approx(moved, abs=0.02 + 2e-3 * np.linalg.norm(moved))


def test_the_neck_carries_what_moves_the_head() -> None:
    several = finished(impact_of("several", time_step=1e-5)).record()
    single = finished(impact_of("single", time_step=1e-5)).record()
    for ours, theirs in (
        (several.neck_force, single.neck_force),
        (several.neck_torque, single.neck_torque),
    ):
        largest = np.linalg.norm(theirs, axis=1).max()
        assert np.abs(ours - theirs).max() < 0.02 * largest


def test_the_neck_does_not_carry_what_shoulders_push_the_helmet_with() -> None:
    crown = {"direction": "top", "normal_velocity": 3.0, "tangential_velocity": 0.0}
    single, several = (
        finished(Impact(ImpactSetup(rates=r, **crown))).record() for r in ("single", "several")
    )
    for load in ("neck_force", "neck_torque"):
        theirs = getattr(single, load)
        apart = np.abs(getattr(several, load) - theirs).max()
        assert apart < 0.1 * np.linalg.norm(theirs, axis=1).max()


def test_a_diverging_impact_says_so() -> None:
    setup = ImpactSetup(overrides={
        "helmet.shell.contact_stiffness": 1e8, "helmet.shell.effective_mass": 1e-5,
        "sim.rates": "several",
    })  # fmt: skip
    with pytest.raises(DivergedError):
        finished(Impact(setup))


def test_an_unknown_value_is_refused_by_name() -> None:
    with pytest.raises(SetupError, match=r"rates.*'fast'.*several.*single"):
        ImpactSetup(overrides={"sim.rates": "fast"})


@pytest.mark.parametrize(("rates", "behind"), [("single", 0.5), ("several", 0.0)])
def test_velocities_are_as_far_behind_positions_as_a_record_says(rates, behind):
    impact = finished(impact_of(rates, rig="headform", duration=0.01))
    record, step = impact.record(), impact.model.opt.timestep
    path, speed = record.head_position[:, 2], record.head_velocity[:, 2]
    acceleration = record.head_acceleration[1:-1, 2]
    pulse = acceleration > 0.5 * acceleration.max()
    central = (path[2:] - path[:-2]) / (
        2.0 * impact.setup.time_step
    )  # of the middle sample's instant
    late = (central - speed[1:-1])[pulse] / acceleration[pulse]
    assert np.median(late) == pytest.approx(behind * step, abs=0.01 * step)
