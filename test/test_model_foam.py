"""The foam law and the foam helmet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, trapezoid
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import ImpactRecord, same_samples
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.model import foam, liner
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.impact import Impact, simulate
from helmet_sim_ros.model.setup import ImpactSetup

G = 9.80665  # m/s^2
densities = st.floats(20.0, 100.0)


def foam_setup(overrides: dict[str, object] | None = None, **values: object) -> ImpactSetup:
    return ImpactSetup(overrides={"helmet.coupling": "foam", **(overrides or {})}, **values)


def peak_g(record: ImpactRecord) -> float:
    return float(np.linalg.norm(record.head_acceleration, axis=1).max()) / G


@pytest.mark.parametrize(
    ("density", "low", "high"), [(40, 0.30, 0.45), (62, 0.60, 0.70), (80, 0.88, 0.92)]
)
def test_the_yield_stress_lies_in_the_published_range(
    density: float, low: float, high: float
) -> None:
    row = foam.foam_row(density, 0.05)
    assert low <= row[foam.YIELD] / 1e6 <= high


@given(density=densities, strain=st.floats(0.0, 1.0), share=st.floats(0.0, 1.0))
@settings(max_examples=80, deadline=None)
def test_the_loading_stress_grows_with_strain_and_its_energy_is_its_integral(
    density: float, strain: float, share: float
) -> None:
    row = foam.foam_row(density, 0.05)
    assert foam.loading_stress(strain + 1e-6, row) >= foam.loading_stress(strain, row)
    kinks = [row[foam.YIELD] / row[foam.MODULUS], foam.LINEAR_FROM * row[foam.LIMIT]]
    for low in (0.0, share * strain):
        area, _ = quad(lambda e: foam.loading_stress(e, row), low, strain, points=kinks, limit=200)
        assert foam.energy_between(low, strain, row) == pytest.approx(area, rel=1e-6, abs=1e-2)


@given(density=densities, largest=st.floats(0.06, 0.9), returned=st.floats(0.01, 0.2))
@settings(max_examples=60, deadline=None)
def test_unloading_returns_the_stated_share(
    density: float, largest: float, returned: float
) -> None:
    row = foam.foam_row(density, returned)
    rest = foam.residual_strain(largest, row)
    area, _ = quad(lambda e: foam.unloading_stress(e, largest, rest, row), rest, largest)
    assert 0.0 < rest < largest
    assert area == pytest.approx(returned * foam.energy_between(0.0, largest, row), rel=1e-3)
    assert foam.unloading_stress(0.5 * rest, largest, rest, row) == 0.0


def test_densification_stiffens_the_foam() -> None:
    row = foam.foam_row(55.0, 0.05)
    limit = foam.bottoming_strain(row)
    assert foam.loading_stress(limit, row) == pytest.approx(2.0 * row[foam.YIELD])
    assert foam.loading_stress(0.9, row) > 3.0 * row[foam.YIELD]
    assert foam.loading_stress(0.4, row) < 1.25 * row[foam.YIELD]


def test_the_columns_cover_the_shell() -> None:
    helmet = load_helmet("fullface")
    fine = liner.columns(helmet.replaced({"liner.columns": 5000})).geometry
    a, b, c = helmet.shell.semi_axes
    p = 1.6075  # Knud Thomsen's area of an ellipsoid, within 1.1 %
    area = 4 * np.pi * (((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3) ** (1 / p)
    assert fine[:, 6].sum() == pytest.approx(area, rel=0.012)
    shadow = (fine[:, 6] * np.maximum(fine[:, 5], 0.0)).sum()  # projected along z
    assert shadow == pytest.approx(np.pi * a * b, rel=2e-3)
    assert np.linalg.norm(fine[:, 3:6], axis=1) == pytest.approx(1.0)
    on_surface = (fine[:, 0] / a) ** 2 + (fine[:, 1] / b) ** 2 + (fine[:, 2] / c) ** 2
    assert on_surface == pytest.approx(1.0, abs=1e-3)


def test_a_cell_of_a_sphere_lies_behind_its_middle_by_its_mean_sagitta() -> None:
    helmet = load_helmet("fullface").replaced({"shell.semi_axes": (0.14, 0.14, 0.14)})
    made = liner.columns(helmet).geometry
    behind = 0.14 - np.linalg.norm(made[:, :3], axis=1)
    assert behind == pytest.approx(made[:, 8] ** 2 / (4 * 0.14))


def test_zones_change_thickness_and_density_where_they_are() -> None:
    helmet = load_helmet("fullface").replaced(
        {"liner.front.thickness": 0.03, "liner.top.density": 90.0}
    )
    made = liner.columns(helmet)
    normal, thickness = made.geometry[:, 3:6], made.geometry[:, 7]
    front = normal[:, 0].argmax()
    assert thickness[front] == pytest.approx(0.03, abs=2e-4)
    assert thickness[normal[:, 0].argmin()] == pytest.approx(0.044, abs=1e-6)
    top = normal[:, 2].argmax()
    assert made.foam[top, foam.YIELD] == pytest.approx(
        foam.foam_row(90.0, 0.05)[foam.YIELD], rel=0.01
    )


@pytest.mark.parametrize("speed", [2.5, 5.0, 7.5])
def test_the_foam_drop_matches_a_plane_pressed_into_a_crushable_cap(speed: float) -> None:
    """Independent oracle: one dimension, exact cap geometry, same material, no columns."""
    radius, thickness, density = 0.14, 0.044, 55.0
    setup = foam_setup(
        {"helmet.shell.semi_axes": (radius,) * 3, "helmet.liner.columns": 1200},
        rig="headform", direction="front", normal_velocity=speed, gravity=0.0,
    )  # fmt: skip
    record = simulate(setup)
    row = foam.foam_row(density, 0.05)
    mass = 4.5 + setup.helmet_config.mass
    x, v, step, peak = 0.0, speed, 1e-5, 0.0
    while v > 0.0:
        depth = np.linspace(0.0, x, 200)
        cosine = (radius - x + depth) / radius  # of the shell's slope where the depth is `depth`
        strain = depth * cosine / thickness
        stress = np.array([foam.loading_stress(e, row) for e in strain])
        force = trapezoid(stress * 2 * np.pi * (radius - x + depth), depth)
        v -= force / mass * step
        x += v * step
        peak = max(peak, force / mass / G)
    assert peak_g(record) == pytest.approx(peak, rel=0.02)
    assert np.linalg.norm(record.coupling_displacement, axis=1).max() == pytest.approx(x, rel=0.02)


@pytest.mark.parametrize("values", [
    {"rig": "headform", "direction": "left", "normal_velocity": 7.5},
    {"normal_velocity": 5.0, "tangential_velocity": 10.0},
])  # fmt: skip
def test_the_peak_converges_in_the_number_of_columns(values: dict[str, object]) -> None:
    n = load_helmet("fullface").liner.columns
    peaks = [
        peak_g(simulate(foam_setup({"helmet.liner.columns": k * n}, **values))) for k in (1, 2)
    ]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.01)


@pytest.mark.parametrize("direction", ["front", "left", "top"])
def test_foam_peaks_converge_with_the_time_step(direction: str) -> None:
    values = {"direction": direction, "tangential_velocity": 5.0, "duration": 0.015}
    coarse, fine = (simulate(foam_setup(time_step=dt, **values)) for dt in (5e-5, 1e-5))
    assert peak_g(coarse) == pytest.approx(peak_g(fine), rel=0.01)
    assert coarse.ground_force[:, 2].max() == pytest.approx(fine.ground_force[:, 2].max(), rel=0.01)


@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_foam_impacts_keep_momentum_and_lose_energy(rig: str) -> None:
    impact = Impact(foam_setup(rig=rig, tangential_velocity=7.0))
    impact.advance(impact.total)
    checked = balance(impact)
    assert checked.momentum_error < 0.01
    kinetic = checked.kinetic + checked.potential
    assert kinetic[-1] < 0.95 * kinetic[0]
    force = impact.record().ground_force
    tangential = np.linalg.norm(force[:, :2], axis=1)
    assert np.all(tangential <= 0.4 * force[:, 2] * (1 + 1e-9) + 1e-9)


def test_a_second_blow_on_the_same_spot_is_harder() -> None:
    setup = foam_setup(rig="headform", normal_velocity=5.0)
    first = simulate(setup)
    second = simulate(setup, crush=first.extras["crush"])
    elsewhere = simulate(foam_setup(rig="headform", normal_velocity=5.0, direction="right"),
                         crush=first.extras["crush"])  # fmt: skip
    assert peak_g(second) > 1.2 * peak_g(first)
    assert peak_g(elsewhere) == pytest.approx(peak_g(first), rel=0.01)
    with pytest.raises(PulseError, match="crush: shape"):
        simulate(setup, crush=np.zeros(3))


def test_the_residual_crush_is_where_the_blow_was() -> None:
    record = simulate(foam_setup(rig="headform", direction="back", normal_velocity=7.5))
    crush, position = record.extras["residual_crush"], record.extras["column_position"]
    assert position[crush.argmax(), 0] < -0.14
    assert 0.5 < crush.max() / np.linalg.norm(record.coupling_displacement, axis=1).max() < 1.0
    assert crush[position[:, 0] > 0.0].max() == 0.0


def test_foam_and_spring_helmets_fill_the_same_record() -> None:
    spring, liner = simulate(ImpactSetup()), simulate(foam_setup())
    assert spring.joint_names == liner.joint_names and len(spring) == len(liner)
    assert same_samples(liner, simulate(foam_setup()))
    ratio = peak_g(liner) / peak_g(spring)
    assert 0.8 < ratio < 1.25


def test_the_head_slides_in_the_liner_only_as_its_friction_allows() -> None:
    def turn(friction: float) -> float:
        values = {"tangential_velocity": 10.0, "rig": "headform", "direction": "left"}
        record = simulate(foam_setup({"helmet.liner.head_friction": friction}, **values))
        dot = np.abs(np.einsum("ij,ij->i", record.head_orientation, record.helmet_orientation))
        return float(np.degrees(2 * np.arccos(np.minimum(dot, 1.0)))[:200].max())

    assert turn(0.05) > 2.0 * turn(0.5)


def test_mirrored_foam_impacts_agree_within_the_lattice() -> None:
    left = simulate(
        foam_setup(direction="left", tangential_velocity=5.0, tangential_heading_deg=60.0)
    )
    right = simulate(
        foam_setup(direction="right", tangential_velocity=5.0, tangential_heading_deg=-60.0)
    )
    assert peak_g(left) == pytest.approx(peak_g(right), rel=0.01)


def test_columns_that_are_not_near_the_ground_cannot_touch_it() -> None:
    """A liner that rolls and bounces feels the same whether columns are listed at every step."""
    table = liner.columns(load_helmet("fullface"))
    lists = [liner.nothing_near(len(table)) for _ in range(2)]
    states = [
        (np.zeros(len(table)), np.full(len(table), -1.0), np.zeros((len(table), 2)))
        for _ in range(2)
    ]
    touched, listed = 0, []
    for step in range(400):
        turn = Rotation.from_rotvec([0.004 * step, 0.002 * step, 0.0]).as_matrix().ravel()
        position = np.array([1e-3 * step, 0.0, 0.135 + 0.02 * np.cos(0.05 * step)])
        lists[1][1][:] = np.inf  # forgets what it listed
        results = []
        for (near, seen), state in zip(lists, states, strict=True):
            applied, wrench = np.zeros(6), np.zeros(6)
            liner.crush(
                table.geometry, table.foam, 0.4, 5e-5, near, seen, *state, position, turn,
                np.array([1.0, 0.5, 0.0, 20.0, 0.0, -1.0]), np.zeros(3), applied, wrench,
            )  # fmt: skip
            results.append((applied, wrench))
        assert np.array_equal(results[0], results[1])
        touched += results[0][1][2] > 0.0
        listed.append(lists[0][0][-1])
    assert 50 < touched < 350 and max(listed) < len(table) / 3
    assert all(np.array_equal(a, b) for a, b in zip(*states, strict=True))


def test_unloading_remembers_the_deepest_of_several_blows() -> None:
    table = liner.columns(load_helmet("fullface"))

    def last_force(depths: list[float]) -> float:
        near, seen = liner.nothing_near(len(table))
        state = (np.zeros(len(table)), np.full(len(table), -1.0), np.zeros((len(table), 2)))
        for depth in depths:
            wrench = np.zeros(6)
            liner.crush(
                table.geometry, table.foam, 0.4, 5e-5, near, seen, *state,
                np.array([0.0, 0.0, 0.14 - depth]), np.eye(3).ravel(), np.zeros(6), np.zeros(3),
                np.zeros(6), wrench,
            )  # fmt: skip
        return float(wrench[2])

    expected = last_force([0.02, 0.0198])
    assert 0.0 < expected < last_force([0.02])
    assert last_force([0.01, 0.0099, 0.02, 0.0198]) == pytest.approx(expected, rel=1e-12)
