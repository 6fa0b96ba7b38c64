"""The ground contact's laws."""

import numpy as np
import pytest

from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force import contact
from helmet_sim_ros.model.force.bodies import FORCE, HELMET, Loads, Motion, motion_of, no_loads
from helmet_sim_ros.model.force.contact import Contact
from helmet_sim_ros.model.force.friction import RELAXATION, friction_force, normal_force
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.model.surface.compiled import Surface

UP = (0.0, 0.0, 1.0)
STEP, STIFFNESS = 1e-5, 1e6  # s, N/m


def rubbed(
    stick: np.ndarray, limit: float, slip: tuple[float, float, float],
    normal: tuple[float, float, float] = UP,
) -> np.ndarray:  # fmt: skip
    """Friction [N] after one more step."""
    return np.array(friction_force(STIFFNESS, RELAXATION, limit, slip, normal, STEP, stick))


def test_the_normal_force_pushes_only() -> None:
    assert normal_force(1e6, 0.2, 0.001, 0.0) == pytest.approx(1000.0)
    assert normal_force(1e6, 0.2, 0.001, 2.0) == pytest.approx(1400.0)
    assert normal_force(1e6, 0.2, 0.001, -100.0) == 0.0
    assert normal_force(1e6, 0.2, -0.001, 5.0) == 0.0


def test_friction_sticks_below_its_limit_and_slips_at_it() -> None:
    stick = np.zeros(3)
    held = [rubbed(stick, 100.0, (0.5, 0.0, 0.0)) for _ in range(5)]
    assert held[4][0] == pytest.approx(-STIFFNESS * (5 * 0.5 * STEP + RELAXATION * 0.5))
    for _ in range(500):
        force = rubbed(stick, 100.0, (3.0, 4.0, 0.0))
    assert np.linalg.norm(force) == pytest.approx(100.0)
    assert force == pytest.approx([-60.0, -80.0, 0.0], rel=1e-3)  # against the slip


def test_friction_lies_in_a_tilted_surface_also_when_it_turns() -> None:
    stick = np.zeros(3)
    for _ in range(200):
        rubbed(stick, 100.0, (3.0, 0.0, 0.0))
    tilted = (0.6, 0.0, 0.8)
    force = rubbed(stick, 100.0, (0.0, 1.0, 0.0), tilted)
    assert force @ tilted == pytest.approx(0.0, abs=1e-9)
    assert stick @ tilted == pytest.approx(0.0, abs=1e-12)
    assert force[1] < 0.0


def test_friction_reverses_with_the_slip_through_the_elastic_deflection() -> None:
    stick = np.zeros(3)
    for _ in range(200):
        rubbed(stick, 400.0, (1.0, 0.0, 0.0))
    force = [rubbed(stick, 400.0, (-1.0, 0.0, 0.0))[0] for _ in range(100)]
    assert force[0] < 0.0 < force[-1] == pytest.approx(400.0)
    assert np.all(np.diff(force) >= -1e-9)


@pytest.mark.parametrize("rig", ["rider", "headform"])
@pytest.mark.parametrize("friction", [0.0, 0.2, 0.4, 0.8])
def test_tangential_force_never_exceeds_friction_times_normal_force(
    rig: str, friction: float
) -> None:
    setup = ImpactSetup(
        rig=rig, normal_velocity=6.0, tangential_velocity=8.0, friction=friction,
        tangential_heading_deg=35.0,
    )  # fmt: skip
    record = simulate(setup)
    force = record.ground_force
    tangential = np.linalg.norm(force[:, :2], axis=1)
    assert np.all(force[:, 2] >= 0.0)
    assert np.all(tangential <= friction * force[:, 2] * (1 + 1e-9) + 1e-9)
    assert np.linalg.norm(record.ground_friction, axis=1) == pytest.approx(tangential)
    if friction:
        ratio = tangential / np.maximum(force[:, 2], 1e-9)
        assert ratio.max() == pytest.approx(friction, rel=1e-6)  # it does slide


def test_the_first_force_peak_does_not_depend_on_the_slip_speed() -> None:
    """Coulomb friction on a rigid shell cannot raise the normal force at the first touch."""
    peaks = []
    for speed in (0.0, 5.0, 20.0):
        record = simulate(ImpactSetup(rig="headform", tangential_velocity=speed, duration=2e-3))
        peaks.append(record.ground_force[:10, 2].max())
    assert peaks[1] == pytest.approx(peaks[0], rel=0.02)
    assert peaks[2] == pytest.approx(peaks[0], rel=0.02)


def test_a_headform_at_rest_on_the_ground_weighs_its_weight() -> None:
    setup = ImpactSetup(rig="headform", direction="top", normal_velocity=1e-3, duration=1.5,
                        friction=0.8)  # fmt: skip
    impact = Impact(setup)
    impact.advance(impact.total)
    force = impact.record().ground_force
    weight = float(impact.model.body_subtreemass[1]) * 9.80665
    assert force[-4000:, 2].mean() == pytest.approx(weight, rel=0.02)


def test_the_moment_of_the_ground_force_acts_at_the_contact_point() -> None:
    record = simulate(ImpactSetup(tangential_velocity=5.0))
    i = record.ground_force[:, 2].argmax()
    force, torque = record.ground_force[i], record.ground_torque[i]
    x, y = -torque[1] / force[2], torque[0] / force[2]  # of a force acting at z = 0
    offset = np.array([x, y]) - record.helmet_position[i, :2]
    assert np.linalg.norm(offset) < 0.03
    assert abs(torque @ force) < 1e-2 * np.linalg.norm(torque) * np.linalg.norm(force)


def test_a_bent_shell_gives_back_the_stated_share() -> None:
    """Pressed and released slowly: k down, k / returned back."""
    impact = Impact(ImpactSetup(rig="headform", direction="top", gravity=0.0, duration=1e-3))
    motion, surface = motion_of(impact._data), impact.surface
    shell = impact.contact
    returned, stiffness = shell.returned[0], shell.stiffness[0]
    touching = motion.position[:, 2].copy()
    peak = 1e-3
    down = np.linspace(0.0, peak, 2001)
    forces = []
    for depth in np.concatenate([down, down[::-1]]):
        motion.position[:, 2] = touching - depth
        loads = no_loads(impact.model)
        press_all(shell, surface, motion, loads)
        forces.append(loads.surface[HELMET, FORCE + 2])
    loaded, unloaded = np.trapezoid(forces[:2001], down), -np.trapezoid(forces[2001:], down[::-1])
    assert forces[2000] == pytest.approx(stiffness * peak, rel=1e-6)
    assert unloaded / loaded == pytest.approx(returned, rel=1e-3)
    motion.position[:, 2] = touching + 1e-3  # lifted off, the shell is as it was
    press_all(shell, surface, motion, no_loads(impact.model))
    motion.position[:, 2] = touching - 0.5 * peak
    loads = no_loads(impact.model)
    press_all(shell, surface, motion, loads)
    assert loads.surface[HELMET, FORCE + 2] == pytest.approx(0.5 * stiffness * peak, rel=1e-6)


@compiled
def press_all(shell: Contact, surface: Surface, motion: Motion, loads: Loads) -> None:
    contact.apply(shell, surface, 1e-5, motion, loads)
