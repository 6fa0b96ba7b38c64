"""The grid on which the shell's plate is stepped: its bending, its rest on the anvil, its motion.

Bending energy per area (Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, eq. 47)::

    D/2 (zxx^2 + zyy^2 + 2 nu zxx zyy + 2 (1 - nu) zxy^2),    D = E t^3 / (12 (1 - nu^2))

Moments saturate at the shell's strength. Foam presses the nodes, and the anvil holds them where
they rest on it.

The plate has no inertia of its own. A small mass gives it explicit steps, which the fastest waves
would make very short: so accelerations are smoothed over neighbouring nodes. That is a mass matrix
under which short waves are much heavier, and long ones and the plate as a whole as heavy as
without (selective mass scaling, as Olovsson, Simonsson & Unosson 2005 do it for finite elements).
Beside nodes that rest on the anvil, which do not take part, it is made heavier too. What changes
slowly, the foam's forces, how far moments have saturated and where the plate rests, is asked for
every few steps; between them forces follow their tangents.

Only a window of an endless grid is stepped, that which foam presses. Beyond it the plate is free of
load and goes on straight.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.columns import Columns
from helmet_sim_ros.model.force.foam import MODULUS, RETURNED
from helmet_sim_ros.model.helmet import Shell

REAL = np.float32  # of the nodes: twice as many are computed at a time
Reals = NDArray[np.float32]
TWO, HALF, QUARTER = REAL(2.0), REAL(0.5), REAL(0.25)

LARGEST = 0.24  # m, side of the largest window: more than a helmet crushed by 40 mm touches
#: How far the window reaches beyond what foam presses, over the length in which bending decays on
#: elastic foam, (D thickness / modulus)^(1/4). Choice: how far a shell goes on as a plate.
OVERHANG = 2.0
#: The plate is without inertia. This mass per area gives it explicit steps; a third of it changes
#: no peak by more than 1 %. [kg/m^2]
MASS = 0.5
#: Largest eigenvalue of the smoothed bending stiffness, in D / cell^4, whatever nodes are on the
#: anvil: lines, diagonals, rings, patches, every other, or at random. Unsmoothed it is 64.
STIFFEST = 4.6
SHARE = 0.8  # of the largest stable step
#: Vibration of the mass is damped at this rate [1/s], against its speed of the last moments [s].
QUIET, SLOW = 5e3, 3e-4
DAMPING = 0.2  # of the fastest bending mode; the foam damps all slow ones
LIFTED = 1e-6  # m over the anvil, from where a node does not rest on it
ROWS, COLUMNS, FIRST_ROW, FIRST_COLUMN = range(4)  # of a window


class Plate(NamedTuple):
    """The grid of one shell: a window of nodes with a ring of others around it.

    Arrays of nodes are flat, row by row, ring included; :func:`node` tells where a node is.

    Attributes:
        stiffness: D [N m]; 0: no plate.
        poisson: nu [-].
        strongest: curvature at which an elastic moment would reach the strength [1/m].
        lag: damping over stiffness in bending [s].
        longest: largest stable step [s].
        cell: of the grid [m].
        most: rows or columns that a window may have.
        overhang: how far the window reaches beyond what foam presses [cells].
        window: its rows, columns, and place of its first node in the endless grid, (4,); state.
        height, speed: over the tangent plane [m], [m/s]; state.
        slow: speed of the last moments [m/s]; state.
        anvil: height of what lies below [m]; state.
        pressed, steepness: force of the foam [N] at height 0 along its tangent, and the tangent
            [N/m]; state.
        lagging: height and the damping's share of the speed over the cell's area [1/m]; working
            memory.
        moments: over D, xx, yy and xy, (3, nodes) [1/m]; working memory.
        softened: share of the elastic moments that the strength leaves, 0 where the plate ends,
            (3, nodes); state.
        free: share of a node's neighbourhood that does not rest on the anvil; state.
        pull, smoothed: force per area against the height [Pa]; working memory.
    """

    stiffness: float
    poisson: float
    strongest: float
    lag: float
    longest: float
    cell: float
    most: int
    overhang: float
    window: NDArray[np.int64]
    height: Reals
    speed: Reals
    slow: Reals
    anvil: Reals
    pressed: Reals
    steepness: Reals
    lagging: Reals
    moments: Reals
    softened: Reals
    free: Reals
    pull: Reals
    smoothed: Reals


def plate(shell: Shell, columns: Columns) -> Plate:
    """The plate of a shell over a liner's columns."""
    material, cell = shell.material, shell.cell
    stiffness = material.bending_stiffness if len(columns.area) else 0.0
    most = math.ceil(LARGEST / cell) if stiffness > 0.0 else 0
    longest, lag, overhang = math.inf, 0.0, 0.0
    if stiffness > 0.0:
        # Foam that has hardly crushed unloads along its modulus over the share returned.
        foam = columns.foam
        steep = float((foam[:, MODULUS] / foam[:, RETURNED]).max() / columns.thickness.min())
        # A column larger than a cell is borne by few nodes, over which smoothing spreads it.
        crowded = 0.25 * float(columns.area.max()) / cell**2
        fastest = math.sqrt((STIFFEST * stiffness / cell**4 + max(1.0, crowded) * steep) / MASS)
        decay = float((stiffness * columns.thickness / foam[:, MODULUS]).max()) ** 0.25
        overhang = OVERHANG * decay / cell
        lag = 2.0 * DAMPING / fastest
        longest = SHARE * 2.0 / fastest * (math.hypot(1.0, DAMPING) - DAMPING)
    nodes = (most + 2) ** 2
    height, speed, slow, anvil, pressed, steepness, lagging, free, pull, smoothed = (
        np.zeros(nodes, REAL) for _ in range(10)
    )
    return Plate(
        stiffness, material.poisson, material.strongest_curvature, lag, longest, cell, most,
        overhang, np.zeros(4, dtype=np.int64), height, speed, slow, anvil, pressed, steepness,
        lagging, np.zeros((3, nodes), REAL), np.zeros((3, nodes), REAL), free, pull, smoothed,
    )  # fmt: skip


