"""How thick the liner is below each cell of the shell, and whether the head fits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from trimesh import Trimesh

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.headform import load_headform
from helmet_sim_ros.model.rider.anthropometry import anthropometry
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.study.helmets.cells import Cells

SIZES = ("A", "E", "J", "M", "O")  # headforms of UN R22 and EN 960, in config/headforms
AVERAGE = 0.570  # m, circumference of the head whose centre of gravity is known (de Leva)
#: Length and breadth of the average male head over its circumference (ANSUR II: 199, 154 and
#: 574 mm, general literature values). The headform is taken as an ellipsoid of these.
LENGTH, BREADTH = 0.199 / 0.574, 0.154 / 0.574
DEEPEST = 0.12  # m, how far below the shell the liner is searched
THICKEST_SHELL = 0.015  # m
START = 0.03  # m, above the cell, from where rays are cast: to see a liner outside the shell
THINNEST = 0.005  # m; a thinner place counts as this, a choice: crush needs some way
OUTSIDE = 0.001  # m, by which a liner may lie outside the shell (facets of either mesh)
GIRTH = (-0.02, 0.05)  # m, heights between which the headform must fit
TIGHT = 0.003  # m, by which hair and skin give way


class Depths(NamedTuple):
    """Below each cell, along its inward normal: thickness of shell and liner, (n,) [m]; nan: the
    ray met none."""

    shell: FloatArray
    liner: FloatArray


def headform(size: str) -> FloatArray:
    """Semi-axes of the ellipsoid of a headform, centred at the head's centre of gravity, (3,) [m].

    Raises:
        SetupError: unknown size.
    """
    if size not in SIZES:
        raise SetupError.of("headform", size, f"must be one of {', '.join(SIZES)}")
    stated = load_headform(f"en960_{size.lower()}").circumference
    girth = AVERAGE if stated is None else stated.value
    up = anthropometry(Rider()).head_depth * girth / AVERAGE
    return np.array([0.5 * LENGTH * girth, 0.5 * BREADTH * girth, up])


def measured(cells: Cells, shell: Trimesh, liner: Trimesh | None, path: str) -> Depths:
    """Cast a ray from outside through each cell along its inward normal.

    A solid shell is as thick as the way between its first two faces; a sheet has no thickness. A
    solid liner is as thick as the way between its first two faces; of an open sheet, the liner's
    inner surface, the way from the shell to it counts.

    Args:
        liner: solid, or its inner surface; None: nothing is measured.
        path: of the liner's file.

    Raises:
        SetupError: the liner lies outside the shell; names the place.
    """
    nothing = np.full(len(cells.area), np.nan)
    outer = _distances(shell, cells)
    # A cell's middle lies a little below the surface that it is the mean of.
    start = np.array([d[np.abs(d).argmin()] if len(d) else 0.0 for d in outer])
    start[np.abs(start) > THICKEST_SHELL] = 0.0
    second = np.array([_next(d, s, THICKEST_SHELL) for d, s in zip(outer, start, strict=True)])
    if liner is None:
        return Depths(second, nothing)
    inner, thickness = _distances(liner, cells), nothing.copy()
    above = np.zeros(len(thickness))
    for i, distances in enumerate(inner):
        if len(distances) == 0:
            continue
        first = float(distances[0] - start[i])
        above[i] = -first
        if len(distances) > 1 and distances[1] < DEEPEST:
            thickness[i] = distances[1] - start[i] - max(first, 0.0)
        elif first < DEEPEST:
            thickness[i] = first - second[i]
    out = above > OUTSIDE
    if out.mean() > 0.02:
        worst = int(above.argmax())
        raise SetupError.of(
            "liner", path, f"lies outside the shell by up to {1e3 * above[worst]:.1f} mm, at "
            f"{_place(cells.point[worst])} (head axes), on {100 * out.mean():.0f} % of it; wrong "
            "unit, axes or origin, or shell and liner exchanged",
        )  # fmt: skip
    return Depths(second, thickness)


def to_the_head(cells: Cells, semi_axes: FloatArray, shell: FloatArray, gap: float) -> FloatArray:
    """Way from the shell to a gap before the headform, along the cells' inward normals, (n,) [m].

    Args:
        semi_axes: of the headform [m].
        shell: thickness of the shell, (n,) [m].
        gap: for comfort padding [m].
    """
    point, way = cells.point / semi_axes, -cells.normal / semi_axes
    a = (way**2).sum(axis=1)
    b = (point * way).sum(axis=1)
    c = (point**2).sum(axis=1) - 1.0
    root = b**2 - a * c
    with np.errstate(invalid="ignore"):
        distance = (-b - np.sqrt(root)) / a
    return np.where(root > 0.0, distance - shell - gap, np.nan)


def filled(thickness: FloatArray, cells: Cells) -> tuple[FloatArray, int]:
    """The thickness with every cell that has none given its nearest neighbour's, and how many.

    Raises:
        SetupError: no cell has one.
    """
    known = np.isfinite(thickness)
    if not known.any():
        raise SetupError.of("liner", "no ray meets it", "must lie inside the shell")
    nearest = cKDTree(cells.point[known]).query(cells.point)[1]
    complete: FloatArray = np.where(known, thickness, thickness[known][nearest])
    return complete, int((~known).sum())


def check_head(cells: Cells, depth: FloatArray, semi_axes: FloatArray, size: str) -> float:
    """The least way between the liner's inside and the headform's surface [m].

    Args:
        depth: of the liner's inside below the shell, (n,) [m].

    Raises:
        SetupError: the headform reaches into the liner; names the place.
    """
    inside = cells.point - depth[:, None] * cells.normal
    # Below, cheek pads and chin are no ellipsoid's; how high the crown sits, no size tells.
    girth = (inside[:, 2] > GIRTH[0]) & (inside[:, 2] < GIRTH[1])
    if not girth.any():
        raise SetupError.of("shell", "no surface around the head", "wrong axes or origin")
    scaled = np.linalg.norm(inside / semi_axes, axis=1)
    gap = np.where(girth, np.linalg.norm(inside, axis=1) * (1.0 - 1.0 / scaled), np.inf)
    worst = int(gap.argmin())
    if gap[worst] < -TIGHT:
        raise SetupError.of(
            "headform", size, f"does not fit: it reaches {-1e3 * gap[worst]:.0f} mm into the liner "
            f"at {_place(inside[worst])} (head axes); a smaller headform, or another origin",
        )  # fmt: skip
    return float(gap[worst])


def _distances(mesh: Trimesh, cells: Cells) -> list[FloatArray]:
    """Distances below each cell at which a mesh is met, rising."""
    origins = cells.point + START * cells.normal
    places, rays, _ = mesh.ray.intersects_location(origins, -cells.normal, multiple_hits=True)
    distance = np.linalg.norm(places - origins[rays], axis=1) - START
    order = np.lexsort((distance, rays))
    cuts = np.searchsorted(rays[order], np.arange(1, len(cells.area)))
    return [_apart(part) for part in np.split(distance[order], cuts)]


def _apart(distances: FloatArray) -> FloatArray:
    """Without what is met twice, on an edge between triangles."""
    return distances[np.diff(distances, prepend=-np.inf) > 1e-5]


def _next(distances: FloatArray, first: float, most: float) -> float:
    """From the outer to the inner face of a solid shell [m]; 0 for a sheet."""
    beyond = distances[distances > first + 1e-5] - first
    return float(beyond[0]) if len(beyond) and beyond[0] < most else 0.0


def _place(point: FloatArray) -> str:
    return "(" + ", ".join(f"{1e3 * c:.0f}" for c in point) + ") mm"
