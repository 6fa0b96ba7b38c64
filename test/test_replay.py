"""Force arrows and 3-D replay: video without a screen, views for Foxglove and RViz."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from click.testing import CliRunner
from logs import write_log
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker

from helmet_sim_ros import ImpactSetup, open_log, simulate
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.decode import Decoder
from helmet_sim_ros.mcap_log.source import McapSource
from helmet_sim_ros.model.arrows import LENGTH_PER_FORCE, force_arrows, point_of_attack
from helmet_sim_ros.model.surface.scenes import load_surface
from helmet_sim_ros.model.surface.shapes import signed_distance
from helmet_sim_ros.nodes.scene_markers import SceneMarkers
from helmet_sim_ros.report.replay import gl
from helmet_sim_ros.report.replay.gl import BACKENDS, GraphicsError, backend_works, choose_backend
from helmet_sim_ros.report.replay.scene import scene_of
from helmet_sim_ros.report.replay.stage import Stage

ROOT = Path(__file__).resolve().parents[1]
SETUP = ImpactSetup(duration=0.012, normal_velocity=5.0, tangential_velocity=8.0)


@pytest.fixture(scope="module")
def record():
    return simulate(SETUP)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "one.mcap"
    write_log(path, [SETUP])
    return path


@pytest.fixture(scope="module")
def backend():
    chosen = os.environ.get("MUJOCO_GL")
    for name in (chosen,) if chosen else BACKENDS:
        if backend_works(name):
            return name
    pytest.skip("no OpenGL without a screen (EGL or OSMesa) on this machine")


def test_arrows_are_the_ground_force_at_its_point_of_attack(record):
    index = int(record.ground_force[:, 2].argmax())
    normal, friction = force_arrows(record, index)
    total = (normal.tip - normal.tail + friction.tip - friction.tail) / LENGTH_PER_FORCE
    assert np.allclose(total, record.ground_force[index])
    point = point_of_attack(record, index)
    assert point[2] == 0.0
    moment = np.cross(point, record.ground_force[index])
    assert moment[:2] == pytest.approx(record.ground_torque[index][:2], abs=1e-9)
    below = record.helmet_position[index][:2]
    assert np.linalg.norm(point[:2] - below) < 0.1
    assert not force_arrows(record, 0)[0].visible and normal.visible and friction.visible


def test_markers_show_arrows_only_while_there_is_a_force(record):
    markers = SceneMarkers(SETUP)
    index = int(record.ground_force[:, 2].argmax())
    for sample, action in ((0, Marker.DELETE), (index, Marker.ADD), (0, Marker.DELETE)):
        shown = markers.message(record, sample, 0).markers
        arrows = [marker for marker in shown if marker.type == Marker.ARROW]
        assert [marker.ns for marker in arrows] == ["normal", "friction"]
        assert [marker.action for marker in arrows] == [action] * 2
        assert len({marker.id for marker in shown}) == len(shown)
        assert {marker.header.frame_id for marker in shown} == {"world"}
        assert all(marker.action == Marker.ADD for marker in shown if marker not in arrows)


@pytest.mark.parametrize(
    "surface", ["ground", "incline_45", "kerbstone", "hemisphere", "car_front"]
)
def test_markers_show_what_is_struck_where_it_is(record, surface):
    """The outermost of the middles of a marker's faces lies on the surface."""
    config = load_surface(surface)
    markers = SceneMarkers(ImpactSetup(surface=surface)).message(record, 0, 0).markers
    struck = [m for m in markers if m.ns == ("ground" if surface == "ground" else "surface")]
    compiled, solids = config.compiled(), range(len(config.shapes))
    assert len(struck) >= len(config.shapes)
    tops = []
    for marker in struck:
        at, q = marker.pose.position, marker.pose.orientation
        scale = np.array([marker.scale.x, marker.scale.y, marker.scale.z])
        faces = 0.5 * scale * np.vstack([np.eye(3), -np.eye(3)])
        middle = np.array([at.x, at.y, at.z])
        points = middle + Rotation.from_quat([q.x, q.y, q.z, q.w]).apply(faces)
        depths = [min(signed_distance(compiled, k, *p)[0] for k in solids) for p in points]
        tops.append(max(depths))
    assert min(tops) > -2e-3 and max(tops) < 6e-3  # the rounded end of a wedge is drawn square


