"""The grid on which the shell's plate is stepped: its bending, its rest on the anvil, its motion.

Bending energy per area (Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, eq. 47)::

    D/2 (zxx^2 + zyy^2 + 2 nu zxx zyy + 2 (1 - nu) zxy^2),    D = E t^3 / (12 (1 - nu^2))

Moments saturate at the shell's strength. Foam presses the nodes, and the anvil holds them where
they rest on it.

The plate has no inertia of its own. A small mass gives it explicit steps, which the fastest waves
would make very short: so accelerations are smoothed over neighbouring nodes. That is a mass matrix
under which waves of two cells are sixteen times as heavy, and long ones and the plate as a whole
as heavy as without (selective mass scaling, as Olovsson, Simonsson & Unosson 2005 do it for finite
elements). What changes slowly, the foam's forces and how far moments have saturated, is asked for
every few steps; between them forces follow their tangents.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force.columns import Columns
from helmet_sim_ros.model.force.foam import MODULUS, RETURNED
from helmet_sim_ros.model.helmet import Shell

REACH = 0.1  # m, half width of the grid: what a helmet crushed by 40 mm touches
#: The plate is without inertia. This mass per area gives it explicit steps; a third of it changes
#: no peak by more than 1 %. [kg/m^2]
MASS = 0.5
#: Weight of either neighbour when accelerations are smoothed along a row or column of the grid.
SMOOTH = 3.0 / 16.0
#: Largest eigenvalue of the smoothed bending stiffness, in D / cell^4, with up to half of the nodes
#: on the anvil in rows, rings, patches or at random. Unsmoothed it is 64. Nodes on the anvil
#: like a chess board have 16.6, which ``SHARE`` has room for.
STIFFEST = 10.5
SHARE = 0.8  # of the largest stable step
#: Vibration of the mass is damped at this rate [1/s], against its speed of the last moments [s].
QUIET, SLOW = 5e3, 3e-4
DAMPING = 0.2  # of the fastest bending mode; the foam damps all slow ones
LIFTED = 1e-6  # m over the anvil, from where a node does not rest on it


class Plate(NamedTuple):
    """The grid of one shell; arrays are (n, n) and belong to nodes unless told otherwise.

    Attributes:
        stiffness: D [N m]; 0: no plate.
        poisson: nu [-].
        strongest: curvature at which an elastic moment would reach the strength [1/m].
        lag: damping over stiffness in bending [s].
        longest: largest stable step [s].
        cell: of the grid [m].
        height, speed: over the tangent plane [m], [m/s]; state.
        slow: speed of the last moments [m/s]; state.
        anvil: height of what lies below [m]; state.
        pressed, steepness: force of the foam [N] at height 0 along its tangent, and the tangent
            [N/m]; state.
        lagging: height and the damping's share of the speed over the cell's area [1/m]; working
            memory.
        bent: curvatures, then moments over D, xx, yy and xy with a border of 0,
            (3, n + 2, n + 2) [1/m]; working memory.
        softened: share of the elastic moments that the strength leaves, (3, n, n); state.
        pull, smoothed: force per area against the height [Pa]; working memory.
    """

    stiffness: float
    poisson: float
    strongest: float
    lag: float
    longest: float
    cell: float
    height: FloatArray
    speed: FloatArray
    slow: FloatArray
    anvil: FloatArray
    pressed: FloatArray
    steepness: FloatArray
    lagging: FloatArray
    bent: FloatArray
    softened: FloatArray
    pull: FloatArray
    smoothed: FloatArray


def plate(shell: Shell, columns: Columns) -> Plate:
    """The plate of a shell over a liner's columns."""
    material, cell = shell.material, shell.cell
    stiffness = material.bending_stiffness if len(columns.area) else 0.0
    n = 2 * math.ceil(REACH / cell) + 1 if stiffness > 0.0 else 3
    longest, lag = math.inf, 0.0
    if stiffness > 0.0:
        # Foam that has hardly crushed unloads along its modulus over the share returned.
        foam = columns.foam
        steep = float((foam[:, MODULUS] / foam[:, RETURNED]).max() / columns.thickness.min())
        # A column larger than a cell is borne by few nodes, over which smoothing spreads it.
        crowded = (1.0 - 2.0 * SMOOTH) ** 2 * float(columns.area.max()) / cell**2
        fastest = math.sqrt((STIFFEST * stiffness / cell**4 + max(1.0, crowded) * steep) / MASS)
        lag = 2.0 * DAMPING / fastest
        longest = SHARE * 2.0 / fastest * (math.hypot(1.0, DAMPING) - DAMPING)
    height, speed, slow, anvil, pressed, steepness, lagging = (np.zeros((n, n)) for _ in range(7))
    return Plate(
        stiffness, material.poisson, material.strongest_curvature, lag, longest, cell,
        height, speed, slow, anvil, pressed, steepness, lagging,
        np.zeros((3, n + 2, n + 2)), np.zeros((3, n, n)), np.zeros((n, n)), np.zeros((n, n)),
    )  # fmt: skip


