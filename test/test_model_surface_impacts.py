"""Impacts on every shipped surface: turned ground is ground, and momentum is kept everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.anvil_drops import identified_there
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.placement import head_in_frame
from helmet_sim_ros.model.surface.scenes import load_surface
from helmet_sim_ros.resources import share_directory

SHIPPED = sorted(p.stem for p in (share_directory() / "config" / "surfaces").glob("*.yaml"))

#: Vectors of a record in world axes; the origin of the moment lies in the first touch of both.
IN_WORLD = (
    "head_acceleration", "head_angular_acceleration", "head_velocity", "head_angular_velocity",
    "head_position", "helmet_position", "ground_force", "ground_torque", "ground_friction",
    "body_ground_force",
)  # fmt: skip
IN_THE_BODY = (
    "coupling_force", "coupling_torque", "coupling_displacement", "neck_force", "neck_torque",
    "joint_positions", "joint_velocities",
)  # fmt: skip


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("rig", ["headform", "rider"])
@pytest.mark.parametrize("surface", ["incline_45", "incline_15"])
def test_a_tilted_plane_without_gravity_is_flat_ground(surface: str, rig: str, form: str) -> None:
    """The same impact seen from turned axes, sample by sample."""

    def struck(name: str) -> ImpactRecord:
        return simulate(ImpactSetup(
            rig=rig, surface=name, friction=0.4, gravity=0.0, tangential_velocity=6.0,
            tangential_heading_deg=40.0, duration=0.02, overrides={"helmet.coupling": form},
        ))  # fmt: skip

    flat, tilted = struck("ground"), struck(surface)
    point, frame = load_surface(surface).frame
    assert point == pytest.approx(0.0, abs=1e-12)
    for name in IN_WORLD:
        expected, seen = getattr(flat, name), getattr(tilted, name) @ frame
        size = np.abs(expected).max(initial=1e-3)
        assert np.abs(seen - expected).max() < 1e-6 * size, name
    for name in IN_THE_BODY:
        expected, seen = getattr(flat, name), getattr(tilted, name)
        size = np.abs(expected).max(initial=1e-3)
        assert np.abs(seen - expected).max(initial=0.0) < 1e-6 * size, name


@pytest.mark.parametrize("form", ["spring", "foam"])
@pytest.mark.parametrize("surface", SHIPPED)
def test_momentum_is_kept_on_every_surface(surface: str, form: str) -> None:
    impact = Impact(ImpactSetup(
        rig="headform", direction="front", surface=surface, tangential_velocity=4.0,
        duration=0.03, overrides={"helmet.coupling": form},
    ))  # fmt: skip
    impact.advance(impact.total)
    record, checked = impact.record(), balance(impact)
    assert checked.momentum_error < 5e-3
    assert np.linalg.norm(record.head_acceleration, axis=1).max() > 200.0  # m/s^2: it was struck
    assert checked.mechanical[-1] < 0.9 * checked.mechanical[0]
    pressed = record.ground_force - record.ground_friction
    limit = max(impact.surface.friction) * np.linalg.norm(pressed, axis=1)
    if len(impact.surface.kind) == 1 and surface in ("ground", "road", "incline_45", "incline_15"):
        assert np.all(np.linalg.norm(record.ground_friction, axis=1) <= limit * (1 + 1e-9) + 1e-9)


@pytest.mark.parametrize("surface", SHIPPED)
def test_a_helmet_starts_touching_and_goes_the_way_of_the_target(surface: str) -> None:
    setup = ImpactSetup(rig="headform", surface=surface, duration=1e-3)
    record = simulate(setup)
    _, frame = setup.surface_config.frame
    assert frame.T @ record.head_velocity[0] == pytest.approx([0.0, 0.0, -5.0], abs=1e-9)
    assert np.linalg.norm(record.ground_force[0]) < 1.0
    assert np.linalg.norm(record.ground_force[5]) > 100.0


@pytest.mark.parametrize(
    ("surface", "told"), [("hemisphere", True), ("kerbstone", True), ("edge_anvil", True),
                          ("post", True), ("ground", False), ("flat_anvil", False),
                          ("incline_45", False), ("bar_anvil_45", False)],
)  # fmt: skip
def test_a_spring_is_identified_on_what_is_not_flat_and_says_so(surface: str, told: bool) -> None:
    for form, words in (("spring", "identified there"), ("foam", "identified there")):
        impact = Impact(ImpactSetup(
            rig="headform", surface=surface, overrides={"helmet.coupling": form}))  # fmt: skip
        here = told and form == "spring"
        assert any(words in note for note in impact.notes) == here
        assert (impact.helmet.spring != impact.setup.helmet_config.spring) == here


@pytest.mark.parametrize("told", [True, False])
def test_a_spring_that_a_file_gives_tells_that_it_stands_for_flat_ground(told: bool) -> None:
    surface = "kerbstone" if told else "ground"
    impact = Impact(ImpactSetup(rig="headform", surface=surface, helmet="fullface_paper"))
    assert any("stands for flat ground" in note for note in impact.notes) == told
    assert impact.helmet.spring == impact.setup.helmet_config.spring


@pytest.mark.parametrize("surface", ["kerbstone", "hemisphere", "post"])
def test_the_spring_on_an_anvil_is_about_as_hard_as_its_foam_there(surface: str) -> None:
    """It had the peak of flat ground there: 212 g for 137 to 156."""
    peaks = [
        float(evaluate(simulate(ImpactSetup(
            rig="headform", direction="top", surface=surface, normal_velocity=7.5, duration=0.02,
            overrides={"helmet.coupling": form}))).peak_g)
        for form in ("spring", "foam")
    ]  # fmt: skip
    assert peaks[0] == pytest.approx(peaks[1], rel=0.15)


def test_drops_on_flat_ground_give_the_spring_of_the_flat_press() -> None:
    setup = ImpactSetup(rig="headform", direction="top")
    found = identified_there(setup.helmet_config, setup.surface_config, head_in_frame(setup)).top
    flat = setup.helmet_config.spring.top
    for crush in (0.01, 0.02, 0.03):
        force = found.A * np.expm1(found.B * crush)
        assert force == pytest.approx(flat.A * np.expm1(flat.B * crush), rel=0.04)


def test_columns_without_a_shell_that_would_pass_a_thin_plate_are_refused() -> None:
    """They came out on its other side: 25 g."""
    bare = {"helmet.coupling": "foam", "helmet.shell.material.thickness": 0.0}
    with pytest.raises(SetupError, match=r"impact.surface = 'edge_anvil': is only 6 mm thick"):
        ImpactSetup(surface="edge_anvil", overrides=bare)
    for surface in set(SHIPPED) - {"edge_anvil", "motorcycle"}:
        ImpactSetup(surface=surface, overrides=bare)
    told = Impact(ImpactSetup(rig="headform", surface="hemisphere", overrides=bare)).notes
    assert any("lets each column alone" in note for note in told)
