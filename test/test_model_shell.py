"""The shell as a plate between anvil and liner: limits, refinement, balance."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.force.laying import RESTS, lay
from helmet_sim_ros.model.force.plate import COLUMNS, FIRST_COLUMN, FIRST_ROW, ROWS, Plate
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.impact import Impact

ANVILS = {"kerbstone": 7.5, "hemisphere": 5.2, "flat_anvil": 7.5}
NO_BENDING = {"helmet.shell.material.modulus": 0.0}
#: 10 mm of something that does not yield: 148 times the stiffness of the helmet's own shell.
RIGID = {
    "helmet.shell.material.thickness": 0.01,
    "helmet.shell.material.modulus": 72e9,
    "helmet.shell.material.strength": 5e9,
}


def drop(surface: str, speed: float, **overrides: object) -> ImpactRecord:
    return simulate(setup(surface, speed, **overrides))


def setup(surface: str, speed: float, **overrides: object) -> ImpactSetup:
    return ImpactSetup(
        rig="headform", direction="top", normal_velocity=speed, surface=surface, duration=0.02,
        overrides={"helmet.coupling": "foam", "head.form": "en960_j"} | overrides,
    )  # fmt: skip


def peak_g(record: ImpactRecord) -> float:
    return evaluate(record, criteria=["peak_g"]).peak_g.value


def test_bending_stiffness_is_that_of_a_plate() -> None:
    material = load_helmet("fullface").shell.material
    t, e, nu = material.thickness, material.modulus, material.poisson
    assert material.bending_stiffness == pytest.approx(e * t**3 / (12 * (1 - nu**2)))


def test_on_the_plane_ground_the_shell_changes_no_bit() -> None:
    with_shell, without = drop("ground", 7.5), drop("ground", 7.5, **NO_BENDING)
    assert np.array_equal(with_shell.head_acceleration, without.head_acceleration)


@pytest.mark.parametrize("surface", ANVILS)
def test_without_bending_stiffness_columns_are_crushed_one_by_one(surface: str) -> None:
    impact = Impact(setup(surface, ANVILS[surface], **NO_BENDING))
    impact.advance(impact.total)
    thin = drop(surface, ANVILS[surface], **{"helmet.shell.material.thickness": 0.0})
    assert np.array_equal(impact.record().head_acceleration, thin.head_acceleration)
    assert impact._simulation.forces.shell.engaged[0] == 0


@pytest.mark.parametrize("surface", ANVILS)
def test_a_rigid_shell_gives_the_load_of_flat_ground_on_every_anvil(surface: str) -> None:
    speed = ANVILS[surface]
    flat = peak_g(drop("ground", speed))
    assert peak_g(drop(surface, speed, **RIGID)) == pytest.approx(flat, rel=0.03)


@pytest.mark.parametrize(("surface", "low", "high"), [("kerbstone", 0.5, 0.85),
                                                       ("hemisphere", 0.4, 0.85)])  # fmt: skip
def test_kerb_and_hemisphere_are_softer_than_flat_ground_at_the_same_speed(
    surface: str, low: float, high: float
) -> None:
    assert low < peak_g(drop(surface, 6.0)) / peak_g(drop("ground", 6.0)) < high


def test_a_stiffer_shell_spreads_the_load_further() -> None:
    peaks, reached = [], []
    for thickness in (0.0015, 0.003, 0.006):
        record = drop("hemisphere", 5.2, **{"helmet.shell.material.thickness": thickness})
        peaks.append(peak_g(record))
        reached.append(int(np.count_nonzero(record.extras["crush"] > 0.05)))
    assert peaks == sorted(peaks)
    assert reached == sorted(reached)


@pytest.mark.parametrize("surface", ANVILS)
def test_grid_columns_and_steps_converge_within_one_percent(surface: str) -> None:
    speed = ANVILS[surface]
    peak = peak_g(drop(surface, speed))
    finer = peak_g(drop(surface, speed, **{"helmet.liner.columns": 2000}))
    assert finer == pytest.approx(peak, rel=0.01)
    finer = peak_g(
        drop(surface, speed, **{"helmet.liner.columns": 2000, "helmet.shell.cell": 0.003})
    )
    assert finer == pytest.approx(peak, rel=0.012)
    shorter = peak_g(drop(surface, speed, **{"sim.time_step": 2.5e-5}))
    assert shorter == pytest.approx(peak, rel=0.01)


@pytest.mark.parametrize("surface", ANVILS)
def test_momentum_changes_by_the_impulse_of_the_anvil(surface: str) -> None:
    impact = Impact(setup(surface, ANVILS[surface]))
    impact.advance(impact.total)
    record = impact.record()
    helmet, head = impact.setup.helmet_config.mass, 4.7
    weight = (helmet + head) * impact.setup.gravity
    states = list(impact.states())
    momentum = [_momentum(impact, q, v) for q, v in (states[0], states[-1])]
    impulse = np.trapezoid(record.ground_force[:, 2] - weight, record.time)
    assert momentum[1] - momentum[0] == pytest.approx(impulse, rel=3e-3)


def _momentum(impact: Impact, q: np.ndarray, v: np.ndarray) -> float:
    import mujoco

    data = mujoco.MjData(impact.model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(impact.model, data)
    mujoco.mj_subtreeVel(impact.model, data)
    return float(data.subtree_linvel[1][2] * impact.model.body_subtreemass[1])


@pytest.mark.parametrize(
    ("direction", "surface", "normal", "along", "heading"),
    [("back", "kerbstone", 4.0, 8.5, -119.0), ("front", "hemisphere", 4.3, 7.0, -69.0)],
)
def test_a_thin_shell_that_slides_over_an_anvil_is_not_flung(
    direction: str, surface: str, normal: float, along: float, heading: float
) -> None:
    """Its plate flew off, and strained columns by fifty times what they have."""
    impact = Impact(
        ImpactSetup(
            rig="headform", helmet="bicycle", direction=direction, surface=surface,
            normal_velocity=normal, tangential_velocity=along, tangential_heading_deg=heading,
            duration=0.03, overrides={"helmet.coupling": "foam"},
        )
    )  # fmt: skip
    impact.run()
    assert 0.4 < impact._simulation.forces.liner.largest.max() < 1.0


def test_the_plate_is_laid_anew_where_the_helmet_meets_another_side() -> None:
    """It stayed in the plane of the post, from where the road looks like a wall, and foam that came
    down on the road was crushed through at once."""
    impact = Impact(
        ImpactSetup(
            rig="rider", helmet="fullface_chin", direction="front", surface="post",
            normal_velocity=5.226157933702445, tangential_velocity=18.597190146088238,
            tangential_heading_deg=128.12842597800352,
            duration=0.03, overrides={"helmet.coupling": "foam"},
        )
    )  # fmt: skip
    impact.run()
    force = np.linalg.norm(impact.record().ground_force, axis=1)
    assert force[-1] > 5e3  # on the road
    assert np.abs(np.diff(force)).max() < 2e3


def test_a_plate_tipped_over_an_anvil_does_not_lever_the_helmet_up() -> None:
    """A grazing blow tipped it, and its far end rose into the foam until all diverged."""
    impact = Impact(
        ImpactSetup(
            rig="headform", helmet="bicycle", direction="top", surface="hemisphere",
            normal_velocity=3.526463263233223, tangential_velocity=18.45074320874553,
            tangential_heading_deg=160.18134161, duration=0.03,
            overrides={"helmet.coupling": "foam"},
        )
    )  # fmt: skip
    impact.run()
    assert impact._simulation.forces.liner.largest.max() < 1.0


def test_on_a_face_larger_than_the_contact_the_plate_stays_as_it_was_laid() -> None:
    impact = Impact(setup("flat_anvil", 1.5))
    impact.run()
    shell = impact._simulation.forces.shell
    assert shell.engaged[0] == RESTS
    assert not shell.grid.height.any()
    assert peak_g(impact.record()) == pytest.approx(peak_g(drop("ground", 1.5)), rel=0.01)


@pytest.mark.parametrize("surface", ANVILS)
def test_shorter_steps_within_the_plate_change_nothing(surface: str) -> None:
    impact = Impact(setup(surface, ANVILS[surface]))
    forces = impact._simulation.forces
    grid = forces.shell.grid._replace(longest=0.5 * forces.shell.grid.longest)
    forces = forces._replace(shell=forces.shell._replace(grid=grid))
    impact._simulation = impact._simulation._replace(forces=forces)
    impact.run()
    peak = peak_g(drop(surface, ANVILS[surface]))
    assert peak_g(impact.record()) == pytest.approx(peak, rel=5e-3)


def nodes(grid: Plate, a: np.ndarray) -> np.ndarray:
    """Those of the window, (rows, columns)."""
    rows, columns = int(grid.window[ROWS]) + 2, int(grid.window[COLUMNS]) + 2
    return a[: rows * columns].reshape(rows, columns)[1:-1, 1:-1].copy()


def test_the_window_reaches_beyond_all_that_foam_presses() -> None:
    impact = Impact(setup("hemisphere", 5.2))
    grid, areas = impact._simulation.forces.shell.grid, []
    for sample in range(50, 200, 25):
        impact.advance(sample)
        pressed = np.argwhere(nodes(grid, grid.steepness) > 0.0)
        if not len(pressed):
            continue
        areas.append(int(grid.window[ROWS] * grid.window[COLUMNS]))
        assert pressed.min() >= int(grid.overhang) > 2
        assert (pressed <= grid.window[:2] - 1 - int(grid.overhang)).all()
    assert len(areas) > 3
    assert min(areas) < 0.9 * max(areas)  # it grows with the contact


def test_a_window_laid_anew_keeps_its_nodes_and_finds_what_is_below_the_others() -> None:
    impact = Impact(setup("hemisphere", 5.2))
    impact.advance(100)
    forces = impact._simulation.forces
    grid, window = forces.shell.grid, forces.shell.grid.window
    height, speed = nodes(grid, grid.height), nodes(grid, grid.speed)
    rows, columns, row, column = window.tolist()
    lay(forces.shell, forces.surface, rows - 3, columns + 4, row + 2, column - 3)
    assert window.tolist() == [rows - 3, columns + 4, row + 2, column - 3]
    assert np.array_equal(nodes(grid, grid.height)[:, 3:-1], height[2:-1])
    assert np.array_equal(nodes(grid, grid.speed)[:, 3:-1], speed[2:-1])
    radius = 0.048
    x = grid.cell * (window[FIRST_ROW] + np.arange(rows - 3))[:, None]
    y = grid.cell * (window[FIRST_COLUMN] + np.arange(columns + 4))[None, :]
    away = np.hypot(x, y)
    over = away < 0.9 * radius
    below = np.sqrt(np.where(over, radius**2 - away**2, 0.0)) - radius
    assert np.abs(nodes(grid, grid.anvil) - below)[over].max() < 1e-6
    assert (nodes(grid, grid.anvil)[away > radius] < -0.5).all()


def test_a_liner_crushed_beyond_its_foam_says_where() -> None:
    notes = drop("hemisphere", 12.0).extras["notes"]
    assert any("more than foam has" in note and "mm" in note for note in notes)
    assert not any("more than foam has" in note for note in drop("ground", 5.0).extras["notes"])
