"""The neck: levels in series, a yielding axis, a cone of motion, no singular pose."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.force import neck as law
from helmet_sim_ros.model.force.bodies import motion_of, no_loads
from helmet_sim_ros.model.force.neck import CervicalSpine, stored_energy
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.rider import neck as neck_module
from helmet_sim_ros.model.rider.neck import JOINTS, LEVELS, named_today
from helmet_sim_ros.model.rider.properties import Neck, Rider
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_log, setup_from_names
from helmet_sim_ros.study.sled import mounted_neck, sled, sled_tests

Load = Callable[[float], tuple[np.ndarray, np.ndarray]]  # time [s] -> force [N], moment [N m]
NOTHING = np.zeros(3)


def test_the_levels_are_all_there() -> None:
    assert sum(levels for levels, _ in JOINTS.values()) == LEVELS == 8
    whole = np.sum([ranges for _, ranges in JOINTS.values()], axis=0)
    assert whole == pytest.approx([65.0, 75.0, 45.0, 75.0], abs=0.5)


def loaded(neck: Neck, load: Load, duration: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Head and neck on a thorax at rest, no gravity, a load on the head's centre of gravity."""
    model, spine = mounted_neck(Rider(neck=neck))
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    head = model.body("head").id
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step1(model, data)
        data.qfrc_applied[:] = torques(model, data, spine)
        data.xfrc_applied[head] = np.concatenate(load(data.time))
        mujoco.mj_step2(model, data)
    mujoco.mj_kinematics(model, data)
    return model, data


def torques(model: mujoco.MjModel, data: mujoco.MjData, spine: CervicalSpine) -> np.ndarray:
    """Generalised forces of the neck in the present state."""
    loads = no_loads(model)
    law.apply(spine, motion_of(data), loads)
    return loads.generalised


@pytest.mark.parametrize(
    ("moment", "name"),
    [
        ((0.0, 5.0, 0.0), "flexion"),
        ((0.0, -5.0, 0.0), "extension"),
        ((4.0, 0.0, 0.0), "lateral"),
        ((0.0, 0.0, 4.0), "torsion"),
    ],
)
def test_a_moment_turns_the_head_by_the_sum_of_the_levels(
    moment: tuple[float, float, float], name: str
) -> None:
    neck = Neck(
        flexion_per_level=80.0, extension_per_level=110.0, lateral_per_level=95.0,
        torsion_per_level=60.0, rotation_damping_per_level=10.0,
    )  # fmt: skip
    per_level = getattr(neck, f"{name}_per_level")
    _, data = loaded(neck, lambda _: (NOTHING, np.array(moment)), 2.0)
    turned = Rotation.from_quat(data.body("head").xquat[[1, 2, 3, 0]]).as_rotvec()
    assert turned == pytest.approx(LEVELS * np.array(moment) / per_level, abs=2e-3)


@pytest.mark.parametrize(("force", "name"), [(400.0, "tension"), (-400.0, "compression")])
def test_a_force_along_the_neck_meets_its_levels_in_series(
    monkeypatch: pytest.MonkeyPatch, force: float, name: str
) -> None:
    straighten(monkeypatch)
    model, data = loaded(Neck(), lambda _: (np.array([0.0, 0.0, force]), NOTHING), 1.5)
    length = data.qpos[int(model.joint("neck_axial").qposadr[0])]
    per_level = getattr(Neck(), f"{name}_per_level")
    assert length == pytest.approx(LEVELS * force / per_level, rel=1e-3)