# Loops go over rows, with few arrays and no branches: the compiler does several nodes at a time.


@compiled
def curve(plate: Plate) -> None:
    """Curvatures of the plate, including damping; 0 across the grid's edges."""
    z, w, lagging = plate.height, plate.speed, plate.lagging
    xx, yy, xy = plate.bent[0], plate.bent[1], plate.bent[2]
    lag, n = plate.lag, len(z)
    scale = 1.0 / (plate.cell * plate.cell)
    for i in range(n):
        for j in range(n):
            lagging[i, j] = scale * (z[i, j] + lag * w[i, j])
    for i in range(1, n - 1):
        for j in range(n):
            xx[i + 1, j + 1] = lagging[i - 1, j] - 2.0 * lagging[i, j] + lagging[i + 1, j]
    for i in range(n):
        for j in range(1, n - 1):
            yy[i + 1, j + 1] = lagging[i, j - 1] - 2.0 * lagging[i, j] + lagging[i, j + 1]
        xx[1, i + 1] = xx[n, i + 1] = yy[i + 1, 1] = yy[i + 1, n] = 0.0
    for i in range(n - 1):
        for j in range(n - 1):
            near, far = lagging[i, j] - lagging[i, j + 1], lagging[i + 1, j] - lagging[i + 1, j + 1]
            xy[i + 1, j + 1] = near - far


@compiled
def soften(plate: Plate) -> None:
    """Write which share of the elastic moments the strength leaves at the present curvatures."""
    curve(plate)
    nu, n = plate.poisson, len(plate.height)
    yielding = 1.0 / (plate.strongest * plate.strongest)
    twisting = 2.0 * (1.0 - nu) * yielding
    xx, yy, xy = plate.bent[0], plate.bent[1], plate.bent[2]
    along, across, twisted = plate.softened[0], plate.softened[1], plate.softened[2]
    for i in range(n):
        inside = 1.0 if 0 < i < n - 1 else 0.0
        for j in range(n):
            kx, ky, kz = xx[i + 1, j + 1], yy[i + 1, j + 1], xy[i + 1, j + 1]
            size = (kx * kx + ky * ky + 2.0 * nu * kx * ky) * yielding
            across[i, j] = 1.0 / math.sqrt(1.0 + size)
            along[i, j] = inside * across[i, j]
            twisted[i, j] = 1.0 / math.sqrt(1.0 + kz * kz * twisting)
        across[i, 0] = across[i, n - 1] = 0.0


@compiled
def bend(plate: Plate) -> None:
    """Moments over D."""
    curve(plate)
    nu, n = plate.poisson, len(plate.height)
    xx, yy, xy = plate.bent[0], plate.bent[1], plate.bent[2]
    along, across, twisted = plate.softened[0], plate.softened[1], plate.softened[2]
    for i in range(n):
        for j in range(n):
            kx, ky = xx[i + 1, j + 1], yy[i + 1, j + 1]
            xx[i + 1, j + 1] = along[i, j] * (kx + nu * ky)
            yy[i + 1, j + 1] = across[i, j] * (ky + nu * kx)
    for i in range(n - 1):
        for j in range(n - 1):
            xy[i + 1, j + 1] *= (1.0 - nu) * twisted[i, j]


