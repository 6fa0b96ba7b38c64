"""Measured residual crush of a helmet: depths and where they were measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import Columns
from helmet_sim_ros.study.tables import Column, read_table

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
OFF = 0.025  # m, farthest from the shell that a place may lie: two cells and a scan's registration
NEIGHBOURS = 3  # cells that a place is interpolated from
DEEPEST = 0.08  # m, thickest liner


@dataclass(frozen=True)
class CrushMap:
    """Residual crush: ``depth`` (n,) [m] of the shell's outer surface, along its normal, at
    ``place`` (n, 3) [m], head frame."""

    place: FloatArray
    depth: FloatArray


def read_crush_map(path: Path, cells: Columns) -> CrushMap:
    """Depths from a table: columns ``x``, ``y``, ``z`` and ``depth`` with units in brackets, or
    ``azimuth [deg]``, ``elevation [deg]`` (from the front to the left, and upwards) and ``depth``.

    Raises:
        SetupError: a missing column or unit, a value that is no number, a depth that no liner has,
            or a place far from the shell; names file and row.
    """
    columns = {column.name: column for column in read_table(path, "residual")}
    if "depth" not in columns:
        raise SetupError.of("residual", str(path), "has no column named depth")
    depth = _values(columns["depth"], path) * _length(columns["depth"], path)
    rows = columns["depth"].rows
    for i in np.flatnonzero((depth < -0.005) | (depth > DEEPEST)):
        raise SetupError.of(
            "depth", float(depth[i]), f"m must be from -0.005 to {DEEPEST:g} m; wrong unit?",
            f"{path} row {rows[i]}",
        )  # fmt: skip
    if {"x", "y", "z"} <= columns.keys():
        place = np.column_stack(
            [_values(columns[a], path) * _length(columns[a], path) for a in "xyz"]
        )
    elif {"azimuth", "elevation"} <= columns.keys():
        azimuth, elevation = (
            np.radians(_values(columns[name], path)) for name in ("azimuth", "elevation")
        )
        place = on_shell(cells, directions(azimuth, elevation))
    else:
        raise SetupError.of(
            "residual", str(path), "must have the columns x, y, z or azimuth, elevation"
        )
    away = cKDTree(cells.point).query(place)[0]
    for i in np.flatnonzero(away > OFF):
        raise SetupError.of(
            "place", place[i].tolist(), f"m lies {1e3 * away[i]:.0f} mm from the shell; wrong "
            "unit, or not the head's axes",
            f"{path} row {rows[i]}",
        )  # fmt: skip
    if not (depth > 0.0).any():
        raise SetupError.of("residual", str(path), "has no depth above 0: nothing was crushed")
    return CrushMap(place, depth)


def directions(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    """Unit vectors of angles [rad], (n, 3)."""
    level = np.cos(elevation)
    return np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def on_shell(cells: Columns, direction: FloatArray) -> FloatArray:
    """The points of the shell in directions from the head's centre, (n, 3) [m]."""
    distance = np.linalg.norm(cells.point, axis=1)
    nearest = cKDTree(cells.point / distance[:, None]).query(direction)[1]
    points: FloatArray = direction * distance[nearest][:, None]
    return points


def interpolation(cells: Columns, place: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Cells and weights, (n, 3) each, that give a value at places from the values of the cells."""
    away, index = cKDTree(cells.point).query(place, k=NEIGHBOURS)
    weight = 1.0 / np.maximum(away, 1e-6) ** 2
    return index, weight / weight.sum(axis=1, keepdims=True)


def _values(column: Column, path: Path) -> FloatArray:
    for value, row in zip(column.values, column.rows, strict=True):
        if value is None:
            raise SetupError.of(column.name, "", "must be a number", f"{path} row {row}")
    return np.array(column.values, dtype=float)


def _length(column: Column, path: Path) -> float:
    if column.unit not in LENGTHS:
        raise SetupError.of(
            column.name, column.unit or "no unit", f"must be one of {', '.join(LENGTHS)}, in "
            f"brackets in the heading of {path}",
        )  # fmt: skip
    return LENGTHS[column.unit]