def straighten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Head above the neck above the thorax: what is axial stays axial."""
    monkeypatch.setattr(neck_module, "HEAD_FORWARD", 0.0)
    monkeypatch.setattr(neck_module, "BOW", 0.0)


def test_a_neck_pressed_beyond_the_plateau_keeps_what_it_yielded() -> None:
    model, spine = mounted_neck(Rider())
    elastic = spine.plateaus[0] / spine.compression
    presses = np.concatenate([np.linspace(0.0, 0.08, 200), np.linspace(0.08, 0.0, 200)])
    forces = [law.axial_force(spine, -s, 0.0) for s in presses]
    assert max(forces) == pytest.approx(Neck().compression_plateau)
    assert forces[20] == pytest.approx(spine.compression * presses[20])
    assert spine.yielded[0] == pytest.approx(0.08 - elastic, rel=1e-6)
    # Pulled back to its old length, it is in tension by what it lost.
    assert forces[-1] == pytest.approx(-spine.tension * spine.yielded[0])
    work = np.trapezoid(forces, presses)
    stored = 0.5 * spine.tension * spine.yielded[0] ** 2
    positions = np.tile(model.qpos0, (len(presses), 1))
    positions[:, spine.slide[0]] = -presses
    history = stored_energy(spine, positions)
    assert history[200] == pytest.approx(0.5 * spine.plateaus[0] * elastic, rel=1e-3)
    assert history[-1] == pytest.approx(stored, rel=1e-6)
    assert work - stored == pytest.approx(spine.plateaus[0] * (0.08 - elastic), rel=1e-3)


def test_a_neck_drawn_out_yields_too() -> None:
    _, spine = mounted_neck(Rider())
    forces = [law.axial_force(spine, s, 0.0) for s in np.linspace(0, 0.2, 99)]
    assert min(forces) == pytest.approx(-Neck().tension_plateau)
    assert spine.yielded[0] < 0.0


def test_the_free_neck_swings_along_its_axis_as_its_closed_form(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    straighten(monkeypatch)
    neck = Neck(tension_per_level=4e5, compression_per_level=4e5)
    model, spine = mounted_neck(Rider(neck=neck))
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    place = int(model.joint("neck_axial").qposadr[0])
    data.qpos[place] = 1e-3
    swing = []
    for _ in range(800):
        mujoco.mj_step1(model, data)
        data.qfrc_applied[:] = torques(model, data, spine)
        swing.append(data.qpos[place])
        mujoco.mj_step2(model, data)
    mass = model.body("head").mass[0] + model.body("neck_upper").mass[0]
    stiffness, damping = 4e5 / LEVELS, neck.axial_damping_per_level / LEVELS
    decay = 0.5 * damping / mass
    period = 2.0 * np.pi / np.sqrt(stiffness / mass - decay**2)
    motion = np.array(swing)
    first = int(period / model.opt.timestep * 0.6)
    peak = first + int(motion[first:].argmax())
    assert peak * model.opt.timestep == pytest.approx(period, rel=0.01)
    assert motion[peak] / motion[0] == pytest.approx(np.exp(-decay * period), rel=0.02)


def test_the_torques_are_the_slope_of_the_stored_energy() -> None:
    """Random poses, within and beyond the cone, and a posture at rest that is not straight."""
    model, _ = mounted_neck(Rider())
    neck_module.set_rest(model, 0.7)
    spine = neck_module.cervical_spine(model, Rider().neck)
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    beyond = 0
    for _ in range(200):
        qpos = model.qpos0.copy()
        for first in spine.qpos:
            turn = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3))
            qpos[first : first + 4] = turn.as_quat()[[3, 0, 1, 2]]
            bend = turn.as_rotvec()
            beyond += law.bending_excess(tuple(bend), spine.ranges[0])[0] > 0.0
        rates = rng.normal(0.0, 1.0, model.nv)
        rates[spine.slide[1]] = 0.0
        data.qpos[:] = qpos
        torque = torques(model, data, spine)
        energies = []
        for sense in (-1.0, 1.0):
            moved = qpos.copy()
            mujoco.mj_integratePos(model, moved, sense * rates, 1e-6)
            energies.append(stored_energy(spine, moved[None, :])[0])
        slope = (energies[1] - energies[0]) / 2e-6
        assert torque @ rates == pytest.approx(-slope, rel=1e-4, abs=1e-4)
    assert beyond > 50


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), [[0.6, 0.0, 0.8], [0.48, 0.6, 0.64]]]))
def test_no_pose_is_singular(axis: np.ndarray) -> None:
    """Each joint through a whole turn about any axis: torques stay finite and steady but for the
    half turn, where the shorter way back changes sides."""
    model, spine = mounted_neck(Rider())
    data, found = mujoco.MjData(model), []
    angles = np.linspace(0.0, 2.0 * np.pi, 2001)
    for angle in angles:
        data.qpos[:] = model.qpos0
        for first in spine.qpos:
            data.qpos[first] = np.cos(0.5 * angle)
            data.qpos[first + 1 : first + 4] = np.sin(0.5 * angle) * axis
        found.append(torques(model, data, spine))
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    size = np.linalg.norm(found, axis=1).max()
    assert np.isfinite(found).all()
    half = np.abs(0.5 * (angles[1:] + angles[:-1]) - np.pi) < 0.01
    assert steps[~half].max() < 0.01 * size
    assert [np.linalg.norm(found[i]) for i in (0, -1)] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("moment", [(0.0, 60.0, 0.0), (0.0, -60.0, 0.0), (60.0, 0.0, 0.0)])
def test_the_cone_of_motion_holds_the_head(moment: tuple[float, float, float]) -> None:
    """A moment that hurts (McGill et al. 1994: volunteers bear less than 10 N m) passes the whole
    neck's range by no more than a third."""
    neck = Neck(rotation_damping_per_level=10.0)
    _, data = loaded(neck, lambda time: (NOTHING, np.array(moment) * min(1.0, time)), 2.5)
    turned = Rotation.from_quat(data.body("head").xquat[[1, 2, 3, 0]]).magnitude()
    column = 2 if moment[0] else (0 if moment[1] > 0.0 else 1)
    limit = sum(ranges[column] for _, ranges in JOINTS.values())
    assert limit < np.degrees(turned) < 1.67 * limit


