"""Whole impacts against closed forms, conservation laws and refinement."""

import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech import hic
from helmet_sim_ros.biomech.record import ImpactRecord, from_block, same_samples
from helmet_sim_ros.errors import DivergedError
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.fall.stepping import apply_forces
from helmet_sim_ros.model.force import spring
from helmet_sim_ros.model.force.bodies import (
    FORCE,
    HELMET,
    motion_of,
    no_loads,
)
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate

G = 9.80665  # m/s^2
STRIKES = [("front", 0, -1), ("back", 0, 1), ("left", 1, -1), ("right", 1, 1), ("top", 2, -1)]
OBLIQUE = [(2.5, 5.0), (5.0, 10.0), (7.5, 10.0)]


def peak_g(record: ImpactRecord) -> float:
    return float(np.linalg.norm(record.head_acceleration, axis=1).max()) / G


def nearly_ideal(stiffness: float) -> dict[str, float]:
    """Overrides: linear lossless spring, massless shell, hard ground, head firm in its helmet."""
    slope = 1e-3
    return {
        "helmet.spring.top.A": stiffness / slope,
        "helmet.spring.top.B": slope,
        "helmet.spring.energy_loss": 0.0,
        "helmet.shell.effective_mass": 0.004,
        "helmet.shell.contact_stiffness": 1e8,
        "helmet.shell.contact_damping": 0.05,
        "helmet.shell.contact_returned": 1.0,
        **FIRM,
    }


#: A padding that gives way by less than 0.5 % of the spring's stroke and rubs nothing away.
FIRM = {
    "helmet.padding.thickness": 1e-3,
    "helmet.padding.modulus": 1e7,
    "helmet.padding.damping": 0.0,
    "helmet.padding.energy_returned": 0.5,
}


@pytest.mark.parametrize(("speed", "stiffness"), [(2.5, 200e3), (6.0, 320e3)])
def test_a_linear_spring_drop_matches_its_closed_form(speed: float, stiffness: float) -> None:
    setup = ImpactSetup(
        rig="headform", direction="top", normal_velocity=speed, gravity=0.0,
        duration=0.025, time_step=2e-6, overrides=nearly_ideal(stiffness),
    )  # fmt: skip
    record = simulate(setup)
    mass = 4.5 + setup.helmet_config.mass - 0.004
    omega = math.sqrt(stiffness / mass)
    displacement = record.coupling_displacement[:, 2]
    deepest = displacement.argmin()
    end = deepest + np.flatnonzero(displacement[deepest:] >= 0.0)[0]
    acceleration = record.head_acceleration[:, 2] / G
    assert peak_g(record) == pytest.approx(speed * omega / G, rel=5e-3)
    assert record.time[end] == pytest.approx(math.pi / omega, rel=5e-3)
    assert -displacement[deepest] == pytest.approx(speed / omega, rel=5e-3)
    expected = 0.4146456495 * (speed * omega / G) ** 2.5 * math.pi / omega
    assert hic(acceleration, record.time_step).value == pytest.approx(expected, rel=5e-3)
    rebound = record.head_velocity[-1, 2]
    assert rebound == pytest.approx(speed, rel=5e-3)


@pytest.mark.parametrize("rig", ["rider", "headform"])
@pytest.mark.parametrize(("normal", "tangential"), OBLIQUE)
def test_momentum_changes_by_the_impulse_and_energy_never_grows(
    rig: str, normal: float, tangential: float
) -> None:
    impact = Impact(ImpactSetup(rig=rig, normal_velocity=normal, tangential_velocity=tangential))
    impact.advance(impact.total)
    checked = balance(impact)
    assert checked.momentum_error < 0.01
    assert checked.energy_growth < 2e-3
    assert checked.mechanical[-1] < 0.95 * checked.mechanical[0]


