"""The liner of a foam helmet as columns: cells of the shell's outer surface, each with its foam.

A column is a cell of the outer surface with its outward normal n, area and liner thickness t. At
an angle a to the surface's normal a crush depth d strains it by d cos(a) / t over the projected
area. Within a cell the stress is averaged over the span of depths that its tilt gives it, and a
cell that straddles the surface counts with the share of its area below it: so a few hundred
cells converge.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.foams import load_foam
from helmet_sim_ros.model.force.foam import CONSTANTS, foam_rows, in_series, rows_of
from helmet_sim_ros.model.geometry import ZONES, Geometry, read_geometry
from helmet_sim_ros.model.helmet import Helmet, Liner


class Columns(NamedTuple):
    """The columns of one helmet, shared by its impacts; row i belongs to column i.

    Attributes:
        point: on the outer surface, helmet frame, (n, 3) [m].
        normal: outward, helmet frame, (n, 3).
        area: (n,) [m^2].
        thickness: of the liner, (n,) [m].
        radius: of a disc of the cell's area, (n,) [m].
        foam: constants of each column's foam, (n, 6), with a table (n, 134); see
            :mod:`helmet_sim_ros.model.force.foam`.
    """

    point: FloatArray
    normal: FloatArray
    area: FloatArray
    thickness: FloatArray
    radius: FloatArray
    foam: FloatArray


def no_columns() -> Columns:
    """What a spring helmet has."""
    none = np.zeros(0)
    return Columns(np.zeros((0, 3)), np.zeros((0, 3)), none, none, none, np.zeros((0, CONSTANTS)))


@lru_cache(maxsize=8)
def columns(helmet: Helmet) -> Columns:
    """The columns of a helmet: the cells of its ``geometry``, or of the shell's ellipsoid."""
    if helmet.geometry is None:
        return ellipsoid_columns(helmet)
    return geometry_columns(helmet, read_geometry(helmet.geometry))


def first_touch(helmet: Helmet, direction: FloatArray) -> FloatArray:
    """The point of a helmet's outer surface that lies farthest in a direction.

    Args:
        helmet: of a foam helmet with a geometry, its cells; else the shell's ellipsoid.
        direction: of length 1, helmet frame, (3,).

    Returns:
        shape (3,), helmet frame [m].
    """
    shell = helmet.shell
    if helmet.geometry is None or helmet.coupling == "spring":
        axes = np.array(shell.semi_axes)
        farthest: FloatArray = axes**2 * direction / np.linalg.norm(axes * direction)
        return np.array(shell.center) + farthest
    cells = columns(helmet)
    cosine = cells.normal @ direction
    # A cell is a disc; its edge touches first.
    reach = cells.point @ direction + cells.radius * np.sqrt(np.maximum(0.0, 1.0 - cosine**2))
    i = int(np.argmax(np.where(cosine > 0.0, reach, -np.inf)))
    first: FloatArray = cells.point[i] + (reach[i] - cells.point[i] @ direction) * direction
    return first


def as_now(helmet: Helmet, geometry: Geometry, points: FloatArray) -> FloatArray:
    """Points of a geometry, (n, 3) [m], as the helmet's shell has them now."""
    stretch = np.array(helmet.shell.semi_axes) / geometry.semi_axes
    moved: FloatArray = np.array(helmet.shell.center) + stretch * (points - geometry.center)
    return moved


def mean_densities(helmet: Helmet, cells: Columns) -> FloatArray:
    """Density of the liner below each cell of a helmet's columns, mean of its layers, (n,)
    [kg/m^3]."""
    liner, inner = helmet.liner, helmet.liner.inner
    weight = (
        zone_weights(cells.normal) if helmet.geometry is None
        else read_geometry(helmet.geometry).weight
    )  # fmt: skip
    density = zone_densities(liner, weight)
    if inner.density is None:
        return density
    return (1.0 - inner.share) * density + inner.share * inner.density