@compiled
def pull_back(plate: Plate, step: float) -> None:
    """Write the force per area against the height: of bending, of the foam, and of the anvil."""
    bend(plate)
    xx, yy, xy, pull = plate.bent[0], plate.bent[1], plate.bent[2], plate.pull
    z, w, anvil, pressed, steepness = (
        plate.height, plate.speed, plate.anvil, plate.pressed, plate.steepness,
    )  # fmt: skip
    n = len(z)
    loaded = 1.0 / (plate.cell * plate.cell)
    stiff, inertia = plate.stiffness * loaded, MASS / step
    # Transposed stencils: the plate's own forces add up to no force and no moment.
    for i in range(n):
        for j in range(n):
            f = xx[i, j + 1] - 2.0 * xx[i + 1, j + 1] + xx[i + 2, j + 1]
            f += yy[i + 1, j] - 2.0 * yy[i + 1, j + 1] + yy[i + 1, j + 2]
            pull[i, j] = stiff * f
        for j in range(n):
            near, far = xy[i, j] - xy[i + 1, j], xy[i, j + 1] - xy[i + 1, j + 1]
            pull[i, j] += 2.0 * stiff * (near - far)
        for j in range(n):
            pull[i, j] += loaded * max(pressed[i, j] + steepness[i, j] * z[i, j], 0.0)
        for j in range(n):
            # The anvil bears more than what brings a node down to it: neighbours do not feel that.
            most = inertia * ((z[i, j] - anvil[i, j]) / step + w[i, j])
            pull[i, j] = min(pull[i, j], max(most, 0.0))


@compiled
def smooth(plate: Plate) -> None:
    """Smooth the forces along the second axis; sums stay as they are."""
    pull, smoothed = plate.pull, plate.smoothed
    n = len(pull)
    for i in range(n):
        for j in range(1, n - 1):
            sides = pull[i, j - 1] + pull[i, j + 1]
            smoothed[i, j] = (1.0 - 2.0 * SMOOTH) * pull[i, j] + SMOOTH * sides
        smoothed[i, 0] = pull[i, 0] + SMOOTH * (pull[i, 1] - pull[i, 0])
        smoothed[i, n - 1] = pull[i, n - 1] + SMOOTH * (pull[i, n - 2] - pull[i, n - 1])


@compiled
def move(plate: Plate, step: float, most: float) -> None:
    """One step of the plate; no node is faster than ``most`` [m/s]."""
    pull_back(plate, step)
    smooth(plate)
    z, w, slow, anvil, smoothed = plate.height, plate.speed, plate.slow, plate.anvil, plate.smoothed
    n = len(z)
    gained, rate = step / SLOW, step / MASS
    for i in range(n):
        over, under = max(i - 1, 0), min(i + 1, n - 1)
        for j in range(n):
            sides = smoothed[over, j] + smoothed[under, j]
            pull = (1.0 - 2.0 * SMOOTH) * smoothed[i, j] + SMOOTH * sides
            speed = w[i, j] - rate * pull - step * QUIET * (w[i, j] - slow[i, j])
            w[i, j] = min(max(speed, -most), most)
        for j in range(n):
            slow[i, j] += gained * (w[i, j] - slow[i, j])
        for j in range(n):
            height, speed = z[i, j] + step * w[i, j], w[i, j]
            stopped = height < anvil[i, j]
            z[i, j] = anvil[i, j] if stopped else height
            w[i, j] = max(speed, 0.0) if stopped else speed


@compiled
def rests(plate: Plate) -> bool:
    """Whether all that the foam presses lies on the anvil."""
    n = len(plate.height)
    for i in range(n):
        for j in range(n):
            if plate.steepness[i, j] > 0.0 and plate.height[i, j] > plate.anvil[i, j] + LIFTED:
                return False
    return True
