"""The foam law and the foam helmet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, trapezoid
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import ImpactRecord, same_samples
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.model.balance import balance
from helmet_sim_ros.model.force import foam, liner
from helmet_sim_ros.model.force.bodies import FORCE, HELMET, Loads, Motion
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.force.liner import CrushingLiner, crushing_liner
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.model.surface.scenes import load_surface

G = 9.80665  # m/s^2
densities = st.floats(20.0, 100.0)


def foam_setup(overrides: dict[str, object] | None = None, **values: object) -> ImpactSetup:
    return ImpactSetup(overrides={"helmet.coupling": "foam", **(overrides or {})}, **values)


def peak_g(record: ImpactRecord) -> float:
    return float(np.linalg.norm(record.head_acceleration, axis=1).max()) / G


@pytest.mark.parametrize(
    ("density", "low", "high"), [(40, 0.30, 0.45), (62, 0.60, 0.70), (80, 0.85, 0.95)]
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
    fine = columns(helmet.replaced({"liner.columns": 5000}))
    a, b, c = helmet.shell.semi_axes
    p = 1.6075  # Knud Thomsen's area of an ellipsoid, within 1.1 %
    area = 4 * np.pi * (((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3) ** (1 / p)
    assert fine.area.sum() == pytest.approx(area, rel=0.012)
    shadow = (fine.area * np.maximum(fine.normal[:, 2], 0.0)).sum()  # projected along z
    assert shadow == pytest.approx(np.pi * a * b, rel=2e-3)
    assert np.linalg.norm(fine.normal, axis=1) == pytest.approx(1.0)
    on_surface = ((fine.point / helmet.shell.semi_axes) ** 2).sum(axis=1)
    assert on_surface == pytest.approx(1.0, abs=1e-3)


def test_a_cell_of_a_sphere_lies_behind_its_middle_by_its_mean_sagitta() -> None:
    helmet = load_helmet("fullface").replaced({"shell.semi_axes": (0.14, 0.14, 0.14)})
    made = columns(helmet)
    behind = 0.14 - np.linalg.norm(made.point, axis=1)
    assert behind == pytest.approx(made.radius**2 / (4 * 0.14))


def test_zones_change_thickness_and_density_where_they_are() -> None:
    helmet = load_helmet("fullface").replaced(
        {"liner.front.thickness": 0.03, "liner.top.density": 90.0}
    )
    made = columns(helmet)
    normal, thickness = made.normal, made.thickness
    front = normal[:, 0].argmax()
    assert thickness[front] == pytest.approx(0.03, abs=2e-4)
    assert thickness[normal[:, 0].argmin()] == pytest.approx(0.044, abs=1e-6)
    top = normal[:, 2].argmax()
    assert made.foam[top, foam.YIELD] == pytest.approx(
        foam.foam_row(90.0, 0.05)[foam.YIELD], rel=0.01
    )


@pytest.mark.parametrize("speed", [2.5, 5.0, 7.5])
def test_the_foam_drop_matches_a_plane_pressed_into_a_crushable_cap(speed: float) -> None:
    """Independent oracle: one dimension, exact cap geometry, same material, no columns; the head
    is firm in its helmet."""
    radius = 0.14
    firm = {"thickness": 1e-3, "modulus": 1e7, "damping": 0.0}
    setup = foam_setup(
        {
            "helmet.shell.semi_axes": (radius,) * 3, "helmet.liner.columns": 1200,
            **{f"helmet.padding.{name}": value for name, value in firm.items()},
        },
        rig="headform", direction="front", normal_velocity=speed, gravity=0.0, time_step=5e-6,
    )  # fmt: skip
    thickness, density = setup.helmet_config.liner.thickness, setup.helmet_config.liner.density
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
    thickness = load_helmet("fullface").liner.thickness
    assert 0.5 < crush.max() / (record.extras["crush"].max() * thickness) < 1.0
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
        record = simulate(foam_setup({"head.friction": friction}, **values))
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


def moving(position: np.ndarray, turn: Rotation, spin: np.ndarray, speed: np.ndarray) -> Motion:
    """A helmet alone, body 0: its frame, and the velocities at the world's origin."""
    none = np.zeros(0)
    return Motion(
        none, none, position[None, :], turn.as_matrix().reshape(1, 9),
        np.concatenate([spin, speed])[None, :], np.zeros(3), position[None, :], np.zeros((0, 6)),
        0.0,
    )  # fmt: skip


