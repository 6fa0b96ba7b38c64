"""Zones of a liner by planes or by painted triangles, where they are not the usual four sides."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force.columns import zone_weights
from helmet_sim_ros.model.geometry import ZONES
from helmet_sim_ros.study.helmets.cells import Cells, Surface
from helmet_sim_ros.study.helmets.mesh import UNITS

PLANE = re.compile(r"^\s*([xyz])\s*([<>])\s*([-+]?\d*\.?\d+)\s*(mm|cm|m|in)\s*$")
COLOR = re.compile(r"^#([0-9a-fA-F]{6})$")
LIKE = 60.0  # of 441, how far apart two colours may be in RGB: scans and exports shift them


def zoned_cells(
    cells: Cells,
    surface: Surface,
    regions: Sequence[tuple[str, str]],
    colors: NDArray[np.uint8] | None,
) -> FloatArray:
    """Share of the zones front, back, side and top in each cell, (n, 4).

    Args:
        cells: of the surface.
        surface: its triangles.
        regions: zone and where it is: planes (``x > 20 mm and z < 0 mm``, head axes) or a colour
            (``#ff0000``). A later one wins; elsewhere the zones blend with the squares of the
            normal, as on an ellipsoid.
        colors: of the surface's triangles, (m, 3); None: the mesh has none.

    Raises:
        SetupError: an unknown zone, planes that cannot be read, a colour that no triangle has, or
            a region without cells.
    """
    weight = zone_weights(cells.normal)
    for zone, where in regions:
        if zone not in ZONES:
            raise SetupError.of("zone", zone, f"must be one of {', '.join(ZONES)}")
        color = COLOR.match(where)
        inside = (
            _painted(cells, surface, color[1], colors) if color else _beyond(cells.point, where)
        )
        if not inside.any():
            raise SetupError.of("zone", f"{zone}: {where}", "holds no cell of the shell")
        weight[inside] = np.eye(len(ZONES))[ZONES.index(zone)]
    return weight


def zone_means(weight: FloatArray, area: FloatArray, thickness: FloatArray) -> FloatArray:
    """Mean thickness of each zone, (4,) [m]; 0 for one without cells."""
    share = weight * area[:, None]
    total = share.sum(axis=0)
    means: FloatArray = np.where(total > 0.0, (share * thickness[:, None]).sum(axis=0), 0.0)
    return means / np.where(total > 0.0, total, 1.0)


def parsed(regions: Mapping[str, str] | Sequence[str]) -> list[tuple[str, str]]:
    """``["top: z > 60 mm"]`` as zone and place.

    Raises:
        SetupError: no colon in one.
    """
    if isinstance(regions, Mapping):
        return list(regions.items())
    pairs = []
    for text in regions:
        zone, colon, where = text.partition(":")
        if not colon:
            raise SetupError.of("zone", text, "must be like 'top: z > 60 mm' or 'top: #ff0000'")
        pairs.append((zone.strip(), where.strip()))
    return pairs


def _beyond(point: FloatArray, where: str) -> NDArray[np.bool_]:
    inside = np.ones(len(point), dtype=bool)
    for part in where.split(" and "):
        plane = PLANE.match(part)
        if not plane:
            raise SetupError.of(
                "zone", where, "must be planes like 'z > 60 mm and x < 0 mm', or a colour '#ff0000'"
            )
        axis, side, value, unit = plane.groups()
        height = point[:, "xyz".index(axis)] - float(value) * UNITS[unit]
        inside &= height > 0.0 if side == ">" else height < 0.0
    return inside


def _painted(
    cells: Cells, surface: Surface, digits: str, colors: NDArray[np.uint8] | None
) -> NDArray[np.bool_]:
    """Cells with more than half of their area in a colour."""
    if colors is None:
        raise SetupError.of("zone", f"#{digits}", "the shell's file has no colours; use planes")
    wanted = np.array([int(digits[i : i + 2], 16) for i in (0, 2, 4)])
    like = np.linalg.norm(colors.astype(float) - wanted, axis=1) < LIKE
    area = np.linalg.norm(surface.vector, axis=1)
    painted = np.bincount(cells.cell, area * like, len(cells.area))
    inside: NDArray[np.bool_] = painted > 0.5 * np.bincount(cells.cell, area, len(cells.area))
    return inside
