"""Where the plate of a shell lies: found on the struck surface, laid, and laid anew.

The surface is looked for along the normal of the tangent plane; the window covers the columns that
may touch, and what it had goes on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force.bodies import Motion, rigid, world_point
from helmet_sim_ros.model.force.liner import CrushingLiner
from helmet_sim_ros.model.force.plate import (
    COLUMNS,
    FIRST_COLUMN,
    FIRST_ROW,
    ROWS,
    Plate,
    height_at,
    node,
    plate,
)
from helmet_sim_ros.model.force.vector import cross, dot, row, row3, turned
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.surface.compiled import COLUMNS as SIZES
from helmet_sim_ros.model.surface.compiled import HALF_SPACE, Surface, at_rest
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import nearest, signed_distance, tangent

ABOVE = 0.05  # m over the tangent plane, from where the surface is looked for
BELOW = 0.15  # m, how far down it is looked for
NOTHING = -1.0  # m, height where there is no surface
RISE = 0.01  # m over the tangent plane, below which columns count as near
FOUND = 1e-7  # m
STEPS = 60  # of the search for the surface
SPARE = 0.006  # m by which a window that is laid anew is larger than it must be
IDLE = 0.018  # m beyond twice the overhang, from where on a window is too large
FAR = 1 << 30  # of any node
#: Least cosine between a plate that has let go and the surface where the helmet meets it next:
#: below it is laid anew. Choice.
TURNED = 0.9

#: What is kept of each column: first node of the cell that it is over, and its place there from 0
#: to 1 (before the cell is known: in the whole grid [cells]); height over the tangent plane [m],
#: cosine of its normal to the plane's, rate of the height [m/s], and the force that it has now [N].
CELL, ACROSS, ALONG, HEIGHT, COSINE, RATE, PUSHED = range(7)

AWAY, RESTS, MOVES = range(3)  # of a shell: not in place; flat, and still; bent


class Shell(NamedTuple):
    """The shell of one helmet in one impact.

    Attributes:
        grid: the plate.
        engaged: ``AWAY``, ``RESTS`` or ``MOVES``; (1,), state.
        plane: the tangent plane as a surface; state.
        frame: origin (3) [m], and unit vectors x, y and outward normal; (12,), state.
        next: the same of where the helmet is deepest now; (12,), working memory.
        friction: of what lies below each node; state.
        columns: of each column, see ``CELL`` to ``PUSHED``; (columns, 7).
        active: indices of the columns that may touch the plate, their number in the last place.
    """

    grid: Plate
    engaged: NDArray[np.int64]
    plane: Surface
    frame: FloatArray
    next: FloatArray
    friction: FloatArray
    columns: FloatArray
    active: NDArray[np.int64]


def shell(helmet: Helmet, liner: CrushingLiner) -> Shell:
    """The shell of a helmet, not yet in place."""
    grid = plate(helmet.shell, liner.columns)
    count = len(liner.columns.area)
    plane = at_rest(
        np.array([HALF_SPACE]),
        np.zeros((1, 3)),
        np.zeros((1, 9)),
        np.zeros((1, SIZES)),
        np.zeros(1),
    )
    return Shell(
        grid, np.zeros(1, dtype=np.int64), plane, np.zeros(12), np.zeros(12),
        np.zeros(grid.height.shape),
        np.zeros((count, PUSHED + 1)), np.zeros(count + 1, dtype=np.int64),
    )  # fmt: skip


@compiled
def below(
    surface: Surface, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> tuple[float, int]:
    """How far down along -n the surface lies [m] and which shape; over ``BELOW``: there is none."""
    nearest, which = ABOVE + BELOW + 1.0, 0
    for k in range(len(surface.kind)):
        way = 0.0
        for _ in range(STEPS):
            d, mx, my, mz, _ = signed_distance(
                surface, k, x - way * nx, y - way * ny, z - way * nz
            )  # fmt: skip
            if d < FOUND:
                if way < nearest:
                    nearest, which = way, k
                break
            slope = mx * nx + my * ny + mz * nz
            # The distance is convex along the line: Newton's step never goes too far.
            if slope <= 1e-6 and d > FOUND:
                break
            way += d / slope
            if way > ABOVE + BELOW:
                break
    return nearest, which


@compiled
def survey(shell: Shell, surface: Surface, k: int, i: int, j: int) -> None:
    """Find what lies below node k of the window, which is in that row and column of the grid."""
    f, cell = shell.frame, shell.grid.cell
    u, v = i * cell, j * cell
    way, which = below(
        surface,
        f[0] + u * f[3] + v * f[6] + ABOVE * f[9],
        f[1] + u * f[4] + v * f[7] + ABOVE * f[10],
        f[2] + u * f[5] + v * f[8] + ABOVE * f[11],
        f[9], f[10], f[11],
    )  # fmt: skip
    shell.grid.anvil[k] = ABOVE - way if way <= ABOVE + BELOW else NOTHING
    shell.friction[k] = surface.friction[which]


@compiled
def closest(
    liner: CrushingLiner, surface: Surface, motion: Motion, least: float, frame: FloatArray
) -> bool:
    """Whether the shell's ellipsoid reaches deeper into the surface than ``least`` [m]; where it
    reaches deepest, the surface's point and normal go to ``frame``."""
    center = world_point(rigid(motion, liner.helmet), liner.center)
    found = False
    for k in range(len(surface.kind)):
        depth, (px, py, pz), (nx, ny, nz) = deepest_point(
            surface, k, center, motion.rotation[liner.helmet], liner.semi_axes, liner.direction[k]
        )
        if depth > least:
            found, least = True, depth
            frame[0], frame[1], frame[2] = px + depth * nx, py + depth * ny, pz + depth * nz
            frame[9], frame[10], frame[11] = nx, ny, nz
    return found