@inlined
def node(plate: Plate, i: int, j: int) -> int:
    """Where the node of a row and column of the window is in the flat arrays."""
    return (i + 1) * (int(plate.window[COLUMNS]) + 2) + j + 1


@inlined
def extent(plate: Plate) -> tuple[int, int, int]:
    """First and end of the window's nodes, and how far the next row is; between two rows there are
    two nodes of the ring."""
    rows, row = int(plate.window[ROWS]), int(plate.window[COLUMNS]) + 2
    return row + 1, (rows + 1) * row - 1, row


# Loops go over all nodes at once, by slices that begin where they do: the compiler does several at
# a time. What they make of the ring is overwritten or counts nothing.


@compiled
def continue_straight(plate: Plate, a: Reals) -> None:
    """Fill the ring: there is no curvature across the window's edges."""
    first, end, row = extent(plate)
    above, top, second = a[:row], a[row : 2 * row], a[2 * row : 3 * row]
    last = end + 1 - row
    under, low, before = a[last + row : last + 2 * row], a[last : last + row], a[last - row : last]
    for j in range(first, end, row):
        k = j + row - 3
        a[j - 1], a[k + 1] = TWO * a[j] - a[j + 1], TWO * a[k] - a[k - 1]
    for j in range(row):
        above[j], under[j] = TWO * top[j] - second[j], TWO * low[j] - before[j]


@compiled
def lag(plate: Plate) -> None:
    """Write the heights that bend the plate."""
    first, end, _ = extent(plate)
    z, w, lagging = plate.height[first:end], plate.speed[first:end], plate.lagging[first:end]
    late, scale = REAL(plate.lag), REAL(1.0 / (plate.cell * plate.cell))
    for k in range(len(z)):
        lagging[k] = scale * (z[k] + late * w[k])
    continue_straight(plate, plate.lagging)


