"""The deepest point of an ellipsoid in every kind of shape."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numba import njit
from numba.core.runtime import _nrt_python, rtsys
from scipy.optimize import minimize
from surfaces import SHARP, SIZES, directions, distances, shape, somewhere, turned

from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.cutting import lowest_of_planes
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import signed_distance

LATTICE = directions(4000)
SHELL = (0.13, 0.11, 0.12)  # m
IDENTITY = np.eye(3).ravel()


def ball_on(
    surface: Surface, center: tuple[float, float, float], radius: float
) -> tuple[float, np.ndarray, np.ndarray]:
    depth, point, normal = deepest_point(
        surface, 0, center, IDENTITY, (radius, radius, radius), np.zeros(3)
    )
    return depth, np.array(point), np.array(normal)


def test_a_ball_on_an_inclined_plane() -> None:
    a, r, gap = np.radians(45.0), 0.13, 0.002
    n = np.array([0.0, np.sin(a), np.cos(a)])
    depth, point, normal = ball_on(shape("half_space", tilt_deg=45.0), tuple((r - gap) * n), r)
    assert depth == pytest.approx(gap, abs=1e-15)
    assert point == pytest.approx(-gap * n, abs=1e-15)
    assert normal == pytest.approx(n, abs=1e-15)


@pytest.mark.parametrize("depth", [-0.05, 1e-6, 0.004, 0.03])
def test_a_ball_on_a_hemisphere(depth: float) -> None:
    r, anvil = 0.13, 0.048
    n = np.array([0.36, -0.48, 0.8])
    found, point, normal = ball_on(shape("sphere", radius=anvil), tuple((r + anvil - depth) * n), r)
    assert found == pytest.approx(depth, abs=1e-12)
    assert point == pytest.approx((anvil - depth) * n, abs=1e-9)
    assert normal == pytest.approx(n, abs=1e-9)


@pytest.mark.parametrize("depth", [-0.05, 1e-6, 0.004, 0.014])
@pytest.mark.parametrize("lean_deg", [0.0, 10.0, -37.0])
def test_a_ball_on_the_edge_of_a_kerbstone_anvil(depth: float, lean_deg: float) -> None:
    """Between the normals of the faces (37.5 deg from the vertical) the edge is a cylinder."""
    r, edge, lean = 0.13, 0.015, np.radians(lean_deg)
    n = np.array([0.0, np.sin(lean), np.cos(lean)])
    middle = np.array([0.01, 0.0, -edge])
    found, point, normal = ball_on(shape("wedge"), tuple(middle + (r + edge - depth) * n), r)
    assert found == pytest.approx(depth, abs=1e-12)
    assert point == pytest.approx(middle + (edge - depth) * n, abs=1e-9)
    assert normal == pytest.approx(n, abs=1e-9)


def test_a_ball_beyond_the_edge_lies_on_the_face() -> None:
    r, depth, angle = 0.13, 0.003, np.radians(52.5)
    n = np.array([0.0, np.cos(angle), np.sin(angle)])
    on_face = np.array([0.0, 0.0, -0.015]) + 0.015 * n + 0.02 * np.array([0.0, n[2], -n[1]])
    found, point, normal = ball_on(shape("wedge"), tuple(on_face + (r - depth) * n), r)
    assert found == pytest.approx(depth, abs=1e-12)
    assert point == pytest.approx(on_face - depth * n, abs=1e-9)
    assert normal == pytest.approx(n, abs=1e-9)


def test_flat_ground_gives_the_bits_of_the_closed_form() -> None:
    surface = shape("half_space")
    ax, ay, az = SHELL
    for seed in range(200):
        m, z = turned(seed).ravel(), 0.1
        dx, dy, dz = -m[6], -m[7], -m[8]
        scale = 1.0 / ((ax * dx) ** 2 + (ay * dy) ** 2 + (az * dz) ** 2) ** 0.5
        lx, ly, lz = ax * ax * dx * scale, ay * ay * dy * scale, az * az * dz * scale
        pz = z + m[6] * lx + m[7] * ly + m[8] * lz
        depth, point, normal = deepest_point(
            surface, 0, (0.3, -0.2, z), m, (ax, ay, az), np.zeros(3)
        )
        assert depth == -pz
        assert point[0] == 0.3 + m[0] * lx + m[1] * ly + m[2] * lz
        assert normal == (0.0, 0.0, 1.0)


def in_contact(surface: Surface, seed: int, depth: float) -> tuple[np.ndarray, ...]:
    """Centre, rotation and semi-axes of an ellipsoid that enters the shape from outside."""
    rng = np.random.default_rng(seed)
    rotation, axes = turned(seed), rng.uniform(0.09, 0.16, 3)
    v = directions(97)[seed % 97]
    if surface.kind[0] == 0:
        v = surface.rotation[0, [2, 5, 8]]
    lattice = (axes * LATTICE) @ rotation.T

    def least(step: float) -> float:
        return float(distances(surface, surface.position[0] + step * v + lattice).min())

    far, step = 0.6, 0.02
    while -least(far) < depth and step > 1e-4:
        if -least(far - step) > depth or far < step:
            step *= 0.5
        else:
            far -= step
    return surface.position[0] + far * v, rotation, axes


def best_by_search(
    surface: Surface, center: np.ndarray, rotation: np.ndarray, axes: np.ndarray
) -> float:
    """Depth found by sampling the whole surface, then refining the three best places."""

    def distance(v: np.ndarray) -> float:
        return signed_distance(surface, 0, *(center + rotation @ (axes * v / np.linalg.norm(v))))[0]

    sampled = distances(surface, center + (axes * LATTICE) @ rotation.T)
    starts = LATTICE[np.argsort(sampled)[:3]]
    options = {"xatol": 1e-10, "fatol": 1e-14, "maxiter": 400}
    return max(-minimize(distance, u, method="Nelder-Mead", options=options).fun for u in starts)


CASES = [
    *((kind, SIZES[kind], depth) for kind in SIZES for depth in (-0.03, 0.002, 0.012)),
    *((kind, SHARP[kind], depth) for kind in SHARP for depth in (-0.03, 0.002, 0.012)),
]


@pytest.mark.parametrize(("kind", "sizes", "depth"), CASES)
def test_no_search_finds_a_deeper_point(kind: str, sizes: dict, depth: float) -> None:
    for seed in range(12):
        surface = somewhere(kind, seed, **sizes)
        center, rotation, axes = in_contact(surface, seed, depth)
        depth_found, point, normal = deepest_point(
            surface, 0, tuple(center), rotation.ravel(), tuple(axes), np.zeros(3)
        )
        assert depth_found >= best_by_search(surface, center, rotation, axes) - 1e-8
        local = rotation.T @ (np.array(point) - center) / axes
        own = rotation @ (local / axes)
        assert np.array(normal) == pytest.approx(-own / np.linalg.norm(own), abs=1e-5)


@pytest.mark.parametrize("kind", [*SIZES, *(f"sharp_{kind}" for kind in SHARP)])
@settings(max_examples=150, deadline=None)
@example((0.03125,) * 3, 378, (0.03125,) * 3, (0.0, 0.0, 0.0))  # no pull: was divided by
@example((0.03, 0.03, 0.03125), 39, (0.03,) * 3, (0.0, 0.0, 0.0))
@given(
    center=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    turn=st.integers(0, 1000),
    axes=st.tuples(*[st.floats(0.03, 0.3)] * 3),
    start=st.sampled_from([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (-0.6, 0.8, 0.0)]),
)
def test_the_result_is_a_point_of_both_however_deep(
    kind: str,
    center: tuple[float, float, float],
    turn: int,
    axes: tuple[float, float, float],
    start: tuple[float, float, float],
) -> None:
    sharp = kind.startswith("sharp_")
    name = kind.removeprefix("sharp_")
    surface = shape(name, **(SHARP if sharp else SIZES)[name])
    rotation, guess = turned(turn), np.array(start)
    depth, point, normal = deepest_point(surface, 0, center, rotation.ravel(), axes, guess)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-9)
    assert signed_distance(surface, 0, *point)[0] == pytest.approx(-depth, abs=1e-12)
    local = rotation.T @ (point - np.array(center)) / np.array(axes)
    assert np.linalg.norm(local) == pytest.approx(1.0, abs=1e-9)
    assert guess == pytest.approx(local, abs=1e-9)


@pytest.mark.parametrize("kind", SIZES)
def test_a_warm_start_follows_a_moving_shell_to_the_same_points(kind: str) -> None:
    surface = somewhere(kind, 5)
    center, rotation, axes = in_contact(surface, 5, 0.005)
    guess, axes = np.zeros(3), tuple(axes)
    for k in range(50):
        moved = tuple(center + 2e-4 * k * np.array([0.6, 0.0, 0.8]))
        warm = deepest_point(surface, 0, moved, rotation.ravel(), axes, guess)
        cold = deepest_point(surface, 0, moved, rotation.ravel(), axes, np.zeros(3))
        assert warm[0] == pytest.approx(cold[0], abs=1e-12)
        assert np.array(warm[1:]) == pytest.approx(np.array(cold[1:]), abs=1e-5)


def test_through_a_thin_bar_the_depth_stays_its_radius() -> None:
    bar = shape("capsule", radius=0.005, length=1.0, rotation_deg=(0.0, 90.0, 0.0))
    down = np.array([0.0, 0.0, -1.0])
    depth, _, normal = deepest_point(bar, 0, (0.0, 0.0, 0.09), IDENTITY, SHELL, down)
    assert depth == pytest.approx(0.005, abs=1e-9)
    assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_the_lowest_point_of_four_planes_agrees_with_a_search() -> None:
    rng = np.random.default_rng(7)
    lattice = directions(20_000)
    for _ in range(60):
        rows = np.column_stack([rng.normal(size=(4, 3)), rng.uniform(-1.0, 1.0, 4)])
        planes = tuple(tuple(float(v) for v in row) for row in rows)
        value, where, _ = lowest_of_planes(planes, (0.0, 0.0, 1.0))
        sampled = (lattice @ rows[:, :3].T + rows[:, 3]).max(axis=1).min()
        assert np.linalg.norm(where) == pytest.approx(1.0)
        assert value == pytest.approx((rows[:, :3] @ where + rows[:, 3]).max(), abs=1e-12)
        assert sampled - 0.1 <= value <= sampled + 1e-12


@njit
def _many(surface: Surface, count: int, rotation: np.ndarray, guess: np.ndarray) -> float:
    total = 0.0
    for i in range(count):
        z = 0.15 - 1e-4 * (i % 100)
        total += deepest_point(surface, 0, (0.0, 0.01, z), rotation, (0.13, 0.11, 0.12), guess)[0]
        total += signed_distance(surface, 0, 0.0, 0.01, z)[0]
    return total


@pytest.mark.parametrize("kind", SIZES)
def test_compiled_calls_allocate_nothing(kind: str) -> None:
    surface, guess = shape(kind), np.zeros(3)
    _many(surface, 1, IDENTITY, guess)
    _nrt_python.memsys_enable_stats()
    try:
        made = []
        for count in (1, 1000):
            before = rtsys.get_allocation_stats().alloc
            _many(surface, count, IDENTITY, guess)
            made.append(rtsys.get_allocation_stats().alloc - before)
    finally:
        _nrt_python.memsys_disable_stats()
    assert made[0] == made[1]  # what wraps the arguments, nothing per call


def test_deep_on_a_thin_plate_the_point_stays_near_its_edge() -> None:
    """Deeper than half its thickness all points of the plate's middle plane are equally deep."""
    plate = shape("box", half_sizes=(0.09, 0.003, 0.04), edge_radius=0.003)
    for aside in (0.001, -0.002, 0.004):
        center = (0.002, aside, 0.04 + SHELL[2] - 0.006)
        depth, point, normal = deepest_point(plate, 0, center, IDENTITY, SHELL, np.zeros(3))
        assert depth == pytest.approx(0.003, abs=1e-9)
        assert point[1] == pytest.approx(0.0, abs=1e-9)
        assert normal[2] > 0.9  # any point of that plane near the edge will do


def test_between_opposite_planes_the_lowest_point_is_the_one_near_the_start() -> None:
    planes = ((0.0, 1.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), *(((0.0, 1.0, 0.0, 0.0),) * 2))
    value, where, _ = lowest_of_planes(planes, (0.6, 0.0, -0.8))
    assert value == pytest.approx(0.0, abs=1e-15)
    assert where == pytest.approx((0.6, 0.0, -0.8))