@compiled
def touches(liner: CrushingLiner, surface: Surface, motion: Motion) -> bool:
    """Whether any listed column reaches into the surface: those of a measured shell may stand out
    of its ellipsoid."""
    helmet = rigid(motion, liner.helmet)
    points, normals, radii = liner.columns.point, liner.columns.normal, liner.columns.radius
    for n in range(liner.near.listed[-1]):
        i = liner.near.listed[n]
        x, y, z = world_point(helmet, row(points, i))
        _, distance, nx, ny, nz, _ = nearest(surface, x, y, z)
        cosine = -dot((nx, ny, nz), turned(helmet.rotation, row(normals, i)))
        reach = radii[i] * max(0.0, 1.0 - cosine * cosine) ** 0.5
        if cosine > 0.0 and distance < reach:
            return True
    return False


@compiled
def engage(shell: Shell, liner: CrushingLiner, surface: Surface, motion: Motion) -> bool:
    """Lay the plate into the tangent plane of the deepest contact; False: there is none yet."""
    f = shell.frame
    if liner.measured and not touches(liner, surface, motion):
        return False
    if not closest(liner, surface, motion, -np.inf if liner.measured else 0.0, f):
        return False
    normal = (f[9], f[10], f[11])
    ex, ey, ez = tangent(f[9], f[10], f[11])
    f[3], f[4], f[5] = ex, ey, ez
    f[6], f[7], f[8] = cross(normal, (ex, ey, ez))
    for k in range(3):
        shell.plane.position[0, k] = f[k] + RISE * f[9 + k]
        for j in range(3):
            shell.plane.rotation[0, 3 * k + j] = f[3 + 3 * j + k]
    liner.near.position[:] = np.inf  # the list of near columns is now that of the plane
    shell.grid.window[:] = 0
    return True


@compiled
def turned_away(shell: Shell, liner: CrushingLiner, surface: Surface, motion: Motion) -> bool:
    """Whether the helmet meets the surface where that is turned from the plate: another shape, or
    the side of this one."""
    if not closest(liner, surface, motion, 0.0, shell.next):
        return False
    return dot(row3(shell.next, 9), row3(shell.frame, 9)) < TURNED


@compiled
def cover(shell: Shell, surface: Surface) -> None:
    """Lay the window anew where it does not reach beyond all active columns, or reaches too far."""
    grid, active, state = shell.grid, shell.active, shell.columns
    window, margin = grid.window, max(1, math.ceil(grid.overhang))
    spare, idle = math.ceil(SPARE / grid.cell), math.ceil(IDLE / grid.cell)
    top = left = FAR
    bottom = right = -FAR
    for n in range(active[-1]):
        i, j = math.floor(state[active[n], ACROSS]), math.floor(state[active[n], ALONG])
        top, bottom = min(top, i - margin), max(bottom, i + 1 + margin)
        left, right = min(left, j - margin), max(right, j + 1 + margin)
    over, before = top - window[FIRST_ROW], left - window[FIRST_COLUMN]
    under = window[FIRST_ROW] + window[ROWS] - 1 - bottom
    behind = window[FIRST_COLUMN] + window[COLUMNS] - 1 - right
    least, most = min(over, under, before, behind), max(over, under, before, behind)
    if least >= 0 and most <= margin + idle:
        return
    # The largest window covers the middle of a larger contact.
    rows, columns = bottom - top + 1 + 2 * spare, right - left + 1 + 2 * spare
    kept_rows, kept_columns = min(rows, grid.most), min(columns, grid.most)
    lay(
        shell, surface, kept_rows, kept_columns,
        top - spare + (rows - kept_rows) // 2, left - spare + (columns - kept_columns) // 2,
    )  # fmt: skip


@compiled
def lay(shell: Shell, surface: Surface, rows: int, columns: int, row: int, column: int) -> None:
    """Lay the window with so many rows and columns and its first node in that row and column of the
    grid. Nodes that it had stay as they are, others go on from them."""
    grid, window = shell.grid, shell.grid.window
    kept = (grid.height, grid.speed, grid.slow, grid.anvil)
    height, speed, slow, anvil, friction = (
        grid.lagging, grid.pull, grid.smoothed, grid.moments[0], grid.moments[1],
    )  # fmt: skip
    for k in range(len(height)):
        height[k], speed[k], slow[k] = grid.height[k], grid.speed[k], grid.slow[k]
        anvil[k], friction[k] = grid.anvil[k], shell.friction[k]
    for a in kept:
        a[:] = 0.0
    shell.friction[:] = 0.0
    had_rows, had_columns = window[ROWS], window[COLUMNS]
    away_i, away_j = row - window[FIRST_ROW], column - window[FIRST_COLUMN]
    for i in range(rows):
        for j in range(columns):
            k = (i + 1) * (columns + 2) + j + 1
            oi, oj = i + away_i, j + away_j
            if 0 <= oi < had_rows and 0 <= oj < had_columns:
                o = node(grid, oi, oj)
                grid.height[k], grid.speed[k], grid.slow[k] = height[o], speed[o], slow[o]
                grid.anvil[k], shell.friction[k] = anvil[o], friction[o]
            else:
                survey(shell, surface, k, row + i, column + j)
                grid.height[k] = max(height_at(grid, height, float(oi), float(oj)), grid.anvil[k])
    window[ROWS], window[COLUMNS], window[FIRST_ROW], window[FIRST_COLUMN] = (
        rows, columns, row, column,
    )  # fmt: skip
    for a in (grid.pressed, grid.steepness, height, speed, slow):
        a[:] = 0.0
    grid.free[:] = 1.0
    grid.moments[:] = 0.0
    grid.softened[:] = 0.0