@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_the_head_accelerates_by_the_forces_that_act_on_it(rig: str) -> None:
    impact = Impact(ImpactSetup(rig=rig, tangential_velocity=7.0))
    impact.advance(impact.total)
    record, model = impact.record(), impact.model
    mass = model.body("head").mass[0] + model.body("helmet_rest").mass[0]
    turn = Rotation.from_quat(record.head_orientation)
    force = turn.apply(record.coupling_force + record.neck_force) + np.array([0, 0, -mass * G])
    assert np.abs(mass * record.head_acceleration - force).max() < 1e-6 * np.abs(force).max()


def test_the_recorded_velocities_are_the_derivatives_of_the_poses() -> None:
    record = simulate(ImpactSetup(tangential_velocity=5.0, time_step=1e-5))
    velocity = np.gradient(record.head_position, record.time_step, axis=0)
    assert np.abs(velocity - record.head_velocity)[5:-5].max() < 0.05
    gained = cumulative_trapezoid(record.head_acceleration, dx=record.time_step, axis=0)
    change = record.head_velocity[1:] - record.head_velocity[0]
    assert np.abs(gained - change).max() < 2e-3 * np.abs(change).max()
    turn = Rotation.from_quat(record.head_orientation)
    rate = (turn[1:] * turn[:-1].inv()).as_rotvec() / record.time_step
    assert np.abs(rate - record.head_angular_velocity[1:])[5:].max() < 0.2
    gained = cumulative_trapezoid(record.head_angular_acceleration, dx=record.time_step, axis=0)
    change = record.head_angular_velocity[1:]
    assert np.abs(gained - change).max() < 2e-3 * np.abs(change).max()


def test_the_recorded_coupling_loop_is_the_law() -> None:
    point = {"helmet.spring.bears": "point"}
    impact = Impact(ImpactSetup(tangential_velocity=5.0, time_step=2e-5, overrides=point))
    assert impact._simulation.clock.substeps == 1  # its history is in the samples
    impact.advance(impact.total)
    config = impact.helmet.spring
    first = impact.layout.slide
    slides = impact._rows.qpos[:, first : first + 3]
    virgin, force = spring.coupling_spring(config), np.zeros(3)
    for displacement, recorded in zip(slides, impact._rows.spring, strict=True):
        spring.spring_force(virgin, displacement, 0.0, force)
        assert recorded == pytest.approx(force, rel=1e-12)
    amount = np.linalg.norm(slides, axis=1)
    i = amount.argmax()
    cosines = (slides[i] / amount[i]) ** 2
    laws = [getattr(config, name) for name in ("front", "side", "top")]
    assert slides[i, 1] < 0.0  # struck on the left
    sides = [laws[0] if slides[i, 0] < 0.0 else config.back, laws[1],
             laws[2] if slides[i, 2] < 0.0 else config.strap]  # fmt: skip
    expected = sum(
        c * law.A * math.expm1(law.B * amount[i]) for c, law in zip(cosines, sides, strict=True)
    )
    assert np.linalg.norm(impact._rows.spring[i]) == pytest.approx(expected)


def test_the_recorded_displacement_is_where_the_shell_is_against_the_head() -> None:
    impact = Impact(ImpactSetup(tangential_velocity=5.0))
    impact.advance(impact.total)
    record, model = impact.record(), impact.model
    data = mujoco.MjData(model)
    for i, (position, _) in enumerate(impact.states()):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        head, shell = data.body("head"), data.body("helmet")
        against = head.xmat.reshape(3, 3).T @ (shell.xpos - head.xpos)
        assert record.coupling_displacement[i] == pytest.approx(against, abs=1e-12)
        assert record.helmet_position[i] == pytest.approx(shell.xpos, abs=1e-12)


