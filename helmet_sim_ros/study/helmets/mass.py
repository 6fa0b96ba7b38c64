"""What a helmet weighs and how it resists being turned, from its cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.study.helmets.cells import Cells


class MassProperties(NamedTuple):
    """Of shell and liner.

    Attributes:
        shell, liner: masses [kg].
        center: of both, head frame, (3,) [m].
        inertia: moments about an axis through ``center`` along each head axis, (3,) [kg m^2].
    """

    shell: float
    liner: float
    center: FloatArray
    inertia: FloatArray

    def scaled(self, mass: float) -> MassProperties:
        """The same distribution with another total mass [kg]: straps, padding and visor are taken
        to lie as shell and liner do."""
        factor = mass / (self.shell + self.liner)
        return MassProperties(
            factor * self.shell, factor * self.liner, self.center, factor * self.inertia
        )


def mass_properties(
    cells: Cells, depth: FloatArray, thickness: FloatArray, density: FloatArray, areal: float
) -> MassProperties:
    """Mass, centre and moments of inertia.

    The liner below a cell of area A at distance R from the head's centre narrows towards it: its
    volume down to a depth d is A R / 3 (1 - (1 - d / R)^3), exact for a sphere.

    Args:
        cells: of the outer surface.
        depth: of the liner's outside below it, (n,) [m].
        thickness: of the liner, (n,) [m].
        density: of the foam, (n,) [kg/m^3].
        areal: mass of the shell per area [kg/m^2].
    """
    radius = np.linalg.norm(cells.point, axis=1)
    upper, lower = np.minimum(depth / radius, 1.0), np.minimum((depth + thickness) / radius, 1.0)
    volume = cells.area * radius / 3.0 * ((1.0 - upper) ** 3 - (1.0 - lower) ** 3)
    shell, liner = areal * cells.area, density * volume
    place = np.vstack(
        [
            cells.point - 0.5 * depth[:, None] * cells.normal,
            cells.point - (depth + 0.5 * thickness)[:, None] * cells.normal,
        ]
    )
    mass = np.concatenate([shell, liner])
    center = mass @ place / mass.sum()
    squared = (place - center) ** 2
    inertia = np.array([mass @ (squared.sum(axis=1) - squared[:, i]) for i in range(3)])
    return MassProperties(float(shell.sum()), float(liner.sum()), center, inertia)
