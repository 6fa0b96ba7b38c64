"""Helmets from meshes against the ellipsoid that the meshes were made of."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helmet_meshes import (
    FINE,
    INNER,
    OUTER,
    analytic_with_opening,
    ellipsoid,
    fine_fullface,
    opened,
    written,
)

from helmet_sim_ros.biomech.evaluation import Evaluation, evaluate
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import columns, first_touch
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.helmets.cells import Cells
from helmet_sim_ros.study.helmets.importing import (
    ImportPlan,
    import_helmet,
    write_helmet_folder,
)
from helmet_sim_ros.study.helmets.mass import mass_properties
from helmet_sim_ros.study.scenario.matrix import load_scenario


@dataclass(frozen=True)
class Pair:
    """An imported helmet and the analytic one that it must equal."""

    imported: Helmet
    analytic: Helmet


def imported(
    folder: Path, shell: Path, liner: Path | None = None, **plan: object
) -> tuple[Helmet, tuple[str, ...]]:
    result = import_helmet(shell, liner, ImportPlan(**plan))
    return load_helmet(str(write_helmet_folder(result, folder))), result.notes


def like_fullface(helmet: Helmet) -> Helmet:
    """The helmet with everything but its shape from ``fullface``."""
    base = load_helmet("fullface")
    values = {
        "coupling": "foam",
        "geometry": helmet.geometry,
        "liner.columns": helmet.liner.columns,
    }
    return base.replaced(values)  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    folder = tmp_path_factory.mktemp("whole")
    shell = written(ellipsoid(OUTER), folder / "shell.stl")
    helmet, _ = imported(folder / "mine", shell, thickness=0.044, columns=FINE)
    return Pair(like_fullface(helmet), fine_fullface())


@pytest.fixture(scope="module")
def with_opening(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    folder = tmp_path_factory.mktemp("opened")
    shell = written(opened(ellipsoid(OUTER, 7)), folder / "shell.ply")
    analytic = analytic_with_opening(folder)
    cells = analytic.liner.columns
    helmet, _ = imported(folder / "mine", shell, thickness=0.044, columns=cells)
    return Pair(like_fullface(helmet), analytic)


def with_helmet(setup: ImpactSetup, helmet: Helmet) -> ImpactSetup:
    values = {
        "helmet.geometry": helmet.geometry,
        "helmet.liner.columns": helmet.liner.columns,
        "helmet.coupling": "foam",
    }
    data = setup.model_dump()
    data["overrides"] = {**data["overrides"], **values}
    return ImpactSetup(**data)


def cases(scenario: str) -> Iterator[ImpactSetup]:
    """Until the blow is over: all peaks lie in its first half."""
    for setup in load_scenario(scenario).setups:
        yield setup.replaced({"duration": 0.02})


def apart(setup: ImpactSetup, pair: Pair) -> tuple[Evaluation, Evaluation]:
    return tuple(  # type: ignore[return-value]
        evaluate(simulate(with_helmet(setup, helmet))) for helmet in (pair.imported, pair.analytic)
    )


@pytest.mark.parametrize("kind", ["whole", "with_opening"])
@pytest.mark.parametrize("scenario", ["drop_tests", "oblique_matrix"])
def test_an_imported_ellipsoid_hits_as_the_analytic_one(
    kind: str, scenario: str, request: pytest.FixtureRequest
) -> None:
    """Peak g, HIC and (where there is tangential speed) the force ratio within 1 %."""
    pair = request.getfixturevalue(kind)
    for setup in cases(scenario):
        ours, theirs = apart(setup, pair)
        names = ["peak_g", "hic"] + (["force_ratio"] if setup.tangential_velocity else [])
        for name in names:
            value, truth = getattr(ours, name).value, getattr(theirs, name).value
            assert value == pytest.approx(truth, rel=0.01), (setup.direction, name)


def test_the_cells_have_the_area_and_thickness_of_the_meshes(tmp_path: Path) -> None:
    shell, inner = ellipsoid(OUTER), ellipsoid(INNER)
    helmet, notes = imported(
        tmp_path / "mine", written(shell, tmp_path / "s.obj"), written(inner, tmp_path / "l.ply")
    )
    cells = columns(helmet)
    assert cells.area.sum() == pytest.approx(shell.area, rel=0.01)
    assert np.linalg.norm((cells.area[:, None] * cells.normal).sum(axis=0)) < 1e-6
    # Along the normal the two ellipsoids lie 44 mm apart on the axes, a little less between them.
    assert cells.thickness == pytest.approx(0.044, rel=0.01)
    assert helmet.shell.semi_axes == pytest.approx(OUTER, rel=1e-3)
    assert any("closed" in note for note in notes)


def test_a_mass_that_shell_and_liner_cannot_have_is_refused_with_what_they_can(
    tmp_path: Path,
) -> None:
    shell = written(ellipsoid(OUTER, 3), tmp_path / "s.stl")

    def mass(**plan: float) -> float:
        result = import_helmet(shell, None, ImportPlan(thickness=0.044, columns=100, **plan))
        return float(result.values["mass"])  # type: ignore[arg-type]

    parts = mass()
    assert mass(mass=1.99 * parts) == pytest.approx(1.99 * parts)
    for share in (0.14, 0.49, 2.01):
        with pytest.raises(SetupError, match=f"from {0.5 * parts:.2f} to {2 * parts:.2f} kg"):
            mass(mass=share * parts)
    # With the shell's own mass per area it is taken.
    assert mass(mass=0.3 * parts, areal_density=0.5) == pytest.approx(0.3 * parts)


@pytest.mark.parametrize("depth", [0.005, 0.015, 0.03])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.5, -0.7, 0.6)])
def test_crushed_area_and_volume_are_those_of_the_mesh(
    whole: Pair, direction: tuple[float, float, float], depth: float
) -> None:
    """Against the mesh itself, integrated over its 300 000 triangles, within 2 %."""
    down = np.array(direction) / np.linalg.norm(direction)
    mesh = ellipsoid(OUTER, 7)
    plane = float((mesh.vertices @ down).max()) - depth
    height = mesh.triangles_center @ down - plane
    area = np.where(height > 0.0, mesh.area_faces * (mesh.face_normals @ down), 0.0)
    volume = area @ height

    cells = columns(whole.imported)
    touch = first_touch(whole.imported, down)
    assert touch @ down == pytest.approx(plane + depth, abs=3e-4)
    from helmet_sim_ros.model.force.liner import part_below

    total_area = total_volume = 0.0
    for point, normal, size, radius in zip(
        cells.point, cells.normal, cells.area, cells.radius, strict=True
    ):
        cosine = float(normal @ down)
        share, low, high = part_below(float(point @ down - plane), float(radius), cosine)
        total_area += size * cosine * share
        total_volume += size * cosine * share * 0.5 * (low + high)
    assert total_area == pytest.approx(area.sum(), rel=0.02)
    assert total_volume == pytest.approx(volume, rel=0.02)


def test_a_turned_mesh_is_the_same_helmet(tmp_path: Path) -> None:
    shell = opened(ellipsoid(OUTER))
    straight, _ = imported(tmp_path / "a", written(shell, tmp_path / "a.stl"), thickness=0.04)
    turned = shell.copy()
    turned.vertices = shell.vertices @ np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    # What was x lies along z now, what was z along y.
    again, _ = imported(
        tmp_path / "b", written(turned, tmp_path / "b.stl"), thickness=0.04, forward="z", up="y"
    )
    for name in ("point", "normal", "area", "thickness"):
        one, other = getattr(columns(straight), name), getattr(columns(again), name)
        assert one == pytest.approx(other, abs=1e-6), name


def test_landmarks_turn_a_mesh_as_axes_do(tmp_path: Path) -> None:
    shell = opened(ellipsoid(OUTER))
    straight, _ = imported(tmp_path / "a", written(shell, tmp_path / "a.stl"), thickness=0.04)
    rotation = trimesh.transformations.rotation_matrix(0.7, [0.3, -0.5, 1.0])[:3, :3]
    turned = shell.copy()
    turned.vertices = shell.vertices @ rotation.T
    points = {"front": (150, 0, 0), "back": (-150, 0, 0), "left": (0, 130, 0),
              "right": (0, -130, 0), "top": (0, 0, 140)}  # fmt: skip
    marks = {name: tuple((rotation @ p).tolist()) for name, p in points.items()}
    again, _ = imported(
        tmp_path / "b", written(turned, tmp_path / "b.stl"), thickness=0.04, landmarks=marks
    )
    assert columns(again).point == pytest.approx(columns(straight).point, abs=1e-5)


def test_a_mirrored_mesh_mirrors_the_blow(tmp_path: Path) -> None:
    """A bump on one side: a blow on it from the left is that of its mirror from the right."""
    shell = ellipsoid(OUTER)
    shell.vertices[:, 1] *= 1.0 + 0.1 * np.exp(-((shell.vertices - [0, 0.13, 0.04]) ** 2).sum(
        axis=1) / 0.03**2)  # fmt: skip
    mirrored = shell.copy()
    mirrored.vertices[:, 1] *= -1.0
    mirrored.invert()
    results = {}
    for name, mesh in (("left", shell), ("right", mirrored)):
        helmet, _ = imported(
            tmp_path / name, written(mesh, tmp_path / f"{name}.stl"), thickness=0.044, columns=3000
        )
        setup = ImpactSetup(rig="headform", direction=name, normal_velocity=7.5, duration=0.02,
                            helmet=str(tmp_path / name / "helmet.yaml"))  # fmt: skip
        results[name] = evaluate(simulate(setup))
        assert helmet.coupling == "foam"
    plain = evaluate(simulate(ImpactSetup(
        rig="headform", direction="right", normal_velocity=7.5, duration=0.02,
        helmet=str(tmp_path / "left" / "helmet.yaml"))))  # fmt: skip
    left = results["left"].peak_g.value
    assert results["right"].peak_g.value == pytest.approx(left, rel=0.01)
    assert abs(plain.peak_g.value / left - 1.0) > 0.02


def test_thickness_and_shell_of_an_imported_helmet_can_be_varied(whole: Pair) -> None:
    """As of an analytic one: a zone's thickness, a larger shell."""
    changes = {"liner.top.thickness": 0.03, "shell.semi_axes": (0.16, 0.14, 0.15)}
    ours = columns(whole.imported.replaced(changes))
    theirs = columns(whole.analytic.replaced(changes))
    assert ours.area.sum() == pytest.approx(theirs.area.sum(), rel=0.005)
    for axis in np.eye(3):
        one, other = (c.thickness[(c.normal @ axis).argmax()] for c in (ours, theirs))
        assert one == pytest.approx(other, rel=0.01)