@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_left_and_right_are_mirror_images(rig: str) -> None:
    common = {"rig": rig, "tangential_velocity": 6.0}
    left = simulate(ImpactSetup(direction="left", tangential_heading_deg=70.0, **common))
    right = simulate(ImpactSetup(direction="right", tangential_heading_deg=-70.0, **common))
    mirror, axial = np.array([1, -1, 1]), np.array([-1, 1, -1])
    scale = np.abs(left.head_acceleration).max()
    assert np.abs(left.head_acceleration - mirror * right.head_acceleration).max() < 1e-6 * scale
    assert np.abs(left.ground_force - mirror * right.ground_force).max() < 1e-2
    spin = left.head_angular_velocity - axial * right.head_angular_velocity
    assert np.abs(spin).max() < 1e-6


@pytest.mark.parametrize("direction", ["front", "back", "left", "top"])
@pytest.mark.parametrize(("normal", "tangential"), OBLIQUE)
def test_peaks_converge_with_the_time_step(
    direction: str, normal: float, tangential: float
) -> None:
    common = {
        "direction": direction, "normal_velocity": normal, "tangential_velocity": tangential,
        "duration": 0.02,
    }  # fmt: skip
    coarse = simulate(ImpactSetup(time_step=5e-5, **common))
    fine = simulate(ImpactSetup(time_step=1e-5, **common))
    assert peak_g(coarse) == pytest.approx(peak_g(fine), rel=0.01)
    assert coarse.ground_force[:, 2].max() == pytest.approx(fine.ground_force[:, 2].max(), rel=0.01)


@pytest.mark.parametrize(("form", "speed"), [("spring", 2.5), ("foam", 5.0)])
def test_a_coarser_sampling_step_does_not_change_the_motion(form: str, speed: float) -> None:
    """Where stability asks for no smaller one, the integration step stays 5e-5 s."""

    def stepped(time_step: float) -> Impact:
        impact = Impact(ImpactSetup(
            normal_velocity=speed, time_step=time_step, overrides={"helmet.coupling": form}
        ))  # fmt: skip
        impact.advance(impact.total)
        return impact

    fine, coarse = stepped(5e-5), stepped(2e-4)
    assert (fine._simulation.clock.substeps, coarse._simulation.clock.substeps) == (1, 4)
    assert np.array_equal(fine.record().head_position[::4], coarse.record().head_position)


@pytest.mark.parametrize(
    ("direction", "axis", "sense"),
    STRIKES,
)
def test_the_named_part_of_the_helmet_strikes(direction: str, axis: int, sense: int) -> None:
    record = simulate(ImpactSetup(rig="headform", direction=direction))
    displacement = record.coupling_displacement
    peak = np.abs(displacement).max(axis=0)
    assert peak.argmax() == axis
    assert sense * displacement[np.abs(displacement[:, axis]).argmax(), axis] > 0.010
    # The padding covers the head from above: it nods in its helmet, but never to the side.
    assert np.delete(peak, axis).max() < 0.2 * peak[axis]
    if axis != 1:
        assert peak[1] < 1e-9
    turn = Rotation.from_quat(record.head_orientation[0])
    strike = np.zeros(3)
    strike[axis] = -sense
    assert turn.apply(strike) == pytest.approx([0.0, 0.0, -1.0])


@pytest.mark.parametrize(("direction", "axis", "sense"), STRIKES)
def test_a_head_padded_all_round_stays_on_the_axis_of_the_blow(
    direction: str, axis: int, sense: int
) -> None:
    """No rim, no strap: the whole impact is symmetric, but for the lattice of the patches."""
    evenly = {"padding.lowest": -0.15, "padding.patches": 2000, "strap.stiffness": 0.0}
    record = simulate(ImpactSetup(
        rig="headform", direction=direction,
        overrides={f"helmet.{name}": value for name, value in evenly.items()},
    ))  # fmt: skip
    peak = np.abs(record.coupling_displacement).max(axis=0)
    assert np.delete(peak, axis).max() < 5e-3 * peak[axis]
    assert np.abs(record.head_angular_velocity).max() < 0.05  # rad/s


