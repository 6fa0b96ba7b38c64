"""From residual crush to the crash: synthetic crush maps with a known truth."""

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.study.reconstruction import posterior
from helmet_sim_ros.study.reconstruction.crash import (
    DURATION,
    residual_crush,
    scene,
    setup_of,
    site,
)
from helmet_sim_ros.study.reconstruction.crush_map import (
    CrushMap,
    directions,
    interpolation,
    on_shell,
    read_crush_map,
)
from helmet_sim_ros.study.reconstruction.posterior import (
    UNITS,
    Reconstruction,
    _kept,
    _middle,
    most_likely,
    reconstruct,
)

FOAM = ImpactSetup(rig="headform", duration=DURATION, overrides={"helmet.coupling": "foam"})
NOISE = 0.5e-3  # m
SCANNED = 0.11  # m about the crush


def crashed(normal: float, x: float, y: float, azimuth: float, elevation: float) -> ImpactSetup:
    return FOAM.replaced(  # type: ignore[no-any-return]
        {
            "normal_velocity": normal,
            "tangential_velocity": float(np.hypot(x, y)),
            "tangential_heading_deg": float(np.degrees(np.arctan2(y, x))),
            "azimuth_deg": azimuth,
            "elevation_deg": elevation,
        }
    )


def scan(setup: ImpactSetup, seed: int) -> CrushMap:
    """The crush map that a scan of the helmet would give."""
    impact = Impact(setup)
    impact.advance(impact.total)
    cells, residual = columns(setup.helmet_config), impact.extras()["residual_crush"]
    middle = cells.point[residual > 2e-4].mean(axis=0)
    near = np.linalg.norm(cells.point - middle, axis=1) < SCANNED
    noise = NOISE * np.random.default_rng(seed).standard_normal(int(near.sum()))
    return CrushMap(cells.point[near], residual[near] + noise)


@pytest.fixture(scope="module")
def sliding() -> tuple[CrushMap, Reconstruction]:
    """The map of a blow that slides, and what is made of it."""
    whole = scan(crashed(5.5, 3.0, -4.0, 75.0, 30.0), 1)
    return whole, reconstruct(whole, FOAM, NOISE)


def test_a_crash_is_found_again_with_its_uncertainty(sliding) -> None:
    """How often truths lie in the intervals counts bench_reconstruction.py."""
    _, result = sliding
    angle = float(np.degrees(np.arctan2(5.5, 5.0)))
    truth = {"normal_velocity": 5.5, "tangential_velocity": 5.0, "speed": np.hypot(5.5, 5.0),
             "angle": angle, "azimuth": 75.0, "elevation": 30.0}  # fmt: skip
    assert truth.keys() == UNITS.keys()
    for name, value in truth.items():
        low, _, high = result.interval(name, 0.99)
        assert low <= value <= high, (name, value, low, high)
    low, _, high = result.interval("normal_velocity")
    assert high - low < 0.5
    assert 0.8 < result.misfit < 1.2
    assert result.emulator_error < 0.4 * NOISE  # of a crush that is followed from both ends


def test_a_long_crush_is_followed_from_both_ends() -> None:
    """A slower blow that slid one way explains it as well as a faster one that slid the other."""
    crush = scan(crashed(3.85, 2.58, -4.1, 59.3, -0.8), 1)
    cells = columns(FOAM.helmet_config)
    whole = scene(FOAM, _middle(crush, cells), 10.0, 8.0)
    index, weight = interpolation(cells, crush.place)
    ends = [
        end for end, _ in most_likely(
            whole, crush.depth, NOISE,
            lambda points: (residual_crush(whole, points)[:, index] * weight).sum(axis=2),
        )
    ]  # fmt: skip
    assert any(abs(end[0] - 3.85) < 0.15 and end[1] > 1.0 and end[2] < -3.0 for end in ends)
    assert any(end[0] > 4.2 and end[2] > 1.0 for end in ends)


def test_a_few_depths_tell_less_than_a_map(sliding) -> None:
    whole, map_ = sliding
    deepest = np.argsort(-whole.depth)[:4]
    few = reconstruct(CrushMap(whole.place[deepest], whole.depth[deepest]), FOAM, NOISE)
    for name in ("normal_velocity", "azimuth"):
        assert few.told[name] > 1.3 * map_.told[name]
    low, _, high = few.interval("normal_velocity", 0.99)
    assert low <= 5.5 <= high


def test_a_map_of_another_helmet_is_not_explained() -> None:
    data = crashed(6.0, 0.0, 0.0, 90.0, 20.0).model_dump()
    data["overrides"] = {**data["overrides"], "helmet.liner.thickness": 0.025}
    thin = scan(ImpactSetup(**data), 3)
    wavy = thin.depth + 4e-3 * np.sin(200.0 * thin.place[:, 2])
    result = reconstruct(CrushMap(thin.place, wavy), FOAM, NOISE)
    assert result.misfit > 2.0 and any("misses the map" in note for note in result.notes)


def test_crashes_that_diverge_are_left_out_until_they_are_too_many() -> None:
    points, crush = np.arange(10.0)[:, None], np.ones((10, 2))
    crush[:2, 1] = np.nan
    kept, depths = _kept(points, crush)
    assert kept.ravel().tolist() == list(range(2, 10)) and depths.shape == (8, 2)
    crush[2, 0] = np.inf
    with pytest.raises(StudyError, match="3 of 10 simulations diverged"):
        _kept(points, crush)


