"""The foam helmet: columns of liner over an ellipsoidal shell, crushed by the flat ground.

What deforms: the liner, column by column, along the ground's normal (EPS hardly spreads sideways
when crushed), between the flat ground and the head; each column in shear along the ground. What is
rigid: head, ground, and the helmet outside the crushed cap, which moves with the head. What is
left out: the shell's bending stiffness and the mass of its struck patch, the comfort padding, the
sliding of the head in the liner, and the face opening.

A column is a cell of the outer surface with its outward normal n, area and liner thickness t. At
an angle a to the ground's normal a crush depth d strains it by d cos(a) / t over the projected
area. Within a cell the stress is averaged over the span of depths that its tilt gives it, and a
cell that straddles the ground plane counts with the share of its area below it: so a few hundred
cells converge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.contact import RELAXATION, friction_force
from helmet_sim_ros.model.foam import (
    MODULUS,
    foam_rows,
    loading_stress,
    mean_over_point,
    residual_strain,
    unloading_stress,
)
from helmet_sim_ros.model.helmet import Helmet, Liner, Shell
from helmet_sim_ros.model.tree import WORLD_ORIGIN, add_force

POISSON = 0.1  # EPS (general literature value): G = E / (2 (1 + nu))

MARGIN = 0.004  # m, of the list of columns near the ground; any value gives the same forces
REACH = 0.4  # m, no column is farther from the origin of the helmet frame

#: Columns of a column's row: outer point (3) [m] and outward normal (3) in the helmet frame, area
#: [m^2], thickness [m], radius of the cell [m].
POINT, NORMAL, AREA, THICKNESS, RADIUS = 0, 3, 6, 7, 8


@dataclass(frozen=True)
class Columns:
    """The columns of one helmet, shared by its impacts; row i belongs to column i.

    Attributes:
        geometry: (n, 9), see above.
        foam: constants of each column's foam, (n, 5); see :mod:`helmet_sim_ros.model.foam`.
        padding: between head and liner: friction [-], shear stiffness [N/m], relaxation [s],
            radius [m]; (4,).
    """

    geometry: FloatArray
    foam: FloatArray
    padding: FloatArray

    def __len__(self) -> int:
        return len(self.geometry)


def no_columns() -> Columns:
    """What a spring helmet has."""
    return Columns(np.zeros((0, 9)), np.zeros((0, 5)), np.zeros(4))


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
    geometry = np.column_stack(
        [point + np.array(helmet.shell.center), normal, area, thickness, radius]
    )
    foam = foam_rows(density, liner.energy_returned)
    inner = axes.mean() - thickness.mean()
    padding = np.array(
        [liner.head_friction, liner.padding_stiffness, liner.padding_relaxation, inner]
    )
    return Columns(geometry, foam, padding)


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


def crush_depth(shell: Shell, position: FloatArray, rotation: FloatArray) -> FloatArray:
    """How deep the undeformed shell would reach into the ground, shape (n,) [m].

    Args:
        position: of the helmet frame, (n, 3) [m].
        rotation: helmet to world, (n, 3, 3).
    """
    vertical = rotation[:, 2]
    lowest = position[:, 2] + vertical @ np.array(shell.center)
    lowest -= np.linalg.norm(vertical * np.array(shell.semi_axes), axis=1)
    depth: FloatArray = np.maximum(-lowest, 0.0)
    return depth


def nothing_near(count: int) -> tuple[NDArray[np.int64], FloatArray]:
    """State of :func:`find_near` before the first step, of that many columns."""
    return np.zeros(count + 1, dtype=np.int64), np.full(4, np.inf)


@njit(cache=True, nogil=True)
def find_near(
    geometry: FloatArray,
    position: FloatArray,
    rotation: FloatArray,
    near: NDArray[np.int64],
    seen: FloatArray,
    stick: FloatArray,
) -> None:
    """List the columns that touch the ground or may before the helmet has moved by ``MARGIN``.

    Args:
        geometry: see :class:`Columns`.
        position, rotation: of the helmet body: xpos (3,), xmat (9,).
        near: indices of columns, their number in the last place, (n + 1,); changed in place.
        seen: height and vertical axis of the helmet when they were listed, (4,); changed in place.
        stick: of columns that are not near, set to 0.
    """
    turned = 0.0
    for k in range(3):
        turned += (rotation[6 + k] - seen[1 + k]) ** 2
    # No point of the helmet has come closer to the ground by more than this.
    if abs(position[2] - seen[0]) + turned**0.5 * REACH < MARGIN:
        return
    seen[0] = position[2]
    seen[1:] = rotation[6:9]
    count = 0
    for i in range(len(geometry)):
        g = geometry[i]
        height = position[2] + rotation[6] * g[0] + rotation[7] * g[1] + rotation[8] * g[2]
        if height <= g[RADIUS] + MARGIN:
            near[count] = i
            count += 1
        else:
            stick[i] = 0.0
    near[-1] = count


@njit(cache=True, nogil=True)
def crush(
    geometry: FloatArray,
    foam: FloatArray,
    friction: float,
    step: float,
    near: NDArray[np.int64],
    seen: FloatArray,
    largest: FloatArray,
    rest: FloatArray,
    stick: FloatArray,
    position: FloatArray,
    rotation: FloatArray,
    velocity: FloatArray,
    origin: FloatArray,
    applied: FloatArray,
    wrench: FloatArray,
) -> None:
    """Add the ground's forces on every column.

    Args:
        geometry, foam: see :class:`Columns`.
        friction: of shell on ground [-].
        step: time step [s].
        near, seen: columns that can be in contact now, see :func:`find_near`; changed in place.
        largest, rest: largest strain of each column so far and its residual strain (below 0: not
            yet known), (n,); changed in place.
        stick: shear deflection of each column along world x and y, (n, 2) [m]; changed in place.
        position, rotation, velocity: of the helmet body: xpos (3,), xmat (9,), cvel (6,).
        origin: point to which ``velocity`` refers [m].
        applied: force on the body and its moment about that point, (6,); added to.
        wrench: force [N] and moment about the world origin [N m], (6,); added to.
    """
    m = rotation
    find_near(geometry, position, rotation, near, seen, stick)
    for n in range(near[-1]):
        i = near[n]
        g = geometry[i]
        depth = -(position[2] + m[6] * g[0] + m[7] * g[1] + m[8] * g[2])
        if depth < -g[RADIUS]:
            stick[i] = 0.0
            continue
        cosine = -(m[6] * g[3] + m[7] * g[4] + m[8] * g[5])
        if cosine <= 0.0:
            continue
        # A tilted cell spans this height to either side of its centre.
        half = g[RADIUS] * max(0.0, 1.0 - cosine * cosine) ** 0.5
        if depth <= -half:
            stick[i] = 0.0
            continue
        share, low, high = 1.0, depth - half, depth + half
        if low < 0.0:
            share, low = high / (2.0 * half), 0.0
        to_strain = cosine / g[THICKNESS]
        strain = 0.5 * (low + high) * to_strain  # mean of the part below the plane
        if strain >= largest[i]:
            stress = loading_stress(strain, foam[i])
            largest[i] = strain
            rest[i] = -1.0
        else:
            if rest[i] < 0.0:
                rest[i] = residual_strain(largest[i], foam[i])
            stress = unloading_stress(strain, largest[i], rest[i], foam[i])
        if stress <= 0.0:
            stick[i] = 0.0
            continue
        stress *= mean_over_point(low * to_strain, high * to_strain, foam[i])
        fz = stress * g[AREA] * share * cosine
        px = position[0] + m[0] * g[0] + m[1] * g[1] + m[2] * g[2]
        py = position[1] + m[3] * g[0] + m[4] * g[1] + m[5] * g[2]
        # The crushed shell lies on the ground: velocity of the helmet frame there.
        rx, ry, rz = px - origin[0], py - origin[1], -origin[2]
        vx = velocity[3] + velocity[1] * rz - velocity[2] * ry
        vy = velocity[4] + velocity[2] * rx - velocity[0] * rz
        shear = foam[i, MODULUS] / (2.0 * (1.0 + POISSON)) * g[AREA] * share * cosine / g[THICKNESS]
        fx, fy = friction_force(shear, RELAXATION, friction * fz, vx, vy, step, stick[i])
        add_force(applied, origin, px, py, 0.0, fx, fy, fz)
        add_force(wrench, WORLD_ORIGIN, px, py, 0.0, fx, fy, fz)


@njit(cache=True, nogil=True)
def head_friction(
    friction: float,
    stiffness: float,
    relaxation: float,
    radius: float,
    load: float,
    step: float,
    stick: FloatArray,
    center: FloatArray,
    helmet_velocity: FloatArray,
    head_velocity: FloatArray,
    origin: FloatArray,
    applied_helmet: FloatArray,
    applied_head: FloatArray,
) -> None:
    """Friction between head and liner where the load passes from one to the other.

    Args:
        friction: of head in liner [-].
        stiffness: shear stiffness of padding and scalp [N/m].
        relaxation: of padding and scalp [s].
        radius: of the liner's inner surface [m].
        load: normal force of the ground [N].
        step: time step [s].
        stick: shear deflection along world x and y, (2,) [m]; changed in place.
        center: about which the helmet turns on the head, world axes [m].
        helmet_velocity, head_velocity: cvel rows, (6,).
        origin: point about which moments are taken [m].
        applied_helmet, applied_head: force and moment on the bodies, (6,); added to.
    """
    # The contact lies below the centre; only the difference of the spins slides there.
    vx = -(helmet_velocity[1] - head_velocity[1]) * radius
    vy = (helmet_velocity[0] - head_velocity[0]) * radius
    fx, fy = friction_force(stiffness, relaxation, friction * load, vx, vy, step, stick)
    z = center[2] - radius
    add_force(applied_helmet, origin, center[0], center[1], z, fx, fy, 0.0)
    add_force(applied_head, origin, center[0], center[1], z, -fx, -fy, 0.0)