def nothing_yet() -> Loads:
    return Loads(np.zeros(0), np.zeros((1, 6)), np.zeros(6), np.zeros(3), np.zeros((2, 9)))


def fresh_liner(shapes: int = 1, count: int = 1000) -> CrushingLiner:
    helmet = load_helmet("fullface").replaced({"liner.columns": count})
    table = columns(helmet)
    return crushing_liner(table, helmet, 0, shapes, np.zeros(len(table.area)))


@pytest.mark.parametrize("name", ["ground", "kerbstone", "hemisphere"])
def test_columns_that_are_not_near_the_surface_cannot_touch_it(name: str) -> None:
    """A liner that rolls and bounces feels the same whether columns are listed at every step."""
    surface = load_surface(name).compiled(0.4)
    liners = [fresh_liner(len(surface.kind)) for _ in range(2)]
    count, touched, listed = len(liners[0].columns.area), 0, []
    for step in range(400):
        motion = moving(
            np.array([1e-3 * step - 0.2, 0.0, 0.135 + 0.02 * np.cos(0.05 * step)]),
            Rotation.from_rotvec([0.004 * step, 0.002 * step, 0.0]),
            np.array([20.0, 0.0, 0.0]), np.array([1.0, 0.5, -1.0]),
        )  # fmt: skip
        liners[1].near.position[:] = np.inf  # forgets what it listed
        results = []
        for one in liners:
            loads = nothing_yet()
            liner.apply(one, surface, 5e-5, motion, loads)
            results.append((loads.wrenches, loads.surface))
        assert all(np.array_equal(a, b) for a, b in zip(*results, strict=True))
        touched += bool(results[0][1][HELMET, FORCE + 2] > 0.0)
        listed.append(liners[0].near.listed[-1])
    assert 30 < touched < 350 and max(listed) < count / 3
    for state in ("largest", "rest", "stick"):
        assert np.array_equal(getattr(liners[0], state), getattr(liners[1], state))


def test_a_column_is_as_hard_as_the_fastest_rate_of_its_contact() -> None:
    """A tenth of the speed: 10^-m of the force; slowing down takes nothing, letting go does."""
    surface, still = load_surface("ground").compiled(0.0), np.zeros(3)

    def force(pressed: CrushingLiner, depth: float, speed: float) -> float:
        loads, at = nothing_yet(), np.array([0.0, 0.0, 0.14 - depth])
        motion = moving(at, Rotation.identity(), still, np.array([0.0, 0.0, -speed]))
        liner.apply(pressed, surface, 5e-5, motion, loads)
        return float(loads.surface[HELMET, FORCE + 2])

    fast, slow = fresh_liner(), fresh_liner()
    share = 10.0**-foam.RATE_EXPONENT
    assert force(slow, 0.01, 0.5) == pytest.approx(share * force(fast, 0.01, 5.0), rel=1e-12)
    assert force(slow, 0.01, 0.5) == pytest.approx(share * force(fast, 0.01, 0.0), rel=1e-12)
    first = force(fast, 0.02, 5.0)
    assert force(fast, -0.01, -5.0) == 0.0
    assert force(fast, 0.02, 0.5) == pytest.approx(share * first, rel=1e-12)


def test_unloading_remembers_the_deepest_of_several_blows() -> None:
    surface = load_surface("ground").compiled(0.4)

    def last_force(depths: list[float]) -> float:
        pressed = fresh_liner()
        for depth in depths:
            loads, still = nothing_yet(), np.zeros(3)
            at = np.array([0.0, 0.0, 0.14 - depth])
            motion = moving(at, Rotation.identity(), still, still)
            liner.apply(pressed, surface, 5e-5, motion, loads)
        return float(loads.surface[HELMET, FORCE + 2])

    expected = last_force([0.02, 0.0198])
    assert 0.0 < expected < last_force([0.02])
    assert last_force([0.01, 0.0099, 0.02, 0.0198]) == pytest.approx(expected, rel=1e-12)