@pytest.mark.parametrize("speed", [2.0, 3.2, 5.0])
def test_a_rider_dropped_on_the_crown_has_a_neck_that_yields(speed: float) -> None:
    """Cadavers' necks fail between 2 and 4 kN (docs/model.md)."""
    impact = Impact(
        ImpactSetup(
            direction="top", body_angle_deg=90.0, normal_velocity=speed,
            overrides={"helmet.coupling": "foam"},
        )
    )  # fmt: skip
    impact.advance(impact.total)
    record, checked = impact.record(), balance(impact)
    assert 2000.0 < record.neck_force[:, 2].max() < 4500.0
    assert any("yielded" in note for note in record.extras["notes"])
    assert checked.momentum_error < 5e-3
    assert checked.energy_growth < 2e-3


def test_a_buckling_neck_bends_to_both_sides() -> None:
    """Extension in the middle over flexion below (Nightingale et al. 1996)."""
    setup = ImpactSetup(
        direction="top", body_angle_deg=90.0, normal_velocity=3.2,
        overrides={"helmet.coupling": "foam"},
    )  # fmt: skip
    impact = Impact(setup)
    impact.advance(impact.total)
    record = impact.record()
    bend = dict(zip(record.joint_names, np.degrees(record.joint_positions.T), strict=True))
    at = round(0.02 / record.time_step)
    assert bend["neck_middle.y"][at] < -8.0
    assert bend["neck_lower.y"][at] > 1.0 and bend["neck_upper.y"][at] > 5.0


@pytest.mark.parametrize(("coupling", "speed"), [("foam", 10.0), ("spring", 25.0)])
def test_a_hard_side_impact_on_an_upright_body_does_not_lock_the_neck(
    coupling: str, speed: float
) -> None:
    setup = ImpactSetup(
        direction="left", normal_velocity=speed, tangential_velocity=15.0, body_angle_deg=85.0,
        tangential_heading_deg=-60.0, overrides={"helmet.coupling": coupling},
    )  # fmt: skip
    impact = Impact(setup)
    impact.advance(impact.total)
    record = impact.record()
    assert np.isfinite(record.head_acceleration).all()
    assert np.linalg.norm(record.head_velocity, axis=1).max() < 60.0
    assert any("beyond its range" in note for note in record.extras["notes"])


def test_a_posture_at_rest_carries_no_torque() -> None:
    setup = ImpactSetup(direction="top", body_angle_deg=30.0, gravity=0.0)
    impact = Impact(setup)
    impact.advance(1)
    record = impact.record()
    names = [f"{joint}.y" for joint in JOINTS]
    flexion = [record.joint_positions[0, record.joint_names.index(name)] for name in names]
    assert np.degrees(sum(flexion)) == pytest.approx(60.0)
    assert stored_energy(impact.neck, np.array([q for q, _ in impact.states()]))[0] < 1e-9


