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
from helmet_sim_ros.model.force.foam import foam_rows
from helmet_sim_ros.model.helmet import Helmet, Liner


class Columns(NamedTuple):
    """The columns of one helmet, shared by its impacts; row i belongs to column i.

    Attributes:
        point: on the outer surface, helmet frame, (n, 3) [m].
        normal: outward, helmet frame, (n, 3).
        area: (n,) [m^2].
        thickness: of the liner, (n,) [m].
        radius: of a disc of the cell's area, (n,) [m].
        foam: constants of each column's foam, (n, 5); see :mod:`helmet_sim_ros.model.force.foam`.
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
    return Columns(np.zeros((0, 3)), np.zeros((0, 3)), none, none, none, np.zeros((0, 5)))


@lru_cache(maxsize=8)
def columns(helmet: Helmet) -> Columns:
    """The columns of a helmet: a Fibonacci lattice mapped onto the shell's ellipsoid.

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
    foam = foam_rows(density, liner.energy_returned)
    return Columns(point, normal, area, thickness, radius, foam)


def zoned(liner: Liner, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thickness [m] and density [kg/m^3] at each normal; zones blend with its squares."""
    thickness, density = np.zeros(len(normal)), np.zeros(len(normal))
    for axis, (negative, positive) in enumerate(
        (("back", "front"), ("side", "side"), ("top", "top"))
    ):
        weight = normal[:, axis] ** 2
        for zone, here in ((negative, normal[:, axis] < 0.0), (positive, normal[:, axis] >= 0.0)):
            thickness += np.where(here, weight * liner.zone_thickness(zone), 0.0)
            density += np.where(here, weight * liner.zone_density(zone), 0.0)
    return thickness, density
