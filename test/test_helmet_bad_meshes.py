"""Meshes that are no helmet's: each is refused, or mended and told of; nothing is half-written."""

import hashlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from helmet_meshes import INNER, OUTER, ellipsoid, opened, written

from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.geometry import admit, read_geometry
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.study.helmets.crossings import DEPTH, crossings
from helmet_sim_ros.study.helmets.importing import ImportPlan, import_helmet


@pytest.fixture
def shell(tmp_path: Path) -> Path:
    return written(ellipsoid(OUTER, 4), tmp_path / "shell.stl")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["helmet", "import", *map(str, arguments)])


def refused(folder: Path, *arguments: object) -> str:
    """The message of an import that must be refused, and leave nothing."""
    before = sorted(folder.iterdir())
    result = run(*arguments, "-o", folder / "mine")
    assert result.exit_code == 2, result.output
    assert sorted(folder.iterdir()) == before
    return result.output.replace("\n", " ")


def test_the_command_writes_a_helmet_and_tells_what_it_found(shell: Path, tmp_path: Path) -> None:
    inner = written(ellipsoid(INNER, 4), tmp_path / "inner.stl")
    result = run(shell, "--liner", inner, "--mass", 1.35, "-o", tmp_path / "mine")
    assert result.exit_code == 0, result.output
    assert "closed" in result.output and "in mm" in result.output
    assert "corrected to the scale's 1.35 kg" in result.output
    helmet = load_helmet(str(tmp_path / "mine" / "helmet.yaml"))
    assert helmet.mass == pytest.approx(1.35) and helmet.coupling == "foam"
    assert sorted(p.suffix for p in (tmp_path / "mine").iterdir()) == [".npz", ".yaml"]


@pytest.mark.parametrize(("unit", "scale"), [("in", 0.0254), ("cm", 0.01), ("m", 1.0)])
def test_units_are_told_by_the_size(unit: str, scale: float, tmp_path: Path) -> None:
    shell = written(ellipsoid(OUTER, 4), tmp_path / "shell.ply", scale)
    result = import_helmet(shell, None, ImportPlan(thickness=0.04))
    assert f"in {unit}" in result.notes[0]
    assert np.asarray(result.geometry.semi_axes) == pytest.approx(OUTER, rel=0.01)


def test_a_solid_shell_tells_its_thickness(tmp_path: Path) -> None:
    """The wall is not flat ground's matter, but bends on kerb and hemisphere."""
    outer, inner = ellipsoid(OUTER, 4), ellipsoid((0.146, 0.126, 0.136), 4)
    inner.invert()
    shell = written(trimesh.util.concatenate([outer, inner]), tmp_path / "shell.stl")
    solid = import_helmet(shell, None, ImportPlan(thickness=0.036))
    sheet = import_helmet(written(outer, tmp_path / "sheet.stl"), None, ImportPlan(thickness=0.04))
    assert any("shell 4.0 mm thick" in note for note in solid.notes)
    assert solid.values["shell"]["material"]["thickness"] == pytest.approx(0.004, abs=1e-4)  # type: ignore[index]
    base = load_helmet("fullface").shell.material
    assert sheet.values["shell"]["material"] == base.model_dump()  # type: ignore[index]


def test_inches_given_as_millimetres_are_refused(tmp_path: Path) -> None:
    shell = written(ellipsoid(OUTER, 4), tmp_path / "shell.stl", 0.0254)
    message = refused(tmp_path, shell, "--units", "mm")
    assert "shell.units" in message and "its size fits in" in message and "shell.stl" in message


def test_a_mesh_inside_out_is_turned_and_told_of(tmp_path: Path) -> None:
    mesh = ellipsoid(OUTER, 4)
    right = import_helmet(written(mesh, tmp_path / "a.stl"), None, ImportPlan(thickness=0.04))
    mesh.invert()
    wrong = import_helmet(written(mesh, tmp_path / "b.stl"), None, ImportPlan(thickness=0.04))
    assert any("b.stl: inside out" in note for note in wrong.notes)
    assert not any("inside out" in note for note in right.notes)
    assert wrong.geometry.normal == pytest.approx(right.geometry.normal, abs=1e-6)


def test_an_open_mesh_is_told_of(tmp_path: Path) -> None:
    mesh = opened(ellipsoid(OUTER, 5))
    result = import_helmet(written(mesh, tmp_path / "a.stl"), None, ImportPlan(thickness=0.04))
    assert any("not closed" in note and "edges have one triangle" in note for note in result.notes)


