"""The ground contact's laws."""

import numpy as np
import pytest

from helmet_sim_ros.model import contact
from helmet_sim_ros.model.impact import Impact, simulate
from helmet_sim_ros.model.setup import ImpactSetup


def test_the_normal_force_pushes_only() -> None:
    assert contact.normal_force(1e6, 0.2, 0.001, 0.0) == pytest.approx(1000.0)
    assert contact.normal_force(1e6, 0.2, 0.001, 2.0) == pytest.approx(1400.0)
    assert contact.normal_force(1e6, 0.2, 0.001, -100.0) == 0.0
    assert contact.normal_force(1e6, 0.2, -0.001, 5.0) == 0.0


def test_friction_sticks_below_its_limit_and_slips_at_it() -> None:
    stick = np.zeros(2)
    step, stiffness = 1e-5, 1e6
    held = [
        contact.friction_force(stiffness, contact.RELAXATION, 100.0, 0.5, 0.0, step, stick)
        for _ in range(5)
    ]
    relaxation = contact.RELAXATION * 0.5
    assert held[4][0] == pytest.approx(-stiffness * (5 * 0.5 * step + relaxation))
    for _ in range(500):
        x, y = contact.friction_force(stiffness, contact.RELAXATION, 100.0, 3.0, 4.0, step, stick)
    assert np.hypot(x, y) == pytest.approx(100.0)
    assert (x, y) == pytest.approx((-60.0, -80.0), rel=1e-3)  # against the slip


def test_friction_reverses_with_the_slip_through_the_elastic_deflection() -> None:
    stick = np.zeros(2)
    for _ in range(200):
        contact.friction_force(1e6, contact.RELAXATION, 400.0, 1.0, 0.0, 1e-5, stick)
    force = [
        contact.friction_force(1e6, contact.RELAXATION, 400.0, -1.0, 0.0, 1e-5, stick)[0]
        for _ in range(100)
    ]
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
    force = simulate(setup).ground_force
    tangential = np.linalg.norm(force[:, :2], axis=1)
    assert np.all(force[:, 2] >= 0.0)
    assert np.all(tangential <= friction * force[:, 2] * (1 + 1e-9) + 1e-9)
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