@pytest.mark.parametrize(("y", "plates"), [(0.0, 1), (-2.0, 0)])
def test_a_wall_that_is_seen_from_behind_hides_nothing(tmp_path, y, plates):
    """Only its lines are drawn then. The wall faces +y and stands at y = -1 m."""
    wall = tmp_path / "wall.yaml"
    wall.write_text(
        "shapes: [{kind: half_space, position: [0, -1, 0], tilt_deg: 90}]\n"
        "target: {point: [0, -1, 0], normal: [0, 1, 0]}\n"
    )
    stage = Stage(simulate(ImpactSetup(rig="headform", surface=str(wall), duration=0.002)))
    target = mujoco.MjvScene(stage.scene.model, 200)
    target.camera[0].pos[:] = 0.0, y, 1.0
    stage.draw_around(target, 0)
    drawn = list(target.geoms[: target.ngeom])
    wide = [geom for geom in drawn if sorted(geom.size)[1] > 1.0]
    assert len(wide) == plates and len(drawn) == plates + 2 * 17
    assert all(geom.pos[1] == pytest.approx(-1.0, abs=0.01) for geom in drawn)
    lines = sorted(geom.pos[2] for geom in drawn if geom.size[0] > 1.0 > geom.size[1])
    assert np.diff(lines) == pytest.approx([0.25] * 16)  # m


def test_a_log_holds_a_scene_that_moves(path):
    source = McapSource(path)
    decoder = Decoder(source)
    (channel,) = decoder.channels("/scene", "visualization_msgs/msg/MarkerArray")
    scenes = [decoder.decode(channel, m.data) for m in source.messages([channel])]
    assert len(scenes) == 13  # each millisecond
    helmets = [next(m for m in scene.markers if m.ns == "helmet") for scene in scenes]
    heights = [helmet.pose.position.z for helmet in helmets]
    assert max(heights) - min(heights) > 0.002
    assert {m.ns for m in scenes[6].markers} >= {"helmet", "head", "ground", "normal", "friction"}


