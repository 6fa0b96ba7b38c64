"""What a body lands on, and how its joints stop: tissue that hardens, stops that hold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.fall.stepping import Falling
from helmet_sim_ros.model.force import stops
from helmet_sim_ros.model.force.tissue import FAST, elastic_energy, elastic_force, resisting
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.rider.tissue import REGIONS, region_of

HARD = (40e3, 0.05, 0.97)  # stiffness, thickness, straight share


def test_slow_tissue_follows_its_hardening_law() -> None:
    assert elastic_force.py_func(*HARD, 0.025) == pytest.approx(40e3 * 0.025 / 0.5)


def test_tissue_goes_on_as_a_straight_line_close_to_its_thickness() -> None:
    edge = 0.97 * 0.05
    below, at, above = (elastic_force.py_func(*HARD, edge + d) for d in (-1e-8, 0.0, 1e-8))
    assert at - below == pytest.approx(above - at, rel=1e-4)


@pytest.mark.parametrize("depth", [0.01, 0.04, 0.0495])
def test_the_energy_of_tissue_is_the_integral_of_its_force(depth: float) -> None:
    depths = np.linspace(0.0, depth, 20001)
    forces = np.array([elastic_force.py_func(*HARD, d) for d in depths])
    assert elastic_energy.py_func(*HARD, depth) == pytest.approx(np.trapezoid(forces, depths))


def test_tissue_never_pulls_and_is_at_most_twice_as_stiff_when_fast() -> None:
    assert resisting.py_func(100.0, 1.5, -50.0, 1e-4, 1.0) == 0.0
    assert resisting.py_func(100.0, 1.5, 50.0, 1e-4, 1.0) == FAST * 100.0


def test_damping_never_turns_the_motion_of_a_light_part_around() -> None:
    mass, step, rate = 0.1, 1e-3, 0.2
    braking = resisting.py_func(5e4, 1.5, rate, step, mass) - 5e4
    assert 0.0 < braking * step / mass <= rate


def test_every_region_is_softer_than_bone_and_thinner_than_the_body() -> None:
    for name, region in REGIONS.items():
        assert 10e3 <= region.stiffness <= 100e3, name
        assert 0.01 <= region.thickness <= 0.12, name
    assert region_of("thigh_left", 1.1).thickness == pytest.approx(1.1 * REGIONS["thigh"].thickness)


@pytest.fixture(scope="module")
def crash() -> Falling:
    """A rider who is thrown down at 12 m/s."""
    fall = Falling(
        Fall(speed=6.0, vertical_speed=-10.0, height=1.2, roll_deg=70.0, duration=0.6), energy=True
    )
    fall.run()
    return fall


def test_nothing_is_pressed_together_by_more_than_its_thickness(crash: Falling) -> None:
    contact, deepest = crash.contact, 0.0
    soft = np.flatnonzero(np.isfinite(contact.thickness))
    for position, _ in crash.states():
        for i, depth in zip(soft, depths(crash, position)[soft], strict=True):
            deepest = max(deepest, depth / contact.thickness[i])
    assert 0.3 < deepest < 1.15


def depths(fall: Falling, position: np.ndarray) -> np.ndarray:
    """Of every ellipsoid in the road [m]."""
    import mujoco

    data = mujoco.MjData(fall.model)
    data.qpos[:] = position
    mujoco.mj_kinematics(fall.model, data)
    contact = fall.contact
    turns = data.xmat[contact.body].reshape(-1, 3, 3)
    centers = data.xpos[contact.body] + np.einsum("nij,nj->ni", turns, contact.center)
    reach = np.linalg.norm(turns[:, 2] * contact.semi_axes, axis=1)
    return reach - centers[:, 2]


def test_joints_pass_their_stops_by_less_than_0_15_rad(crash: Falling) -> None:
    held = crash._simulation.forces.stops
    turned = np.array([position[held.qpos] for position, _ in crash.states()])
    excess = np.maximum(turned - held.high, held.low - turned).max()
    assert 0.0 < excess < 0.15


def test_a_fall_gains_no_energy(crash: Falling) -> None:
    energy = crash.energy
    growth = (energy - np.minimum.accumulate(energy)).max()
    assert growth < 5e-3 * (energy[0] - energy[-1])


def test_a_stop_sends_a_joint_back_slowly() -> None:
    held = Impact(ImpactSetup(duration=1e-3))._simulation.forces.stops
    knee = 0
    inertia, stiffness = held.inertia[knee], held.stiffness[knee]
    angle, speed, step = 0.0, 30.0, 1e-5
    largest = 0.0
    while angle >= 0.0:
        elastic = stiffness * angle * (1.0 + (angle / stops.STIFFENS) ** 2)
        torque = resisting.py_func(elastic, stops.DAMPING, speed, step, inertia)
        speed -= step * torque / inertia
        angle += step * speed
        largest = max(largest, angle)
    assert largest < 0.15
    assert -speed < 1.05 / stops.DAMPING


def test_limbs_hold_themselves_against_a_share_of_their_weight() -> None:
    impact = Impact(ImpactSetup(duration=1e-3))
    names = [impact.model.joint(int(j)).name for j in impact.model.dof_jntid]
    held = impact._simulation.forces.stops
    friction = {names[dof]: held.friction[i] for i, dof in enumerate(held.qvel)}
    assert friction["lumbar_flexion"] == 0.0
    assert 5.0 < friction["hip_flexion_left"] < 30.0
    assert friction["hip_flexion_left"] == pytest.approx(friction["hip_flexion_right"])
    assert math.isclose(
        friction["elbow_flexion_left"], friction["elbow_flexion_right"], rel_tol=1e-9
    )
