"""The rider touches himself: limbs, trunk and helmet."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.model.force import self_contact
from helmet_sim_ros.model.force.bodies import Loads, Motion, motion_of, no_loads
from helmet_sim_ros.model.force.self_contact import (
    SelfContact,
    above_ellipsoid,
    between_capsules,
    depths,
    stored_energy,
)
from helmet_sim_ros.model.impact import Impact


def test_the_gap_of_two_capsules_is_that_of_their_segments() -> None:
    along, across = ((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((0.3, -1.0, 0.5), (0.3, 1.0, 0.5))
    gap, point, normal = between_capsules(*along, 0.1, *across, 0.2)
    assert gap == pytest.approx(0.2)
    assert normal == pytest.approx((0.0, 0.0, 1.0))
    assert point == pytest.approx((0.3, 0.0, 0.2))


def test_a_segment_lies_above_the_nearer_half_of_an_egg() -> None:
    egg = (0.2, 0.2, 0.3, 0.1)  # tall above, flat below
    over, _, up = above_ellipsoid(egg, (-0.1, 0.0, 0.4), (0.1, 0.0, 0.4))
    under, _, down = above_ellipsoid(egg, (-0.1, 0.0, -0.4), (0.1, 0.0, -0.4))
    assert over == pytest.approx(0.1, rel=0.2)  # to first order
    assert under == pytest.approx(0.3, rel=1.0)
    assert up == pytest.approx((0.0, 0.0, 1.0))
    assert down == pytest.approx((0.0, 0.0, -1.0))


def posed(**angles: float) -> tuple[Impact, SelfContact, Motion, Loads, mujoco.MjData]:
    """A rider with some joints turned [rad], at rest."""
    impact = Impact(ImpactSetup(duration=1e-3))
    model, data = impact.model, impact._data
    for name, angle in angles.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    data.qvel[:] = 0.0
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return impact, impact._simulation.forces.own, motion_of(data), no_loads(model), data


def test_nothing_touches_in_the_posture_of_the_start() -> None:
    _, own, motion, loads, _ = posed()
    self_contact.apply(own, 5e-5, motion, loads)
    assert not loads.wrenches.any()
    assert depths(own, motion).max() <= 0.0


def test_what_overlaps_at_the_start_counts_from_there_until_it_came_apart() -> None:
    _, own, motion, _, _ = posed()
    assert own.overlap.max() > 0.0  # forearms beside the pelvis
    _, own, motion, loads, _ = posed(shoulder_abduction_left=1.0, shoulder_abduction_right=1.0)
    self_contact.apply(own, 5e-5, motion, loads)
    assert own.overlap.max() == 0.0


def test_an_arm_does_not_pass_through_the_chest() -> None:
    _, own, motion, loads, _ = posed(shoulder_flexion_left=0.9, elbow_flexion_left=2.4,
                                     shoulder_rotation_left=-1.5)  # fmt: skip
    assert depths(own, motion).max() > 0.01
    self_contact.apply(own, 5e-5, motion, loads)
    assert stored_energy(own, motion) > 0.0
    pushed = np.linalg.norm(loads.wrenches[:, :3], axis=1)
    assert pushed.max() > 100.0
    total = loads.wrenches.sum(axis=0)
    assert np.abs(total).max() < 1e-9 * pushed.max()


def test_crossed_legs_push_each_other_apart() -> None:
    impact, own, motion, loads, _ = posed(hip_abduction_left=-0.2, hip_abduction_right=-0.2)
    self_contact.apply(own, 5e-5, motion, loads)
    left = int(impact.model.body("thigh_left").id)
    assert loads.wrenches[left, :3].any()


def test_a_bent_neck_brings_the_helmet_onto_the_shoulder() -> None:
    impact = Impact(ImpactSetup(duration=1e-3))
    model, data, own = impact.model, impact._data, impact._simulation.forces.own
    half = 0.5 * 0.5
    for name in ("neck_lower", "neck_middle", "neck_upper"):
        first = int(model.joint(name).qposadr[0])
        data.qpos[first : first + 4] = np.cos(half), np.sin(half), 0.0, 0.0
    data.qvel[:] = 0.0
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    loads, motion = no_loads(model), motion_of(data)
    self_contact.apply(own, 5e-5, motion, loads)
    assert loads.wrenches[model.body("helmet_rest").id, :3].any()


def test_a_headform_touches_nothing_of_its_own() -> None:
    own = Impact(ImpactSetup(rig="headform", duration=1e-3))._simulation.forces.own
    assert len(own.first) == 0