def test_the_recorded_rotation_vectors_pose_the_same_neck() -> None:
    impact = Impact(ImpactSetup(tangential_velocity=8.0))
    impact.advance(impact.total)
    record, layout = impact.record(), impact._layout
    position, _ = list(impact.states())[-1]
    posed = position.copy()
    posed[7:] = 0.0
    layout.pose(posed, record.joint_names, record.joint_positions[-1])
    named = [name for name in record.joint_names if name.startswith("neck_upper.")]
    assert len(named) == 3
    for first in impact.neck.qpos:
        ours, recorded = position[first : first + 4], posed[first : first + 4]
        assert recorded * np.sign(recorded[0]) == pytest.approx(ours * np.sign(ours[0]), abs=1e-12)


@pytest.mark.parametrize(
    "name",
    ["axial_stiffness", "axial_damping", "bending_stiffness", "torsion_stiffness", "damping"],
)
def test_a_name_of_the_former_neck_is_refused_by_name_and_only_a_log_may_have_it(
    name: str,
) -> None:
    values = {f"rider.neck.{name}": 10.0}
    with pytest.raises(
        SetupError, match=rf"rider\.neck\.{name} = 10\.0: no longer acts.*per_level"
    ):
        setup_from_names(values)
    with pytest.raises(SetupError, match=rf"{name} = 10\.0: no longer acts"):
        Neck(**{name: 10.0})
    setup, notes = setup_from_log({**values, "impact.normal_velocity": 6.0})
    assert setup.normal_velocity == 6.0
    assert f"rider.neck.{name}" in notes[0]
    assert setup_from_log({"impact.normal_velocity": 6.0})[1] == ()


def test_the_hinges_of_a_former_log_become_the_same_rotation() -> None:
    angles = {"flexion": 0.3, "lateral": -0.2, "rotation": 0.25}
    names = tuple(f"neck_{at}_{turn}" for at in ("lower", "upper") for turn in angles)
    joints, values = named_today(("neck_axial", *names), np.array([0.004, *2 * [*angles.values()]]))
    found = dict(zip(joints, values, strict=True))
    assert found["neck_axial"] == 0.004
    hinged = (
        Rotation.from_rotvec([0.0, 0.3, 0.0])
        * Rotation.from_rotvec([-0.2, 0.0, 0.0])
        * Rotation.from_rotvec([0.0, 0.0, 0.25])
    )
    for at in ("lower", "upper"):
        turned = [found[f"neck_{at}.{axis}"] for axis in "xyz"]
        assert turned == pytest.approx(hinged.as_rotvec())


def test_a_braked_sled_throws_the_head_forwards_within_its_range() -> None:
    """15 g, 61 km/h, the hardest frontal test of volunteers; theirs tensed, so theirs turn less."""
    test = next(test for test in sled_tests() if test.name == "frontal_15g")
    assert test.response is not None
    response = sled(Rider(), test.pulse(0.3))
    flexion = np.degrees(response.rotation[:, 1])
    assert test.response.rotation_deg[0] < flexion.max() < 1.15 * test.response.rotation_deg[1]
    assert np.abs(response.rotation[:, [0, 2]]).max() < 1e-6
    peak = np.linalg.norm(response.acceleration, axis=1).max() / 9.80665
    assert 20.0 < peak < 40.0
    # What the neck gave is what the head gained, world axes.
    turn = Rotation.from_rotvec(response.rotation)
    force = turn.apply(response.neck_force) + 4.5 * np.array([0.0, 0.0, -9.80665])
    assert force == pytest.approx(4.5 * response.acceleration, abs=1e-6 * np.abs(force).max())


def test_a_sled_pushed_to_the_side_bends_the_head_to_the_other() -> None:
    test = next(test for test in sled_tests() if test.axis == "y")
    response = sled(Rider(), test.pulse(0.2))
    assert test.pulse(0.2)[:, 1].sum() * 1e-4 == pytest.approx(test.speed_change, rel=1e-3)
    assert response.displacement[:, 1].min() < -0.1  # T1 goes left, the head stays
    assert np.degrees(response.rotation[:, 0]).max() > 44.0


def test_a_sled_wants_three_finite_components() -> None:
    with pytest.raises(SetupError, match="acceleration"):
        sled(Rider(), np.zeros(10))
    with pytest.raises(SetupError, match="acceleration"):
        sled(Rider(), np.full((10, 3), np.nan))


def test_constants_of_a_model_without_rider_are_those_of_no_neck() -> None:
    neck = Impact(ImpactSetup(rig="headform")).neck
    assert len(neck.qpos) == 0 and neck.rest.shape == (0, 4)