@pytest.mark.parametrize("angle", [0.0, 15.0, 30.0, 60.0, 90.0])
def test_the_body_axis_has_the_stated_angle_to_the_ground(angle: float) -> None:
    for direction in ("front", "back", "left", "right"):
        record = simulate(ImpactSetup(direction=direction, body_angle_deg=angle, duration=1e-3))
        up = Rotation.from_quat(record.head_orientation[0]).apply([0.0, 0.0, 1.0])
        assert math.degrees(math.asin(-up[2])) == pytest.approx(angle, abs=1e-3)
        assert up[1] == pytest.approx(0.0, abs=1e-9)


def test_all_parts_start_with_the_stated_velocity() -> None:
    setup = ImpactSetup(normal_velocity=4.0, tangential_velocity=3.0, tangential_heading_deg=30.0)
    record = simulate(setup)
    expected = [3.0 * math.cos(math.pi / 6), 1.5, -4.0]
    assert record.head_velocity[0] == pytest.approx(expected)
    assert np.all(record.joint_velocities[0] == 0.0)
    assert record.time[0] == 0.0 and len(record) == setup.samples


def test_free_flight_has_the_acceleration_of_gravity() -> None:
    """Body first: the helmet starts above the ground and the head falls freely."""
    record = simulate(ImpactSetup(body_angle_deg=0.0, normal_velocity=1.0, duration=2e-3))
    assert record.extras["notes"] and "touches the ground first" in record.extras["notes"][0]
    assert record.head_acceleration[0] == pytest.approx([0.0, 0.0, -G], abs=0.05)
    assert record.ground_force[0] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_the_loop_steps_like_mujoco(rig: str, form: str) -> None:
    """States are those of mj_step1 and mj_step2 with our forces between them, sensors those of the
    acceleration by which mj_step2 changes the velocities."""
    setup = ImpactSetup(
        rig=rig, tangential_velocity=6.0, duration=0.005, time_step=2e-5,
        overrides={"helmet.coupling": form},
    )  # fmt: skip
    impact = Impact(setup)
    model, start = impact.model, Impact(setup)
    assert impact._simulation.clock.substeps == 1
    data, told = mujoco.MjData(model), mujoco.MjData(model)
    start.advance(1)
    data.qpos[:], data.qvel[:] = next(start.states())
    impact.advance(impact.total)
    forces = Impact(setup)._simulation.forces  # with states of its own
    motion, loads = motion_of(data), no_loads(model)
    for i, (position, velocity) in enumerate(impact.states()):
        assert data.qpos == pytest.approx(position, rel=1e-9, abs=1e-12)
        assert data.qvel == pytest.approx(velocity, rel=1e-8, abs=1e-9)
        mujoco.mj_step1(model, data)
        apply_forces(forces, setup.time_step, motion, loads)
        data.qfrc_applied[:] = loads.generalised
        for body, wrench in enumerate(loads.wrenches):
            arm = data.subtree_com[1] - data.xipos[body]
            data.xfrc_applied[body] = *wrench[:3], *(wrench[3:] + np.cross(arm, wrench[:3]))
        mujoco.mj_copyData(told, model, data)
        mujoco.mj_step2(model, data)
        told.qacc[:] = (data.qvel - velocity) / setup.time_step
        mujoco.mj_rnePostConstraint(model, told)
        mujoco.mj_sensorAcc(model, told)
        assert impact._rows.sensors[i] == pytest.approx(told.sensordata, rel=1e-7, abs=1e-6)
        assert impact._rows.surface[i, HELMET, FORCE:3] == pytest.approx(
            loads.surface[HELMET, FORCE:3], rel=1e-7, abs=1e-6
        )


def test_slices_give_the_same_samples_as_one_run() -> None:
    setup = ImpactSetup(tangential_velocity=5.0, duration=0.01)
    whole, sliced = Impact(setup), Impact(setup)
    whole.advance(whole.total)
    blocks = []
    while sliced.done_samples < sliced.total:
        first = sliced.done_samples
        sliced.advance(37)
        blocks.append(sliced.block(first, sliced.done_samples))
    joined = from_block(sliced.labels, np.vstack(blocks))
    assert same_samples(joined, whole.record())
    with pytest.raises(IndexError):
        sliced.block(0, sliced.total + 1)