def test_places_about_the_scene_turn_by_their_angles() -> None:
    about = scene(FOAM, np.array([0.0, 1.0, 0.0]), 10.0, 8.0)
    azimuth, elevation = site(about, np.radians([0.0, 10.0, 0.0]), np.radians([0.0, 0.0, 10.0]))
    assert azimuth == pytest.approx([90.0, 100.0, 90.0])
    assert elevation == pytest.approx([0.0, 0.0, 10.0])
    setup = setup_of(about, np.array([5.0, 3.0, 4.0, 0.0, 0.0]))
    assert (setup.normal_velocity, setup.tangential_velocity) == pytest.approx((5.0, 5.0))


@pytest.mark.parametrize(("unit", "length"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0),
                                              ("in", 0.0254)])  # fmt: skip
def test_a_crush_map_is_the_same_in_every_unit_and_by_angles(
    unit: str, length: float, tmp_path: Path
) -> None:
    cells = columns(FOAM.helmet_config)
    azimuth, elevation, depth = np.radians([20.0, 60.0]), np.radians([10.0, 50.0]), 0.004
    place = on_shell(cells, directions(azimuth, elevation))
    assert place[0] / np.linalg.norm(place[0]) == pytest.approx(
        [np.cos(azimuth[0]) * np.cos(elevation[0]), np.sin(azimuth[0]) * np.cos(elevation[0]),
         np.sin(elevation[0])]
    )  # fmt: skip
    by_place = "\n".join(";".join(f"{v / length:.9g}" for v in (*p, depth)) for p in place)
    by_angle = "\n".join(f"{a};{e};{depth / length:.9g}" for a, e in ((20, 10), (60, 50)))
    for heading, rows in (
        (f"x [{unit}];y [{unit}];z [{unit}];depth [{unit}]", by_place),
        (f"azimuth [deg];elevation [deg];depth [{unit}]", by_angle),
    ):
        (tmp_path / "crush.csv").write_text(f"{heading}\n{rows}")
        found = read_crush_map(tmp_path / "crush.csv", cells)
        assert found.depth == pytest.approx([depth, depth])
        assert found.place == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("x [mm];y [mm];z [mm]\n150;0;0", "no column named depth"),
        ("x [mm];y [mm];depth [mm]\n150;0;5", "must have the columns"),
        ("x [mm];y [mm];z [mm];depth\n150;0;0;5", "no unit"),
        ("x [mm];y [mm];z [mm];depth [mm]\n150;0;0;500", "row 2"),
        ("x [m];y [m];z [m];depth [mm]\n0.150;0;0;5\n150;0;0;5", "row 3"),
        ("x [mm];y [mm];z [mm];depth [mm]\n150;0;0;nan", "row 2"),
        ("x [mm];y [mm];z [mm];depth [mm]\n150;0;0;0", "nothing was crushed"),
    ],
)
def test_what_is_no_crush_map_is_refused_with_its_place(
    text: str, named: str, tmp_path: Path
) -> None:
    path = tmp_path / "crush.csv"
    path.write_text(text)
    with pytest.raises(SetupError) as caught:
        read_crush_map(path, columns(FOAM.helmet_config))
    assert named in str(caught.value)


def test_the_command_shows_the_intervals_and_writes_the_sample(
    sliding, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it hands over is what the table and the options say; the rest is tested above."""
    whole, found = sliding
    rows = np.column_stack([1e3 * whole.place, 1e3 * whole.depth])
    lines = [";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in rows]
    file, sample = tmp_path / "crush.csv", tmp_path / "sample.csv"
    file.write_text("\n".join(["x [mm];y [mm];z [mm];depth [mm]", *lines]))
    asked: list[tuple[object, ...]] = []
    monkeypatch.setattr(posterior, "reconstruct", lambda *given: asked.append(given) or found)
    words = ["reconstruct", "fullface", "--residual", str(file), "--samples", str(sample)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    options = ["--noise", "0.4", "--fastest", "9", "--along", "7", "--seed", "3",
               "--friction", "0.3", "--head-mass", "5", "--surface", "kerbstone"]  # fmt: skip
    assert CliRunner().invoke(main, [*words[:4], *options]).exit_code == 0
    (crush, setup, *rest), (_, other, *others) = asked
    assert crush.place == pytest.approx(whole.place, abs=1e-8)
    assert crush.depth == pytest.approx(whole.depth, abs=1e-8)
    assert (setup.rig, setup.surface, rest) == ("headform", "ground", [0.5e-3, 10.0, 8.0, 0])
    assert setup.helmet_config.coupling == "foam"
    assert (other.surface, other.friction, others) == ("kerbstone", 0.3, [0.4e-3, 9.0, 7.0, 3])
    assert other.described()["rider.head_mass"] == 5.0
    for name, unit in UNITS.items():
        low, middle, high = found.interval(name)
        numbers = rf" +{low:.2f} +{middle:.2f} +{high:.2f} +{100.0 * found.told[name]:.0f} %"
        assert re.search(name.replace("_", " ") + " +" + unit + numbers, result.output), name
    assert f"{found.simulations} simulations" in result.output
    table = np.genfromtxt(sample, delimiter=",", names=True)
    assert len(table.dtype.names) == len(UNITS)
    column = next(name for name in table.dtype.names if name.startswith("normal_velocity"))
    quartiles = np.percentile(table[column], [5.0, 50.0, 95.0])
    assert quartiles == pytest.approx(found.interval("normal_velocity"), rel=1e-3)
    for key, value in (("noise", "0"), ("fastest", "21"), ("along", "0.1")):
        refused = CliRunner().invoke(main, [*words, f"--{key}", value])
        assert refused.exit_code == 2 and f"{key} = " in refused.stderr