def test_a_mesh_that_intersects_itself_is_refused_with_triangles_and_place(tmp_path: Path) -> None:
    knob = ellipsoid((0.02, 0.02, 0.02), 3)
    knob.apply_translation([0.15, 0.0, 0.0])
    shell = written(trimesh.util.concatenate([ellipsoid(OUTER, 4), knob]), tmp_path / "shell.stl")
    message = refused(tmp_path, shell, "--thickness", "40 mm")
    told = re.search(
        r"shell\.stl.*: intersects itself: triangle (\d+) goes through (\d+) of 6400 at "
        r"\((.*)\) mm, and (\d+) more",
        message,
    )
    assert told, message
    first, second = (int(number) - 1 for number in told.group(1, 2))
    read = trimesh.load_mesh(shell, process=False)
    place = np.array([float(c) for c in told[3].split(",")])
    for face in (first, second):
        corners = read.triangles[face]
        assert np.abs(trimesh.triangles.closest_point([corners], [place])[0] - place).max() < 0.1
    allowed = import_helmet(shell, None, ImportPlan(thickness=0.04, intersecting=True))
    assert any("shell.stl: intersects itself" in note for note in allowed.notes)


@pytest.mark.parametrize("seed", range(3))
def test_every_edge_that_pierces_a_triangle_is_found(seed: int) -> None:
    """Against the plain test of every edge with every triangle, on a crumpled ellipsoid."""
    rng = np.random.default_rng(seed)
    mesh = ellipsoid(OUTER, 3)
    mesh.vertices += rng.normal(0.0, 0.01, mesh.vertices.shape)
    corner, normal = mesh.triangles[:, 0], mesh.face_normals
    away = mesh.vertices @ normal.T - (corner * normal).sum(axis=1)  # each vertex of each plane
    pierced = set()
    for edge in mesh.edges_unique:
        a, b = mesh.vertices[edge]
        before, after = away[edge]
        through = (before * after < 0.0) & (np.minimum(abs(before), abs(after)) > DEPTH)
        faces = np.flatnonzero(through & ~np.isin(mesh.faces, edge).any(axis=1))
        share = before[faces] / (before[faces] - after[faces])
        places = a + share[:, None] * (b - a)
        inside = trimesh.triangles.points_to_barycentric(mesh.triangles[faces], places)
        hit = inside.min(axis=1) > 0.0
        pierced |= {(f, *np.round(p, 9)) for f, p in zip(faces[hit], places[hit], strict=True)}
    found = crossings(mesh)
    assert len(pierced) > 50
    assert {(face, *np.round(p, 9)) for face, p in zip(found.other, found.place, strict=True)} == (
        pierced
    )


@pytest.mark.parametrize("pierced", [0, 1])
def test_an_edge_through_a_triangle_is_found_whatever_their_order(pierced: int) -> None:
    flat = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0]]
    upright = [[0.01, 0.02, -0.05], [0.01, 0.02, 0.05], [0.3, 0.3, 0.0]]
    corners = [flat, upright] if pierced == 0 else [upright, flat]
    mesh = trimesh.Trimesh(np.vstack(corners), [[0, 1, 2], [3, 4, 5]], process=False)
    found = crossings(mesh)
    places = {(f, *np.round(p, 9)) for f, p in zip(found.other, found.place, strict=True)}
    assert (pierced, 0.01, 0.02, 0.0) in places


def test_a_truncated_file_is_refused(shell: Path, tmp_path: Path) -> None:
    shell.write_bytes(shell.read_bytes()[:-1000])
    assert "truncated" in refused(tmp_path, shell)
    text = tmp_path / "text.stl"
    text.write_text(trimesh.exchange.stl.export_stl_ascii(ellipsoid(OUTER, 3))[:-200])
    assert "ends with 'endsolid'" in refused(tmp_path, text)
    ply = written(ellipsoid(OUTER, 3), tmp_path / "shell.ply")
    ply.write_bytes(ply.read_bytes()[:-500])
    assert "shell.ply" in refused(tmp_path, ply)


def test_a_mesh_with_values_that_are_not_finite_is_refused(tmp_path: Path) -> None:
    mesh = tmp_path / "shell.obj"
    lines = ellipsoid(OUTER, 3).export(file_type="obj").splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("v "))
    lines[first] = "v nan 0 0"
    mesh.write_text("\n".join(lines))
    assert "not finite" in refused(tmp_path, mesh)


def test_a_liner_outside_the_shell_is_refused_with_the_place(shell: Path, tmp_path: Path) -> None:
    inner = written(ellipsoid((0.16, 0.14, 0.15), 4), tmp_path / "inner.stl")
    message = refused(tmp_path, shell, "--liner", inner)
    assert "lies outside the shell by up to" in message and "inner.stl" in message
    assert "mm (head axes)" in message