def test_simulation_is_reproducible_bit_for_bit() -> None:
    setup = ImpactSetup(direction="front", tangential_velocity=5.0)
    assert same_samples(simulate(setup), simulate(setup))


def test_a_diverging_impact_says_so_with_its_setup() -> None:
    setup = ImpactSetup(overrides={
        "helmet.shell.contact_stiffness": 1e8, "helmet.shell.effective_mass": 1e-5,
    })  # fmt: skip
    with pytest.raises(
        DivergedError, match=r"diverged at t = .* ms.*'impact.normal_velocity': 5.0"
    ):
        simulate(setup)


def test_gravity_and_speed_can_be_varied() -> None:
    slow, fast = (simulate(ImpactSetup(rig="headform", normal_velocity=v)) for v in (2.5, 7.5))
    assert 2.5 < peak_g(fast) / peak_g(slow) < 4.0
    weightless = simulate(ImpactSetup(rig="headform", gravity=0.0, duration=1e-3))
    assert weightless.head_acceleration[0] == pytest.approx([0, 0, 0], abs=0.1)


@pytest.mark.parametrize("normal", [5.0, 10.0, 20.0])
@pytest.mark.parametrize(("mass", "stiffness"), [(0.08, 2e6), (0.03, 8e6)])
def test_a_light_stiff_shell_stays_stable(normal: float, mass: float, stiffness: float) -> None:
    """The integration step follows the stability limit; the sampling step stays the user's."""
    overrides = {
        "helmet.shell.effective_mass": mass, "helmet.shell.contact_stiffness": stiffness,
    }  # fmt: skip
    common = {"rig": "headform", "normal_velocity": normal, "duration": 0.02}
    coarse = simulate(ImpactSetup(time_step=5e-5, overrides=overrides, **common))
    fine = simulate(ImpactSetup(time_step=5e-6, overrides=overrides, **common))
    assert coarse.ground_force[:, 2].max() == pytest.approx(fine.ground_force[:, 2].max(), rel=0.01)


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("modulus", [2e5, 1e6])
def test_a_stiff_padding_stays_stable(form: str, modulus: float) -> None:
    """Its damping is explicit too, and acts on the light inside of the helmet."""
    peaks = [
        peak_g(simulate(ImpactSetup(
            tangential_velocity=10.0, duration=0.02, time_step=step,
            overrides={"helmet.coupling": form, "helmet.padding.modulus": modulus},
        )))
        for step in (5e-5, 5e-6)
    ]  # fmt: skip
    assert peaks[0] == pytest.approx(peaks[1], rel=0.01)


@pytest.mark.parametrize("coupling", ["spring", "foam"])
def test_the_helmets_moment_turns_the_head_as_newton_and_euler_say(coupling: str) -> None:
    setup = ImpactSetup(
        rig="headform", direction="left", normal_velocity=6.0, tangential_velocity=6.0,
        tangential_heading_deg=40.0,
        overrides={"helmet.coupling": coupling, "head.form": "en960_j"},
    )  # fmt: skip
    assert setup.headform is not None
    record, inertia = simulate(setup), np.array(setup.headform.inertia.value)
    to_head = Rotation.from_quat(record.head_orientation).inv()
    spin = to_head.apply(record.head_angular_velocity)
    turning = inertia * to_head.apply(record.head_angular_acceleration)
    needed = turning + np.cross(spin, inertia * spin)
    arm = to_head.apply(record.helmet_position - record.head_position)
    moment = record.coupling_torque + np.cross(arm, record.coupling_force)
    assert np.abs(needed - moment).max() < 1e-6 * np.abs(moment).max()
    assert np.abs(moment).max() > 20.0  # N m
