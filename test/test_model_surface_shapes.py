"""Signed distance, outward normal and curvature of every kind of shape."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from surfaces import SHARP, SIZES, directions, shape, somewhere

from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.config import compile_parts
from helmet_sim_ros.model.surface.parts import part_of
from helmet_sim_ros.model.surface.shapes import nearest, signed_distance

KINDS = [*((kind, SIZES[kind]) for kind in SIZES), *((kind, SHARP[kind]) for kind in SHARP)]
every_shape = pytest.mark.parametrize(
    ("kind", "sizes"), KINDS, ids=[*SIZES, *(f"sharp_{kind}" for kind in SHARP)]
)


def distance(surface: Surface, point: np.ndarray) -> float:
    return signed_distance(surface, 0, *point)[0]


def normal(surface: Surface, point: np.ndarray) -> np.ndarray:
    return np.array(signed_distance(surface, 0, *point)[1:4])


def points_around(surface: Surface, seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    spread = rng.choice([1e-3, 0.03, 0.1, 0.4], (count, 1))
    return surface.position[0] + spread * rng.normal(size=(count, 3))


@every_shape
def test_the_distance_is_reached_and_never_changes_faster_than_the_point_moves(
    kind: str, sizes: dict
) -> None:
    """Both together make it the exact distance: no surface point can be nearer."""
    for seed in range(5):
        surface = somewhere(kind, seed, **sizes)
        points = points_around(surface, seed, 200)
        d = [distance(surface, p) for p in points]
        for k in range(len(points) - 1):
            moved = np.linalg.norm(points[k + 1] - points[k])
            assert abs(d[k + 1] - d[k]) <= moved + 1e-12
        for p, there in zip(points, d, strict=True):
            foot = p - there * normal(surface, p)
            assert distance(surface, foot) == pytest.approx(0.0, abs=1e-12)


@every_shape
def test_the_normal_is_the_gradient_of_the_distance(kind: str, sizes: dict) -> None:
    h = 1e-6
    for seed in range(5):
        surface = somewhere(kind, seed, **sizes)
        for p in points_around(surface, seed, 200):
            if distance(surface, p) < 1e-4 and kind != "half_space":
                continue  # inside, faces meet in creases
            gradient = [
                (distance(surface, p + h * e) - distance(surface, p - h * e)) / (2 * h)
                for e in np.eye(3)
            ]
            assert normal(surface, p) == pytest.approx(np.array(gradient), abs=2e-5)


@every_shape
@settings(max_examples=200, deadline=None)
@given(
    place=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    on_grid=st.tuples(*[st.sampled_from([0.0, 0.05, 0.045, 0.06, 0.065, 0.1, 1e-200])] * 3),
)
def test_the_normal_is_a_unit_vector_everywhere(
    kind: str, sizes: dict, place: tuple[float, ...], on_grid: tuple[float, ...]
) -> None:
    surface = shape(kind, **sizes)
    for point in (place, on_grid, (on_grid[0], place[1], on_grid[2])):
        d, nx, ny, nz, curvature = signed_distance(surface, 0, *point)
        assert np.isfinite([d, curvature]).all()
        assert nx * nx + ny * ny + nz * nz == pytest.approx(1.0, abs=1e-12)


def test_sizes_are_outer_sizes() -> None:
    on_surface = {
        "sphere": [(0.0, 0.0, 0.048)],
        "capsule": [(0.0, 0.0, 0.15), (0.02, 0.0, 0.13), (0.0, -0.02, 0.0)],
        "box": [(0.1, 0.0, 0.0), (0.0, -0.06, 0.0), (0.0, 0.0, 0.05), (0.09, 0.05, 0.05)],
        "disc": [(0.0, 0.0, 0.025), (0.065, 0.0, 0.0), (0.0, 0.06, -0.025)],
        "ellipsoid": [(0.2, 0.0, 0.0), (0.0, -0.13, 0.0), (0.0, 0.0, 0.09)],
    }
    for kind, points in on_surface.items():
        for point in points:
            assert distance(shape(kind), np.array(point)) == pytest.approx(0.0, abs=1e-15)


def test_the_faces_of_a_kerbstone_anvil_are_plane_from_the_rounding_to_its_height() -> None:
    surface, angle, r = shape("wedge"), np.radians(52.5), 0.015
    assert distance(surface, np.zeros(3)) == pytest.approx(0.0, abs=1e-15)
    assert normal(surface, np.array([0.0, 0.0, 1e-3])) == pytest.approx([0.0, 0.0, 1.0])
    upper = r * (1.0 - np.sin(angle))
    for depth in np.linspace(upper + 1e-6, 0.06 - 1e-6, 7):
        for side in (1.0, -1.0):
            y = r * np.cos(angle) + (depth - upper) * np.tan(angle)
            point = np.array([0.03, side * y, -depth])
            assert distance(surface, point) == pytest.approx(0.0, abs=1e-14)
            face = (0.0, side * np.cos(angle), np.sin(angle))
            assert normal(surface, point) == pytest.approx(face, abs=1e-9)
    assert distance(surface, np.array([0.0775, 0.0, -0.03])) == pytest.approx(0.0, abs=1e-15)


def test_curvature_is_that_of_the_level_surface() -> None:
    d = 0.013
    cases = {
        ("half_space", (0.1, 0.2, d)): 0.0,
        ("sphere", (0.0, 0.048 + d, 0.0)): 2.0 / (0.048 + d),
        ("capsule", (0.02 + d, 0.0, 0.1)): 1.0 / (0.02 + d),
        ("capsule", (0.0, 0.0, 0.15 + d)): 2.0 / (0.02 + d),
        ("box", (0.0, 0.0, 0.05 + d)): 0.0,
        ("box", (0.0, 0.05 + 0.03, 0.04 + 0.04)): 1.0 / 0.05,
        ("box", (0.09 + 0.02, 0.05 + 0.03, 0.04 + 0.06)): 2.0 / 0.07,
        ("disc", (0.065 + d, 0.0, 0.0)): 1.0 / (0.065 + d),
        ("disc", (0.06 + 0.03, 0.0, 0.02 + 0.04)): 1.0 / 0.05 + 0.6 / 0.09,
        ("wedge", (0.0, 0.0, d)): 1.0 / (0.015 + d),
        ("wedge", (0.0, 0.05, 0.0)): 0.0,
        ("ellipsoid", (0.2 + d, 0.0, 0.0)): sum(
            k / (1.0 + k * d) for k in (0.2 / 0.13**2, 0.2 / 0.09**2)
        ),
    }
    for (kind, point), curvature in cases.items():
        assert signed_distance(shape(kind), 0, *point)[4] == pytest.approx(curvature, rel=1e-9), (
            kind
        )


def test_curvature_is_the_divergence_of_the_normal() -> None:
    h = 1e-5
    for seed in range(40):
        surface = somewhere("ellipsoid", seed)
        for p in points_around(surface, seed, 5):
            d, *_, curvature = signed_distance(surface, 0, *p)
            if d < -0.01:
                continue
            divergence = sum(
                (normal(surface, p + h * e) - normal(surface, p - h * e)) @ e / (2 * h)
                for e in np.eye(3)
            )
            assert curvature == pytest.approx(divergence, rel=1e-5)


def test_the_ellipsoid_agrees_with_a_search_over_its_surface() -> None:
    lattice = directions(4000)
    rng = np.random.default_rng(3)
    for _ in range(60):
        axes = rng.uniform(0.05, 0.25, 3)
        surface = shape("ellipsoid", semi_axes=tuple(axes))
        p = rng.uniform(-0.3, 0.3, 3)
        if rng.random() < 0.3:
            p[rng.integers(3)] = 0.0
        start = lattice[np.argmin(np.linalg.norm(axes * lattice - p, axis=1))]

        def reach(v: np.ndarray, axes: np.ndarray = axes, p: np.ndarray = p) -> float:
            return float(np.linalg.norm(axes * v / np.linalg.norm(v) - p))

        found = minimize(reach, start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 0})
        sign = 1.0 if ((p / axes) ** 2).sum() > 1.0 else -1.0
        assert distance(surface, p) == pytest.approx(sign * found.fun, abs=1e-9)


def test_a_ball_written_as_an_ellipsoid_is_a_ball() -> None:
    ball, ellipsoid = shape("sphere", radius=0.1), shape("ellipsoid", semi_axes=(0.1, 0.1, 0.1))
    for p in [(0.0, 0.0, 0.0), (0.0, 0.0, 0.03), (0.2, -0.1, 0.05), (1e-9, 0.0, 0.0)]:
        assert distance(ellipsoid, p) == pytest.approx(distance(ball, p), abs=1e-15)


def test_a_turned_shape_is_the_shape_seen_from_turned_axes() -> None:
    for kind in SIZES:
        plain = shape(kind)
        for seed in range(20):
            surface = somewhere(kind, seed)
            rotation = surface.rotation[0].reshape(3, 3)
            p = points_around(surface, seed, 1)[0]
            local = rotation.T @ (p - surface.position[0])
            assert distance(surface, p) == pytest.approx(distance(plain, local), abs=1e-14)
            assert normal(surface, p) == pytest.approx(rotation @ normal(plain, local), abs=1e-9)


def test_a_tilt_lowers_the_positive_y_side() -> None:
    surface = shape("half_space", tilt_deg=30.0)
    assert normal(surface, np.zeros(3)) == pytest.approx([0.0, 0.5, 0.75**0.5])
    assert distance(surface, np.array([0.3, 0.75**0.5, -0.5])) == pytest.approx(0.0, abs=1e-15)


def test_the_nearest_shape_is_the_one_with_the_least_distance() -> None:
    parts = ({"kind": "half_space"}, {"kind": "sphere", "radius": 0.1, "position": (0.0, 0.0, 0.3)})
    surface = compile_parts(tuple(part_of(part, "shape") for part in parts))
    i, d, *n, curvature = nearest(surface, 0.0, 0.0, 0.05)
    assert (i, d, n, curvature) == (0, 0.05, [0.0, 0.0, 1.0], 0.0)
    i, d, *n, curvature = nearest(surface, 0.0, 0.0, 0.15)
    assert (i, n) == (1, [0.0, 0.0, -1.0])
    assert (d, curvature) == pytest.approx((0.05, 2.0 / 0.15))
