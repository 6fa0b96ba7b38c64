"""Helmet designs: what a change of the liner does to the rest of the helmet, and what it weighs.

The head stays what it is, so a thicker liner needs a larger shell, and both weigh more:

- every semi-axis of the shell grows by the change of thickness along it, the centre moves where
  front and back (or top and open bottom) change by different amounts; to first order that is the
  blend of zones that the liner itself uses;
- the helmet's mass changes with the mass of the liner and with the area of the shell;
- its moments of inertia scale with mass times size squared (geometric similarity).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import Columns, columns, mean_densities
from helmet_sim_ros.model.geometry import ZONES, read_geometry
from helmet_sim_ros.model.helmet import Helmet, Shell
from helmet_sim_ros.schema import Config, quantity

#: Values that follow from the others and cannot be varied by themselves.
FOLLOWING = ("mass", "inertia", "shell.semi_axes", "shell.center")
#: What a design is asked for besides criteria: name -> unit.
QUANTITIES = {
    "helmet_mass": "kg",
    "liner_mass": "kg",
    "max_thickness": "m",
    "max_density": "kg/m^3",
}
#: Columns with which masses are integrated; the simulation's own number is a matter of its cost.
MASS_COLUMNS = 1000


class DesignRules(Config):
    """How mass follows from shape. Both values are general literature values."""

    lowest_normal: float = quantity(
        "liner and shell cover the helmet's surface where its outward normal rises above this "
        "z component; -0.3 is 65 % of a sphere, the face opening is left out",
        "-", -0.3, ge=-1.0, le=0.9,
    )  # fmt: skip
    shell_areal_density: float = quantity(
        "mass of the shell per area: 3 mm of glass-fibre composite", "kg/m^2", 4.5, ge=0.0, le=20.0
    )


@dataclass(frozen=True)
class Design:
    """A helmet and what it weighs.

    Attributes:
        helmet: complete, ready to be written to a file.
        changes: what differs from the reference, by dotted name below ``helmet.``.
        quantities: the values of ``QUANTITIES``.
    """

    helmet: Helmet
    changes: Mapping[str, object]
    quantities: Mapping[str, float]


def make_design(reference: Helmet, values: Mapping[str, object], rules: DesignRules) -> Design:
    """The helmet that follows from a reference with some values replaced.

    Args:
        reference: whose mass, inertia and shell belong to its own liner.
        values: by dotted name below ``helmet.`` (``liner.density``).

    Raises:
        SetupError: unknown name, a refused value, or one that follows from the others.
    """
    for name in FOLLOWING:
        if name in values:
            raise SetupError.of(
                f"helmet.{name}", values[name], "follows from liner and shell in a design"
            )
    changed: Helmet = reference.replaced(values)
    shell = _shell_around(reference, changed)
    grown: Helmet = changed.replaced({f"shell.{k}": v for k, v in shell.items()})
    mass = reference.mass + bare_mass(grown, rules) - bare_mass(reference, rules)
    size = np.mean(grown.shell.semi_axes) / np.mean(reference.shell.semi_axes)
    scale = float(mass / reference.mass * size**2)
    following = {
        "mass": mass,
        "inertia": tuple(scale * i for i in reference.inertia),
        **{f"shell.{name}": value for name, value in shell.items()},
    }
    helmet: Helmet = changed.replaced(following)
    quantities = {
        "helmet_mass": helmet.mass,
        "liner_mass": liner_mass(grown, rules),
        "max_thickness": max(zone_thicknesses(helmet)),
        "max_density": max(helmet.liner.zone_density(zone) for zone in ZONES),
    }
    return Design(helmet, {**values, **following}, quantities)


def zone_thicknesses(helmet: Helmet) -> tuple[float, ...]:
    """Thickness of the liner in each of ``ZONES`` [m].

    Of a measured liner the mean where the zone is, as thick as the helmet's values make it now; see
    :func:`helmet_sim_ros.model.force.columns.geometry_columns`.
    """
    liner = helmet.liner
    if helmet.geometry is None:
        return tuple(liner.zone_thickness(zone) for zone in ZONES)
    geometry = read_geometry(helmet.geometry)
    mean = float(geometry.mean_thickness)
    before = np.where(geometry.zone_thickness > 0.0, geometry.zone_thickness, mean)
    scaled = before * liner.thickness / mean
    own = (getattr(liner, zone).thickness for zone in ZONES)
    return tuple(float(s) if o is None else o for o, s in zip(own, scaled, strict=True))


def bare_mass(helmet: Helmet, rules: DesignRules) -> float:
    """Mass of liner and shell [kg], without straps, padding and visor."""
    return liner_mass(helmet, rules) + rules.shell_areal_density * shell_area(helmet, rules)


def liner_mass(helmet: Helmet, rules: DesignRules) -> float:
    """Density times volume of the liner [kg], over the covered part of the shell.

    The layer of thickness t below a cell of area A has the volume A (t - H t^2 + K t^3 / 3), with
    the mean curvature H and the Gaussian curvature K of the surface (Steiner's formula).
    """
    cells, covered = _cells(helmet, rules)
    mean, gaussian = _curvatures(helmet.shell, cells)
    t, density = cells.thickness, mean_densities(helmet, cells)
    volume = cells.area * (t - mean * t**2 + gaussian * t**3 / 3.0)
    return float(np.sum((density * volume)[covered]))


def shell_area(helmet: Helmet, rules: DesignRules) -> float:
    """Area of the covered part of the shell [m^2]."""
    cells, covered = _cells(helmet, rules)
    return float(np.sum(cells.area[covered]))


@lru_cache(maxsize=8)
def _cells(helmet: Helmet, rules: DesignRules) -> tuple[Columns, NDArray[np.bool_]]:
    """The columns' geometry, and which of them are covered."""
    if helmet.geometry is not None:  # it has no cells where the helmet is open
        cells = columns(helmet)
        return cells, np.ones(len(cells.area), dtype=bool)
    fine = columns(helmet.replaced({"liner.columns": MASS_COLUMNS}))
    return fine, fine.normal[:, 2] > rules.lowest_normal


def _curvatures(shell: Shell, cells: Columns) -> tuple[FloatArray, FloatArray]:
    """Mean and Gaussian curvature of the ellipsoid at each cell [1/m, 1/m^2].

    With the distance h of the tangent plane from the centre: K = h^4 / (abc)^2 and
    H = h^3 (a^2 + b^2 + c^2 - |p|^2) / (2 (abc)^2).
    """
    axes = np.array(shell.semi_axes)
    point = cells.point - np.array(shell.center)
    h = np.einsum("ij,ij->i", point, cells.normal)
    squared = axes.prod() ** 2
    spread = np.sum(axes**2) - np.einsum("ij,ij->i", point, point)
    return h**3 * spread / (2.0 * squared), h**4 / squared


def _shell_around(reference: Helmet, changed: Helmet) -> dict[str, tuple[float, ...]]:
    """Semi-axes and centre of the shell that leave the head its room."""
    front, back, side, top = (
        after - before
        for before, after in zip(
            zone_thicknesses(reference), zone_thicknesses(changed), strict=True
        )
    )
    # The open bottom stays: half of what the top gains goes into the semi-axis.
    growth = np.array([(front + back) / 2.0, side, top / 2.0])
    shift = np.array([(front - back) / 2.0, 0.0, top / 2.0])
    return {
        "semi_axes": tuple((np.array(reference.shell.semi_axes) + growth).tolist()),
        "center": tuple((np.array(reference.shell.center) + shift).tolist()),
    }
