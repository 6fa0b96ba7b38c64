"""What the explorer draws, and its page, on viser's server without a browser."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("viser", reason="the explorer needs the extra 'explore'")

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.explore.page import Page
from helmet_sim_ros.explore.server import start_server
from helmet_sim_ros.explore.session import Shown, digest
from helmet_sim_ros.explore.stage import Stage, crush_of
from helmet_sim_ros.explore.widgets import put
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.model.scene import Scene

SIDEWAYS = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def server():
    server = start_server(18700)
    yield server
    server.stop()


def shown(**values: object) -> tuple[Shown, Scene]:
    """An impact of a headform unless told otherwise, and its shapes."""
    setup = ImpactSetup(**{"rig": "headform", "duration": 0.01, **values})
    record = simulate(setup)
    return Shown(setup, digest(record.setup), record, evaluate(record)), Scene(setup)


def staged(server, impact: Shown, scene: Scene, offset=(0.0, 0.0, 0.0)) -> Stage:
    stage = Stage(server, "A")
    stage.show(impact, scene, np.array(offset), SIDEWAYS)
    return stage


def lies_at(node, position, quaternion) -> bool:
    """Whether a node has a place [m] and an orientation x, y, z, w."""
    turn = Rotation.from_quat(np.asarray(node.wxyz)[[1, 2, 3, 0]])
    apart = (turn * Rotation.from_quat(quaternion).inv()).magnitude()
    return bool(np.allclose(node.position, position) and apart < 1e-3)  # single precision


def test_parts_helmet_and_forces_are_drawn_where_the_record_has_them(server):
    impact, scene = shown(rig="rider", tangential_velocity=5.0)
    stage, record = staged(server, impact, scene), impact.record
    peak = int(np.linalg.norm(record.ground_force, axis=1).argmax())
    for index in (0, peak, len(record) + 5):  # beyond the end: the last one
        stage.draw(index)
        i = min(index, len(record) - 1)
        positions, turns = scene.poses(record, i)
        parts = [k for k, shape in enumerate(scene.shapes) if shape.name != "helmet"]
        assert len(stage._nodes) == len(parts) > 10
        for node, k in zip(stage._nodes, parts, strict=True):
            assert lies_at(node, positions[k], turns[k]), scene.shapes[k].name
        (helmet,) = stage._helmet
        assert lies_at(helmet, record.helmet_position[i], record.helmet_orientation[i])
        for drawn, force in zip(stage._arrows.points, force_arrows(record, i), strict=True):
            tip = force.tip if force.visible else force.tail
            assert drawn == pytest.approx(np.array([force.tail, tip]), abs=1e-6)
    stage.draw(peak)
    assert np.linalg.norm(np.diff(stage._arrows.points, axis=1), axis=2).min() > 0.01
    stage.clear()


def test_a_view_holds_all_that_is_drawn(server):
    empty = Stage(server, "A")
    center, radius = empty.extent(helmet_only=False)
    assert center.tolist() == [0.0, 0.0, 0.5] and radius == 1.0
    impact, scene = shown(rig="rider")
    stage = staged(server, impact, scene)
    positions, _ = scene.poses(impact.record, 0)
    center, radius = stage.extent(helmet_only=False)
    assert center == pytest.approx(0.5 * (positions.min(axis=0) + positions.max(axis=0)))
    farthest = np.linalg.norm(positions - center, axis=1).max()
    assert radius == pytest.approx(farthest + 0.15)
    center, radius = stage.extent(helmet_only=True)
    assert np.array_equal(center, impact.record.helmet_position[0]) and radius == 0.3
    stage.clear()
    assert stage.extent(helmet_only=False)[1] == 1.0 and stage.shown is None


def test_the_floor_is_the_lowest_point_of_what_is_struck(server):
    flat, flat_scene = shown()
    stage = staged(server, flat, flat_scene)
    assert stage.floor == 0.0 and not stage._surface
    anvil, anvil_scene = shown(surface="kerbstone")
    stage.show(anvil, anvil_scene, np.zeros(3), SIDEWAYS)
    solids = anvil_scene.around()
    assert len(stage._surface) == len(solids)
    lowest = min(np.asarray(node.vertices)[:, 2].min() for node in stage._surface)
    assert stage.floor == pytest.approx(lowest) and stage.floor < 0.0
    stage.show(flat, flat_scene, np.zeros(3), SIDEWAYS)
    assert stage.floor == 0.0 and not stage._surface
    stage.clear()


def test_crush_is_shown_on_the_helmet_and_on_a_copy_that_turns_its_dent_to_the_viewer(server):
    foam, foam_scene = shown(overrides={"helmet.coupling": "foam"})
    stage = staged(server, foam, foam_scene, offset=(1.0, 2.0, 0.0))
    assert np.allclose(stage._frame.position, [1.0, 2.0, 0.0])
    residual, position = crush_of(foam.record)
    assert stage._label.text == f"A: crushed by {1e3 * residual.max():.1f} mm"
    assert len(stage._crush) == 2
    for node in stage._crush:
        places = np.asarray(node.batched_positions)
        assert np.linalg.norm(places - position, axis=1) == pytest.approx(0.003, abs=1e-6)
    dent = Rotation.from_quat(np.asarray(stage._copy.wxyz)[[1, 2, 3, 0]]).apply(residual @ position)
    assert dent / np.linalg.norm(dent) == pytest.approx(SIDEWAYS, abs=1e-6)
    up = foam.record.helmet_position[0][2] + 0.5
    assert stage._copy.position[2] > up - 0.3
    center, radius = stage.extent(helmet_only=False)
    assert np.linalg.norm(stage._copy.position - center) < radius  # it is in view, too
    spring, spring_scene = shown()
    stage.show(spring, spring_scene, np.zeros(3), SIDEWAYS)
    assert not stage._crush and stage._copy is None
    stage.clear()


def test_only_columns_that_are_crushed_are_a_dent():
    foam, _ = shown(overrides={"helmet.coupling": "foam"})
    residual, position = crush_of(foam.record)
    whole = foam.record.extras["residual_crush"]
    assert len(residual) == len(position) == (whole > 0.02 * whole.max()).sum() < len(whole)
    spring, _ = shown()
    assert crush_of(spring.record) is None


def test_the_page_turns_the_side_that_is_chosen_and_looks_at_the_first_impact():
    server = start_server(18800)
    page = Page(server)
    try:
        seen = threading.Event()
        show = page.session._shown

        def told(side, impact):
            show(side, impact)
            seen.set()

        page.session._shown = told
        page.start()
        assert seen.wait(200.0)
        assert page._side() == "A"
        middle, _ = page._stages["A"].extent(helmet_only=False)
        assert np.allclose(server.initial_camera.look_at, middle)
        page.session.open_b()
        put(page._turning, "A")
        assert page._side() == "A"
        put(page._turning, "B")
        assert page._side() == "B"
        page.session.close_b()
        assert page._side() == "A"
    finally:
        page.close()
        server.stop()