def test_half_a_sphere_has_the_mass_centre_and_inertia_of_its_closed_form() -> None:
    """Shell and liner as two thin shells, each in the middle of its layer."""
    radius, depth, thickness, density, areal, n = 0.14, 0.004, 0.030, 60.0, 4.0, 20_000
    height = (np.arange(n) + 0.5) / n
    turn = np.pi * (3.0 - 5.0**0.5) * np.arange(n)
    across = np.sqrt(1.0 - height**2)
    normal = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    area = np.full(n, 2.0 * np.pi * radius**2 / n)
    cells = Cells(radius * normal, normal, area, np.arange(n))
    full = np.ones(n)
    found = mass_properties(cells, depth * full, thickness * full, density * full, areal)
    outer, inner = radius - depth, radius - depth - thickness
    masses = areal * 2.0 * np.pi * radius**2, density * 2.0 / 3.0 * np.pi * (outer**3 - inner**3)
    assert (found.shell, found.liner) == pytest.approx(masses, rel=1e-9)
    middles = radius - 0.5 * depth, outer - 0.5 * thickness
    whole = sum(masses)
    up = sum(m * 0.5 * r for m, r in zip(masses, middles, strict=True)) / whole
    assert found.center == pytest.approx([0.0, 0.0, up], abs=1e-5)
    about_the_base = sum(2.0 / 3.0 * m * r**2 for m, r in zip(masses, middles, strict=True))
    across_z = about_the_base - whole * up**2
    assert found.inertia == pytest.approx([across_z, across_z, about_the_base], rel=1e-3)
    heavier = found.scaled(2.0 * whole)
    assert heavier.shell + heavier.liner == pytest.approx(2.0 * whole)
    assert heavier.inertia == pytest.approx(2.0 * found.inertia)
    assert (heavier.center == found.center).all()