def test_a_head_that_does_not_fit_is_refused_with_the_place(shell: Path, tmp_path: Path) -> None:
    message = refused(tmp_path, shell, "--thickness", "60 mm")
    assert "headform = 'J': does not fit" in message and "(head axes)" in message
    assert (
        run(shell, "--thickness", "60 mm", "--headform", "Q", "-o", tmp_path / "x").exit_code == 2
    )


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--thickness", "40"], "with its unit"),
        (["--forward", "w"], "forward"),
        (["--forward", "x", "--up", "-x"], "across forward"),
        (["--zone", "chin: z < 0 mm"], "zone = 'chin'"),
        (["--zone", "top: z > 900 mm"], "holds no cell"),
        (["--zone", "top: #ff0000"], "no colours"),
        (["--origin", "1,2"], "three numbers"),
        (["--origin", "150,0,0"], "within 20 mm"),
        (["--landmark", "left=0,130,0"], "misses"),
        (["--base", "nope"], "must be one of"),
    ],
)
def test_wrong_options_are_refused_by_name(
    shell: Path, tmp_path: Path, arguments: list[str], named: str
) -> None:
    assert named in refused(tmp_path, shell, *arguments)


def test_other_files_and_existing_folders_are_refused(shell: Path, tmp_path: Path) -> None:
    (tmp_path / "step.step").write_text("ISO-10303-21;")
    assert ".stl, .obj, .ply" in refused(tmp_path, tmp_path / "step.step")
    assert "no such file" in refused(tmp_path, tmp_path / "nothing.stl")
    (tmp_path / "mine").mkdir()
    assert "exists already" in refused(tmp_path, shell, "--thickness", "40 mm")


def test_an_edited_array_file_is_refused(shell: Path, tmp_path: Path) -> None:
    run(shell, "--thickness", "40 mm", "-o", tmp_path / "mine")
    array = next((tmp_path / "mine").glob("*.npz"))
    content = array.read_bytes()
    array.write_bytes(content[:-10])
    with pytest.raises(SetupError, match="truncated or edited"):
        read_geometry(str(array))
    array.write_bytes(content)
    assert len(read_geometry(str(array)).area) == 1000
    with pytest.raises(SetupError, match=r"liner\.columns"):
        load_helmet(str(tmp_path / "mine" / "helmet.yaml")).replaced({"liner.columns": 500})


def test_an_array_file_that_swells_is_refused() -> None:
    """A log of others brings its helmet's array file: it takes no more memory than a helmet's."""
    swollen = io.BytesIO()
    np.savez_compressed(swollen, point=np.zeros((10**7, 3)))
    content = swollen.getvalue()
    assert len(content) < 1e6
    name = f"geometry-{hashlib.sha256(content).hexdigest()[:16]}.npz"
    with pytest.raises(SetupError, match=r"unpacks to 240\d+ bytes"):
        admit(name, content)


def test_painted_triangles_and_planes_make_zones(tmp_path: Path) -> None:
    mesh = ellipsoid(OUTER, 5)
    high = mesh.triangles_center[:, 2] > 0.06
    mesh.visual.face_colors = np.where(high[:, None], [255, 0, 0, 255], [90, 90, 90, 255])
    painted = import_helmet(
        written(mesh, tmp_path / "shell.ply"), None,
        ImportPlan(thickness=0.04, zones=("top: #ff0000",)),
    )  # fmt: skip
    by_plane = import_helmet(
        written(mesh, tmp_path / "shell.stl"), None,
        ImportPlan(thickness=0.04, zones=("top: z > 60 mm",)),
    )  # fmt: skip
    top = by_plane.geometry.point[:, 2] > 0.06
    assert (by_plane.geometry.weight[top] == [0, 0, 0, 1]).all()
    alike = (painted.geometry.weight == by_plane.geometry.weight).all(axis=1)
    assert alike.mean() > 0.9  # cells on the edge may differ


def test_a_dense_zone_is_dense_where_it_was_put(shell: Path, tmp_path: Path) -> None:
    run(shell, "--thickness", "40 mm", "--zone", "top: z > 60 mm", "-o", tmp_path / "mine")
    helmet = load_helmet(str(tmp_path / "mine" / "helmet.yaml")).replaced(
        {"liner.top.density": 90.0}
    )
    cells = columns(helmet)
    top = cells.point[:, 2] > 0.06
    from helmet_sim_ros.model.force.foam import YIELD, foam_row

    assert cells.foam[top, YIELD] == pytest.approx(foam_row(90.0, 0.05)[YIELD])