def test_a_flat_press_is_what_a_plane_does_to_the_liner() -> None:
    """The slow press that identifies springs, against the liner's own forces."""
    surface, pressed = load_surface("ground").compiled(0.0), fresh_liner()
    table = pressed.columns
    largest, rest = np.zeros(len(table.area)), np.full(len(table.area), -1.0)
    outermost = -table.point[:, 2].min()
    for depth in (0.005, 0.015, 0.02, 0.0195):
        force = liner.press(table, np.array([0.0, 0.0, -1.0]), depth, largest, rest)
        force *= foam.rate_factor(0.0, table.foam[0])  # at rest below
        loads, still = nothing_yet(), np.zeros(3)
        at = np.array([0.0, 0.0, outermost - depth])
        liner.apply(pressed, surface, 5e-5, moving(at, Rotation.identity(), still, still), loads)
        assert force == pytest.approx(loads.surface[HELMET, FORCE + 2], rel=1e-9)
    assert force > 0.0


def test_crushed_foam_yields_in_shear_and_gives_little_back() -> None:
    """Sheared there and back while pressed: the secant modulus holds it, friction bounds it, and
    the elastic part alone comes back."""
    surface, pressed = load_surface("ground").compiled(0.4), fresh_liner()
    forces, still = [], np.zeros(3)
    for step in range(400):
        speed = np.array([2.0 if step < 200 else -2.0, 0.0, 0.0])
        loads = nothing_yet()
        motion = moving(np.array([0.0, 0.0, 0.12]), Rotation.identity(), still, speed)
        liner.apply(pressed, surface, 5e-5, motion, loads)
        forces.append(loads.surface[HELMET, FORCE : FORCE + 3].copy())
    force = np.array(forces)
    assert np.all(np.abs(force[:, 0]) <= 0.4 * force[:, 2] * (1 + 1e-9))
    slip = 2.0 * 5e-5 * np.arange(1, 201)
    there = -np.trapezoid(force[:200, 0], slip)
    back = -np.trapezoid(np.minimum(force[200:, 0], 0.0), slip)
    assert there > 0.0
    assert back < 0.1 * there
    assert force[10, 0] < 0.0 and force[399, 0] > 0.0


@pytest.mark.parametrize(("count", "error"), [(1000, 0.03), (4000, 0.01)])
@pytest.mark.parametrize("depth", [0.01, 0.02, 0.03])
@pytest.mark.parametrize("side", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_a_liner_pressed_on_a_hemisphere_bears_the_integral_over_the_overlap(
    side: tuple[float, float, float], depth: float, count: int, error: float
) -> None:
    """Against a quadrature of the foam's law over the ellipsoid, which knows no cells."""
    helmet, anvil = load_helmet("fullface"), 0.048
    axes, thickness = np.array(helmet.shell.semi_axes), helmet.liner.thickness
    toward = np.array(side)
    # In the helmet frame: the ball's top lies `depth` inside the outermost point.
    ball = toward * (axes @ np.abs(toward) - depth + anvil)
    n = 400_000
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(n)
    unit = np.column_stack([np.sqrt(1 - height**2) * np.cos(turn),
                            np.sqrt(1 - height**2) * np.sin(turn), height])  # fmt: skip
    area = axes.prod() * np.linalg.norm(unit / axes, axis=1) * 4.0 * np.pi / n
    outward = unit / axes / np.linalg.norm(unit / axes, axis=1)[:, None]
    away = axes * unit - ball
    distance = np.linalg.norm(away, axis=1)
    cosine = np.maximum(0.0, -(away / distance[:, None] * outward).sum(axis=1))
    inside = (distance < anvil) & (cosine > 0.0)
    row = foam.foam_row(helmet.liner.density, helmet.liner.energy_returned)
    strain = ((anvil - distance) * cosine / thickness)[inside]
    stress = foam.rate_factor(0.0, row) * foam.loading_stresses(strain, row)
    force = (stress * area[inside] * cosine[inside]) @ (away[inside] / distance[inside, None])
    surface = load_surface("hemisphere").compiled(0.0)
    pressed, loads, still = fresh_liner(count=count), nothing_yet(), np.zeros(3)
    down = Rotation.align_vectors([[0.0, 0.0, -1.0]], [toward])[0]
    at = -down.apply(ball) + [0.0, 0.0, -anvil]
    liner.apply(pressed, surface, 5e-5, moving(at, down, still, still), loads)
    assert loads.surface[HELMET, FORCE + 2] == pytest.approx(-force @ toward, rel=error)