@compiled
def soften(plate: Plate) -> None:
    """Write which share of the elastic moments the strength leaves at the present curvatures."""
    lag(plate)
    first, end, row = extent(plate)
    nu, one, both = REAL(plate.poisson), REAL(1.0), REAL(2.0 * plate.poisson)
    yielding = REAL(1.0 / (plate.strongest * plate.strongest))
    twisting = TWO * (one - nu) * yielding
    a = plate.lagging
    here, left, right = a[first:end], a[first - 1 : end - 1], a[first + 1 : end + 1]
    above, under = a[first - row : end - row], a[first + row : end + row]
    corner = a[first + row + 1 : end + row + 1]
    along, across = plate.softened[0], plate.softened[1]
    twisted = plate.softened[2]
    along_, across_, twisted_ = along[first:end], across[first:end], twisted[first:end]
    for k in range(len(here)):
        kx = above[k] - TWO * here[k] + under[k]
        ky = left[k] - TWO * here[k] + right[k]
        kz = (here[k] - right[k]) - (under[k] - corner[k])
        size = (kx * kx + ky * ky + both * kx * ky) * yielding
        along_[k] = across_[k] = one / np.sqrt(one + size)
        twisted_[k] = one / np.sqrt(one + kz * kz * twisting)
    # Beyond its edges there is no plate.
    for j in range(row):
        along[row + j] = along[end + 1 - row + j] = twisted[end + 1 - row + j] = 0.0
    for j in range(first, end, row):
        k = j + row - 3
        along[j - 1] = along[k + 1] = twisted[j - 1] = twisted[k] = twisted[k + 1] = 0.0
        across[j - 1] = across[j] = across[k] = across[k + 1] = 0.0


@compiled
def bend(plate: Plate) -> None:
    """Moments over D."""
    lag(plate)
    first, end, row = extent(plate)
    nu, less, a = REAL(plate.poisson), REAL(1.0 - plate.poisson), plate.lagging
    here, left, right = a[first:end], a[first - 1 : end - 1], a[first + 1 : end + 1]
    above, under = a[first - row : end - row], a[first + row : end + row]
    corner = a[first + row + 1 : end + row + 1]
    along, across = plate.softened[0, first:end], plate.softened[1, first:end]
    twisted = plate.softened[2, first:end]
    xx, yy = plate.moments[0, first:end], plate.moments[1, first:end]
    xy = plate.moments[2, first:end]
    for k in range(len(here)):
        kx = above[k] - TWO * here[k] + under[k]
        ky = left[k] - TWO * here[k] + right[k]
        kz = (here[k] - right[k]) - (under[k] - corner[k])
        xx[k] = along[k] * (kx + nu * ky)
        yy[k] = across[k] * (ky + nu * kx)
        xy[k] = less * twisted[k] * kz


@compiled
def pull_back(plate: Plate, step: float) -> None:
    """Write the force per area against the height: of bending, of the foam, and of the anvil."""
    bend(plate)
    first, end, row = extent(plate)
    xx, yy, xy = plate.moments[0], plate.moments[1], plate.moments[2]
    xx_above, xx_here = xx[first - row : end - row], xx[first:end]
    xx_under = xx[first + row : end + row]
    yy_left, yy_here, yy_right = yy[first - 1 : end - 1], yy[first:end], yy[first + 1 : end + 1]
    xy_corner, xy_above = xy[first - row - 1 : end - row - 1], xy[first - row : end - row]
    xy_left, xy_here = xy[first - 1 : end - 1], xy[first:end]
    z, w, anvil = plate.height[first:end], plate.speed[first:end], plate.anvil[first:end]
    pressed, steepness = plate.pressed[first:end], plate.steepness[first:end]
    pull, free = plate.pull[first:end], plate.free[first:end]
    per_area = 1.0 / (plate.cell * plate.cell)
    loaded, stiff, none = REAL(per_area), REAL(plate.stiffness * per_area), REAL(0.0)
    inertia, per_step = REAL(MASS / step), REAL(1.0 / step)
    # Transposed stencils: the plate's own forces add up to no force and no moment.
    for k in range(len(pull)):
        f = xx_above[k] - TWO * xx_here[k] + xx_under[k]
        f += yy_left[k] - TWO * yy_here[k] + yy_right[k]
        f += TWO * ((xy_corner[k] - xy_above[k]) - (xy_left[k] - xy_here[k]))
        foam = max(pressed[k] + steepness[k] * z[k], none)
        # The anvil bears more than what brings a node down to it: neighbours do not feel that.
        most = inertia * ((z[k] - anvil[k]) * per_step + w[k])
        pull[k] = free[k] * min(stiff * f + loaded * foam, max(most, none))


@inlined
def mirror_sides(plate: Plate, a: Reals) -> None:
    """Give the ring beside the window what its first and last column have."""
    first, end, row = extent(plate)
    for j in range(first, end, row):
        a[j - 1], a[j + row - 2] = a[j], a[j + row - 3]


@inlined
def mirror_ends(plate: Plate, a: Reals) -> None:
    """Give the ring above and below the window what its first and last row have."""
    _, end, row = extent(plate)
    above, top = a[:row], a[row : 2 * row]
    low, under = a[end + 1 - row : end + 1], a[end + 1 : end + 1 + row]
    for j in range(row):
        above[j], under[j] = top[j], low[j]


