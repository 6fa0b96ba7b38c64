"""A log carries the imported helmet: it is shown where the helmet's files are not."""

import hashlib
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")
pytest.importorskip("jinja2", reason="reports need the extra 'report'")

from click.testing import CliRunner
from helmet_meshes import OUTER, ellipsoid, opened, written
from logs import write_log

from helmet_sim_ros import ImpactSetup, open_log
from helmet_sim_ros.cli import main
from helmet_sim_ros.cli.run import named_files
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.explore.meshes import helmet_mesh
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.model import geometry
from helmet_sim_ros.report.page.blocks import unpacked
from helmet_sim_ros.report.page.page import report_page
from helmet_sim_ros.report.replay.scene import admit_helmets, scene_of
from helmet_sim_ros.report.replay.stage import Stage
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study.helmets.importing import ImportPlan, import_helmet, write_helmet_folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes, str]:
    """A log of two impacts with a helmet whose folder is gone; its array file, its foam."""
    folder = tmp_path_factory.mktemp("log")
    shell = written(opened(ellipsoid(OUTER, 4)), folder / "shell.stl")
    imported = import_helmet(shell, None, ImportPlan(thickness=0.04, columns=300))
    path = write_helmet_folder(imported, folder / "mine")
    foam = folder / "mine" / "own.yaml"
    shutil.copy(share_directory() / "config" / "foams" / "epp.yaml", foam)
    setups = [
        ImpactSetup(
            rig="headform",
            direction=direction,
            helmet=str(path),
            duration=0.02,
            overrides={"helmet.liner.foam": str(foam)},
        )
        for direction in ("front", "back")
    ]
    array = next((folder / "mine").glob("*.npz")).read_bytes()
    write_log(folder / "log.mcap", setups)
    text = foam.read_text()
    shutil.rmtree(folder / "mine")
    geometry._admitted.clear()
    return folder / "log.mcap", array, text


def test_the_files_of_the_helmet_are_in_the_log_once(made: tuple[Path, bytes, str]) -> None:
    path, array, foam = made
    log = open_log(path)
    digest = hashlib.sha256(array).hexdigest()[: geometry.DIGITS]
    foams = [name for name in log.files if name.startswith("foam_")]
    assert log.file(f"geometry-{digest}.npz") == array
    assert log.attachment(foams[0]) == foam
    assert sorted(name.partition("-")[0][:5] for name in log.files) == ["foam_", "geome", "model"]
    assert f"geometry-{digest}.npz" not in log.attachments  # no text


def test_without_its_folder_the_helmet_is_shown_with_its_own_shape(
    made: tuple[Path, bytes, str],
) -> None:
    path, _, _ = made
    log = open_log(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry, "_admitted", {})
        assert scene_of(log[0].record).mesh is None  # nobody told of the log's helmet
        admit_helmets(log)
        scene = scene_of(log[0].record)
        assert scene.mesh is not None
        size = np.ptp(scene.mesh.vertices, axis=0)
        assert size == pytest.approx(2.0 * np.array(OUTER), rel=0.02)
        drawn = helmet_mesh(scene.setup.helmet_config).shell
        assert len(drawn.faces) == len(scene.mesh.faces)
        model = Stage(log[0].record).scene.model
        assert model.nmesh == 1 and model.mesh_facenum[0] == len(scene.mesh.faces)


def test_review_report_and_recovery_need_no_folder(
    made: tuple[Path, bytes, str], tmp_path: Path
) -> None:
    path, array, _ = made
    answer = CliRunner().invoke(main, ["review", str(path)])
    assert answer.exit_code == 0, answer.output
    page = report_page([open_log(path)])
    assert "No replay" not in page
    meshes = re.findall(r'<script type="text/plain" data-mesh="(\w+)">(.*?)</script>', page)
    assert len(meshes) == 1 and len(meshes[0][1]) < 40_000  # one for both impacts
    _, drawn = unpacked(meshes[0][1])
    blocks = re.findall(
        r'<article.*?<script type="text/plain" data-block>(.*?)</script>', page, re.S
    )
    vertices = drawn["vertices"].reshape(3, -1)
    for text, axis in zip(blocks, (1.0, -1.0), strict=True):
        plain, arrays = unpacked(text)
        crushed = arrays["replay_crush"] > 0.5
        assert plain["replay"]["mesh"] == meshes[0][0]
        assert crushed.any() and (axis * vertices[0, crushed] > 0.08).all()
    cut = tmp_path / "cut.mcap.part"
    cut.write_bytes(path.read_bytes()[:-100])
    log = open_log(recover(cut).path)
    assert log.file(next(name for name in log.files if name.endswith(".npz"))) == array


def test_a_damaged_helmet_is_told_and_the_ellipsoid_shown(
    made: tuple[Path, bytes, str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, array, _ = made
    content = bytearray(path.read_bytes())
    content[content.index(array) + len(array) // 2] ^= 1
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(content)
    log = open_log(damaged)
    name = next(name for name in log.files if name.endswith(".npz"))
    with pytest.raises(LogError, match="checksum of the attachment"):
        log.file(name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry, "_admitted", {})
        admit_helmets(log)
        assert "checksum of the attachment" in caplog.text
        assert scene_of(log[0].record).mesh is None


def test_the_nodes_of_a_run_may_open_the_files_of_its_helmet(made: tuple[Path, bytes, str]) -> None:
    setup = open_log(made[0])[0].setup
    named = named_files([setup, {"helmet.name": "fullface", "impact.surface": "ground"}])
    assert [Path(name).suffix for name in named] == [".npz", ".yaml", ".yaml"]
    assert {Path(name).name for name in named} >= {"helmet.yaml", "own.yaml"}