def test_a_video_has_the_pictures_that_were_asked_for(backend, path, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    arguments = ["replay", str(path), "-o", str(tmp_path), "--size", "320x240", "--slow", "50"]
    result = subprocess.run(
        [sys.executable, "-m", "helmet_sim_ros", *arguments],
        env=os.environ | {"MUJOCO_GL": backend}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    (video,) = tmp_path.iterdir()
    assert video.name == "one_test-0.mp4"
    frames = imageio_ffmpeg.read_frames(str(video))
    about = next(frames)
    assert about["size"] == (320, 240) and about["fps"] == 30.0
    pictures = [np.frombuffer(f, np.uint8).reshape(240, 320, 3).astype(int) for f in frames]
    assert len(pictures) == round(0.012 * 50 * 30) + 1
    scene = [picture[:200] for picture in pictures]
    assert all(picture.std() > 10.0 for picture in scene)
    # A red arrow appears while the ground pushes, and is not there at the first touch.
    red = [int(((p[..., 0] > 150) & (p[..., 1] < 90) & (p[..., 2] < 90)).sum()) for p in scene]
    assert red[0] == 0 and max(red) > 10  # pixels; the helmet hides most of it
    # The time bar grows: its red line moves to the right.
    bars = [picture[212:] for picture in pictures]
    lines = [np.argmax((b[..., 0] - b[..., 1]).clip(0).sum(axis=0)) for b in bars]
    assert lines[-1] > lines[len(lines) // 2] > lines[0]


def test_a_video_can_be_given_its_name(backend, path, tmp_path):
    """``-o v.mp4`` made a folder of that name."""
    pytest.importorskip("imageio_ffmpeg")
    video = tmp_path / "new" / "v.mp4"
    result = subprocess.run(
        [sys.executable, "-m", "helmet_sim_ros", "replay", str(path), "-o", str(video),
         "--size", "64x64", "--slow", "5"],
        env=os.environ | {"MUJOCO_GL": backend}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert list(video.parent.iterdir()) == [video] and b"ftyp" in video.read_bytes()[:16]


def test_one_video_is_not_the_name_of_several(path, tmp_path, monkeypatch):
    monkeypatch.setattr(gl, "choose_backend", lambda: "any")
    two = tmp_path / "two.mcap"
    write_log(two, [SETUP, SETUP])
    for arguments, words in (
        ([two, "-o", tmp_path / "v.mp4"], "for 2 impacts of 1 logs"),
        ([two, path, "--impact", "1", "-o", tmp_path / "v.mp4"], "for 1 impacts of 2 logs"),
        ([path, "-o", tmp_path / "v.avi"], "a video is an .mp4 file"),
    ):
        answer = CliRunner().invoke(main, ["replay", *map(str, arguments)])
        assert answer.exit_code == 2 and words in answer.stderr, answer.output
    assert list(tmp_path.iterdir()) == [two]


def test_what_cannot_be_drawn_is_told(path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    with pytest.raises(GraphicsError, match="libegl1"):
        choose_backend()
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for arguments, words in (
        (["--live"], "needs a screen"),
        (["--size", "100x101"], "WIDTHxHEIGHT"),
        (["--slow", "0"], "not in the range"),
        ([], "no OpenGL"),
    ):
        answer = CliRunner().invoke(main, ["replay", str(path), *arguments])
        assert answer.exit_code == 2 and words in answer.stderr, answer.output


def test_a_record_is_shown_without_its_helmet_file_and_refused_without_its_model(path):
    record = open_log(path)[0].record
    elsewhere = replace(record, setup={**record.setup, "helmet.name": "/gone/lab.yaml"})
    positions, _ = scene_of(elsewhere).poses(elsewhere, 50)
    assert np.array_equal(positions, scene_of(record).poses(record, 50)[0])
    foreign = replace(record, joint_names=("tail", *record.joint_names[1:]))
    with pytest.raises(LogError, match="cannot show"):
        scene_of(foreign)


def test_a_log_with_the_neck_of_version_0_1_is_shown_with_a_warning(path, caplog):
    record = open_log(path)[0].record
    body = [name for name in record.joint_names if not name.startswith(("neck_lower", "neck_m"))]
    body = [name for name in body if not name.startswith("neck_upper")]
    hinges = [f"neck_{at}_{turn}" for at in ("lower", "upper")
              for turn in ("flexion", "lateral", "rotation")]  # fmt: skip
    angles = np.hstack(
        [
            record.joint_positions[:, [record.joint_names.index(name) for name in body]],
            np.full((len(record), 6), 0.1),
        ]
    )
    setup = {k: v for k, v in record.setup.items() if not k.startswith("rider.neck.")}
    old = replace(
        record, joint_names=(*body, *hinges), joint_positions=angles, joint_velocities=angles,
        setup={**setup, "rider.neck.bending_stiffness": 20.0, "rider.neck.damping": 1.0},
    )  # fmt: skip
    scene = scene_of(old)
    assert "bending_stiffness, rider.neck.damping" in caplog.text
    scene.pose(old, 5)
    head, thorax = (scene.data.body(name).xmat.reshape(3, 3) for name in ("head", "thorax"))
    turn = Rotation.from_euler("YXZ", [0.1, 0.1, 0.1])
    assert thorax.T @ head == pytest.approx((turn * turn).as_matrix(), abs=1e-9)


def topics_and_types(path: Path) -> dict[str, str]:
    source = McapSource(path)
    return {c.topic: source.schemas[c.schema_id].name for c in source.channels.values()}


def test_the_foxglove_layout_shows_fields_that_a_log_has(path):
    layout = json.loads((ROOT / "config" / "foxglove_layout.json").read_text(encoding="utf-8"))
    logged = topics_and_types(path)
    source = McapSource(path)
    decoder = Decoder(source)
    channels = {c.topic: number for number, c in source.channels.items()}
    panels = layout["configById"]
    assert sorted(leaves(layout["layout"])) == sorted(panels)
    for config in panels.values():
        for topic in [*config.get("topics", {}), config.get("topicToRender")]:
            assert topic is None or topic in logged
        for series in config.get("paths", []):
            topic, *fields = series["value"].split(".")
            value = decoder.decode(channels[topic], next(source.messages([channels[topic]])).data)
            for field in fields:
                value = getattr(value, field)
            assert isinstance(value, float)


def leaves(node):
    if isinstance(node, str):
        return [node]
    return leaves(node["first"]) + leaves(node["second"])


def test_the_rviz_view_shows_topics_that_a_log_has(path):
    view = yaml.safe_load((ROOT / "config" / "impact.rviz").read_text(encoding="utf-8"))
    manager = view["Visualization Manager"]
    types = {
        "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
        "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
    }
    logged = topics_and_types(path)
    shown = [d for d in manager["Displays"] if "Topic" in d]
    assert {d["Topic"]["Value"]: types[d["Class"]] for d in shown}.items() <= logged.items()
    assert any(d["Class"].endswith("MarkerArray") and d["Enabled"] for d in shown)
    assert manager["Global Options"]["Fixed Frame"] == "world"