@compiled
def smooth(plate: Plate) -> None:
    """Smooth the forces; their sum stays as it is."""
    first, end, row = extent(plate)
    pull, smoothed = plate.pull, plate.smoothed
    left, here, right = pull[first - 1 : end - 1], pull[first:end], pull[first + 1 : end + 1]
    across = smoothed[first:end]
    above, under = smoothed[first - row : end - row], smoothed[first + row : end + row]
    mirror_sides(plate, pull)
    for k in range(len(here)):
        across[k] = HALF * here[k] + QUARTER * (left[k] + right[k])
    mirror_ends(plate, smoothed)
    for k in range(len(here)):
        here[k] = HALF * across[k] + QUARTER * (above[k] + under[k])


@compiled
def move(plate: Plate, step: float, most: float) -> None:
    """One step of the plate; no node is faster than ``most`` [m/s]."""
    pull_back(plate, step)
    smooth(plate)
    first, end, _ = extent(plate)
    z, w, anvil = plate.height[first:end], plate.speed[first:end], plate.anvil[first:end]
    slow, pull, free = plate.slow[first:end], plate.pull[first:end], plate.free[first:end]
    gained, quiet = REAL(step / SLOW), REAL(step * QUIET)
    rate, highest, late, none = REAL(step / MASS), REAL(most), REAL(step), REAL(0.0)
    for k in range(len(z)):
        speed = w[k] - rate * free[k] * pull[k] - quiet * (w[k] - slow[k])
        speed = min(max(speed, -highest), highest)
        slow[k] += gained * (speed - slow[k])
        height = z[k] + late * speed
        stopped = height < anvil[k]
        z[k] = anvil[k] if stopped else height
        w[k] = max(speed, none) if stopped else speed


@compiled
def free_nodes(plate: Plate) -> None:
    """Write where the plate does not rest on the anvil."""
    first, end, _ = extent(plate)
    z, anvil = plate.height[first:end], plate.anvil[first:end]
    pull, free = plate.pull[first:end], plate.free[first:end]
    lifted, one, none = REAL(LIFTED), REAL(1.0), REAL(0.0)
    for k in range(len(z)):
        pull[k] = one if z[k] > anvil[k] + lifted else none
    smooth(plate)
    for k in range(len(z)):
        free[k] = max(pull[k], QUARTER)


@compiled
def rests(plate: Plate) -> bool:
    """Whether all that the foam presses lies on the anvil."""
    for i in range(plate.window[ROWS]):
        for k in range(node(plate, i, 0), node(plate, i, plate.window[COLUMNS])):
            if plate.steepness[k] > 0.0 and plate.height[k] > plate.anvil[k] + LIFTED:
                return False
    return True


@compiled
def flies(plate: Plate, gap: float) -> bool:
    """Whether the whole window is farther over the anvil than a gap [m]."""
    for i in range(plate.window[ROWS]):
        for k in range(node(plate, i, 0), node(plate, i, plate.window[COLUMNS])):
            if plate.height[k] <= plate.anvil[k] + gap:
                return False
    return True


@compiled
def in_plate(plate: Plate, x: float, y: float) -> tuple[int, int, float, float]:
    """Row and column of the window's cell next to a place [cells], and the way from its first node
    to the place, from 0 to 1 within the window: beyond, the plate goes on straight as far as its
    bending reaches, and then level."""
    i = min(max(math.floor(x), 0), plate.window[ROWS] - 2)
    j = min(max(math.floor(y), 0), plate.window[COLUMNS] - 2)
    far = plate.overhang
    return i, j, min(max(x - i, -far), 1.0 + far), min(max(y - j, -far), 1.0 + far)


@compiled
def height_at(plate: Plate, a: Reals, x: float, y: float) -> float:
    """Height [m] at a place of the window or beyond [cells]; ``a``: heights of its nodes."""
    if plate.window[ROWS] == 0:
        return 0.0
    i, j, u, v = in_plate(plate, x, y)
    k, row = node(plate, i, j), int(plate.window[COLUMNS]) + 2
    near = (1.0 - u) * a[k] + u * a[k + row]
    height: float = (1.0 - v) * near + v * ((1.0 - u) * a[k + 1] + u * a[k + row + 1])
    return height