def geometry_columns(helmet: Helmet, geometry: Geometry) -> Columns:
    """The columns of a helmet whose surface was measured or drawn.

    The helmet's shell may differ from the ellipsoid that was fitted to the cells (a design with a
    thicker liner): they follow it, vector areas by the cofactors of the stretch. Thicknesses follow
    the helmet's, zone by zone.
    """
    stretch = np.array(helmet.shell.semi_axes) / geometry.semi_axes
    point = as_now(helmet, geometry, geometry.point)
    vector = geometry.normal * geometry.area[:, None] * (stretch.prod() / stretch)
    area = np.linalg.norm(vector, axis=1)
    liner, measured = helmet.liner, geometry.mean_thickness
    now = np.array([liner.zone_thickness(zone) for zone in ZONES])
    own = np.array([getattr(liner, zone).thickness is not None for zone in ZONES])
    before = np.where(own & (geometry.zone_thickness > 0.0), geometry.zone_thickness, measured)
    thickness = geometry.thickness * (geometry.weight @ (now / before))
    foam = liner_rows(liner, zone_densities(liner, geometry.weight))
    return Columns(
        point, vector / area[:, None], area, thickness, np.sqrt(area / np.pi), foam
    )  # fmt: skip


def ellipsoid_columns(helmet: Helmet) -> Columns:
    """A Fibonacci lattice mapped onto the shell's ellipsoid.

    The lattice spreads n directions evenly over the unit sphere; direction u maps to the point D u
    with D = diag(semi-axes), with area det(D) |D^-1 u| 4 pi / n and normal along D^-1 u. A cell
    of radius r on a surface of mean curvature H lies r^2 H / 4 behind its middle on average.
    """
    axes, liner = np.array(helmet.shell.semi_axes), helmet.liner
    n = liner.columns
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)  # golden angle
    ring = np.sqrt(1.0 - height**2)
    u = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    normal = u / axes
    stretch = np.linalg.norm(normal, axis=1)
    normal /= stretch[:, None]
    area = axes.prod() * stretch * 4.0 * np.pi / n
    thickness, density = zoned(liner, normal)
    radius, surface = np.sqrt(area / np.pi), axes * u
    # Mean curvature of an ellipsoid at its point p, with |grad| = |p / axes^2| (do Carmo, 3-3).
    gradient = np.linalg.norm(surface / axes**2, axis=1)
    curvature = ((axes**2).sum() - (surface**2).sum(axis=1)) / (2 * axes.prod() ** 2 * gradient**3)
    point = surface - (0.25 * radius**2 * curvature)[:, None] * normal
    point += np.array(helmet.shell.center)
    foam = liner_rows(liner, density)
    return Columns(point, normal, area, thickness, radius, foam)


def liner_rows(liner: Liner, density: FloatArray) -> FloatArray:
    """Constants of a liner's foam at each density of its outer layer, (n,) [kg/m^3]; a row each."""
    returned, inner = liner.energy_returned, liner.inner

    def rows(densities: FloatArray) -> FloatArray:
        if liner.foam is None:
            return foam_rows(densities, returned)
        return rows_of(load_foam(liner.foam), densities, returned)

    outer = rows(density)
    if inner.density is None:
        return outer
    return in_series(outer, rows(np.array([inner.density]))[0], inner.share)


def zoned(liner: Liner, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thickness [m] and density [kg/m^3] at each normal; zones blend with its squares."""
    weight = zone_weights(normal)
    thickness: FloatArray = weight @ np.array([liner.zone_thickness(zone) for zone in ZONES])
    return thickness, zone_densities(liner, weight)


def zone_densities(liner: Liner, weight: FloatArray) -> FloatArray:
    """Density of the outer layer where zones have these shares, (n, 4); (n,) [kg/m^3]."""
    density: FloatArray = weight @ np.array([liner.zone_density(zone) for zone in ZONES])
    return density


def zone_weights(normal: FloatArray) -> FloatArray:
    """Share of the zones front, back, side and top at each normal (n, 3): its squares, (n, 4)."""
    x, y, z = (normal**2).T
    front = normal[:, 0] >= 0.0
    return np.column_stack([np.where(front, x, 0.0), np.where(front, 0.0, x), y, z])
