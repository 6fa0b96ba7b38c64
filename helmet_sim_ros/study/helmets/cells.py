"""From the triangles of a shell to cells of its outer surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from trimesh import Trimesh
from trimesh.remesh import subdivide_to_size

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError

FINEST = 5e-3  # m, longest edge of the triangles that cells are made of: a third of a cell
STEEPEST = 0.05  # least cosine between a triangle's normal and the ray from the head
ROUNDS = 4  # of moving the middles of the cells (Lloyd); more changes areas by under 1 %
TURN = 0.02  # m, by which two triangles lie apart whose normals differ by 1: cells end at edges


class Surface(NamedTuple):
    """The outer surface as triangles, head frame.

    Attributes:
        middle: (m, 3) [m].
        vector: area times outward normal, (m, 3) [m^2].
        source: triangle of the mesh that each is a part of, (m,).
        turned: share of the area whose triangles were wound inwards.
    """

    middle: FloatArray
    vector: FloatArray
    source: NDArray[np.int64]
    turned: float


class Cells(NamedTuple):
    """Cells of about equal size; ``point`` (n, 3) [m], ``normal`` (n, 3), ``area`` (n,) [m^2],
    ``cell``: of each triangle of the surface, (m,)."""

    point: FloatArray
    normal: FloatArray
    area: FloatArray
    cell: NDArray[np.int64]


def outer_surface(mesh: Trimesh, path: str) -> Surface:
    """What of a mesh is seen from outside, looking at the head's centre.

    Inner faces of a solid shell are hidden behind the outer ones; a face opening or a vent is a
    hole. Triangles count outwards whichever way they are wound.

    Args:
        mesh: head frame, its origin inside the helmet.

    Raises:
        SetupError: the origin is not inside.
    """
    vertices, faces, source = subdivide_to_size(  # type: ignore[no-untyped-call]
        mesh.vertices, mesh.faces, FINEST, max_iter=12, return_index=True
    )
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    vector = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distance = np.linalg.norm(middle, axis=1)
    if distance.min() < 0.02:
        where = " ".join(f"{1e3 * c:.0f}" for c in middle[distance.argmin()])
        raise SetupError.of(
            "origin", where, f"mm: {path} comes within 20 mm of the head's centre there; give the "
            "head's centre in the mesh's coordinates",
        )  # fmt: skip
    outwards = middle / distance[:, None]
    far = 2.0 * distance.max()
    seen = mesh.ray.intersects_first(far * outwards, -outwards)
    # Beside the triangle's middle a ray may meet its neighbour across an edge: compare depths.
    depth = np.einsum("ij,ij->i", mesh.triangles_center[seen] - middle, mesh.face_normals[seen])
    along = np.einsum("ij,ij->i", outwards, mesh.face_normals[seen])
    with np.errstate(divide="ignore", invalid="ignore"):
        hidden = np.where(seen >= 0, depth / along, 0.0) > 1e-4
    visible = (seen == source) | ~hidden
    area = np.linalg.norm(vector, axis=1)
    cosine = np.einsum("ij,ij->i", vector, outwards) / np.where(area > 0.0, area, 1.0)
    kept = visible & (np.abs(cosine) > STEEPEST) & (area > 0.0)
    if not kept.any():
        raise SetupError.of("shell", path, "no triangle faces outwards from the head's centre")
    inwards = cosine[kept] < 0.0
    turned = float(area[kept][inwards].sum() / area[kept].sum())
    vector = vector[kept] * np.where(inwards, -1.0, 1.0)[:, None]
    return Surface(middle[kept], vector, source[kept], turned)


def cells_of(surface: Surface, count: int) -> Cells:
    """Divide a surface into about ``count`` cells; each keeps its triangles' vector area, so the
    area projected along any direction is exact.

    The first middles are a Fibonacci lattice of directions, so that a turned mesh has the same
    cells in the head frame.
    """
    area = np.linalg.norm(surface.vector, axis=1)
    normal = surface.vector / area[:, None]
    place = np.column_stack([surface.middle, TURN * normal])
    directions = _lattice(4 * count)
    away, nearest = cKDTree(surface.middle / _length(surface.middle)).query(directions)
    met = nearest[away < np.sqrt(4.0 * np.pi / len(directions))]
    seeds = met[np.sort(np.unique(met, return_index=True)[1])]  # in the lattice's order
    middle = place[seeds[np.linspace(0, len(seeds) - 1, min(count, len(seeds))).astype(int)]]
    for _ in range(ROUNDS):
        cell = cKDTree(middle).query(place)[1]
        weight = np.bincount(cell, area, len(middle))
        used = weight > 0.0
        middle = _means(cell, area, place, weight)[used]
    cell = cKDTree(middle).query(place)[1]
    _, cell = np.unique(cell, return_inverse=True)
    count = int(cell.max()) + 1
    point = _means(cell, area, surface.middle, np.bincount(cell, area, count))
    vector = np.column_stack([np.bincount(cell, v, count) for v in surface.vector.T])
    amount = np.linalg.norm(vector, axis=1)
    return Cells(point, vector / amount[:, None], amount, cell)


def fitted_ellipsoid(surface: Surface, lowest: float) -> tuple[FloatArray, FloatArray]:
    """Semi-axes and centre of the ellipsoid along the head's axes that lies nearest a surface
    above a height, (3,) each [m]; the centre stays within 50 mm of the head's.

    The head bears on the inside of that ellipsoid. A chin bar below its bearing would shift it to
    the front and down, and lengthen it: not the skull's place in the helmet.
    """
    above = surface.middle[:, 2] >= lowest
    if not above.any():
        above[:] = True
    step = max(1, int(above.sum()) // 4000)
    points = surface.middle[above][::step]
    weight = np.sqrt(np.linalg.norm(surface.vector[above][::step], axis=1))
    half = 0.5 * np.ptp(points, axis=0)
    start = np.clip(half, 0.06, 0.29)

    def apart(values: FloatArray) -> FloatArray:
        scaled = np.linalg.norm((points - values[3:]) / values[:3], axis=1)
        return np.asarray(weight * (scaled - 1.0) * values[:3].mean())

    low = np.r_[[0.051] * 3, [-0.0499] * 3]
    high = np.r_[[0.299] * 3, [0.0499] * 3]
    result = least_squares(
        apart, np.r_[start, 0.0, 0.0, 0.0], bounds=(low, high), x_scale=0.1, ftol=1e-13, xtol=1e-13,
        gtol=1e-13,
    )  # fmt: skip
    return result.x[:3], result.x[3:]


def _means(
    cell: NDArray[np.int64],
    area: FloatArray,
    values: FloatArray,
    weight: NDArray[np.float64 | np.int_],
) -> FloatArray:
    sums = np.column_stack([np.bincount(cell, area * v, len(weight)) for v in values.T])
    return sums / np.where(weight > 0.0, weight, 1.0)[:, None]


def _length(vectors: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(vectors, axis=1)[:, None]
    return lengths


def _lattice(n: int) -> FloatArray:
    """Directions spread evenly over the sphere, by falling height, (n, 3)."""
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)  # golden angle
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
