"""Shapes for the tests of surfaces: one of each kind, turned and moved."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.config import compile_parts
from helmet_sim_ros.model.surface.parts import part_of
from helmet_sim_ros.model.surface.shapes import signed_distance

SIZES: dict[str, dict[str, Any]] = {
    "half_space": {},
    "sphere": {"radius": 0.048},
    "capsule": {"radius": 0.02, "length": 0.3},
    "box": {"half_sizes": (0.1, 0.06, 0.05), "edge_radius": 0.01},
    "disc": {"radius": 0.065, "height": 0.05, "edge_radius": 0.005},
    "wedge": {"half_angle_deg": 52.5, "edge_radius": 0.015, "height": 0.06, "length": 0.155},
    "ellipsoid": {"semi_axes": (0.2, 0.13, 0.09)},
}
SHARP: dict[str, dict[str, Any]] = {
    "box": {"half_sizes": (0.1, 0.06, 0.05)},
    "disc": {"radius": 0.065, "height": 0.05},
    "wedge": {"half_angle_deg": 30.0, "edge_radius": 0.0, "height": 0.06, "length": 0.155},
}


def shape(kind: str, **changes: Any) -> Surface:
    """A surface of one shape; sizes as above where none are given."""
    pose = {k: changes.pop(k) for k in ("position", "tilt_deg", "rotation_deg") if k in changes}
    return compile_parts((part_of({"kind": kind, **(changes or SIZES[kind]), **pose}, "shape"),))


def somewhere(kind: str, seed: int, **sizes: Any) -> Surface:
    """The same, turned and moved at random."""
    rng = np.random.default_rng(seed)
    return shape(
        kind,
        position=tuple(rng.uniform(-0.5, 0.5, 3)),
        rotation_deg=tuple(rng.uniform(-180.0, 180.0, 3)),
        **sizes,
    )


@njit
def distances(surface: Surface, points: FloatArray) -> FloatArray:
    """Signed distance of the first shape from many points (n, 3)."""
    found = np.empty(len(points))
    for k in range(len(points)):
        found[k] = signed_distance(surface, 0, points[k, 0], points[k, 1], points[k, 2])[0]
    return found


def directions(n: int) -> FloatArray:
    """Unit vectors spread evenly (Fibonacci lattice), (n, 3)."""
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])


def turned(seed: int) -> FloatArray:
    """A random rotation, (3, 3)."""
    matrix: FloatArray = Rotation.random(random_state=seed).as_matrix()
    return matrix
