"""The crushing liner of a foam helmet: its columns against whatever the helmet strikes.

What deforms: the liner, column by column, along the surface's normal (EPS hardly spreads sideways
when crushed); each column in shear across it. What is rigid: the surface, and the helmet outside
the crushed cap. What is left out: the shell's bending stiffness and the mass of its struck patch,
and the face opening.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import (
    HELMET,
    Loads,
    Motion,
    count_surface,
    load,
    rigid,
    velocity_at,
    world_point,
)
from helmet_sim_ros.model.force.columns import Columns
from helmet_sim_ros.model.force.foam import (
    MODULUS,
    POISSON,
    SLOWEST,
    loading_stress,
    mean_over_point,
    rate_factor,
    residual_strain,
    unloading_stress,
)
from helmet_sim_ros.model.force.friction import yielding_force
from helmet_sim_ros.model.force.vector import (
    Vec,
    across,
    add,
    cross,
    dot,
    row,
    scaled,
    sub,
    turned,
    turned_back,
    write,
)
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.surface.carrier import farthest, react, remember
from helmet_sim_ros.model.surface.compiled import HALF_SPACE, Surface
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import nearest, signed_distance

MARGIN = 0.004  # m, of the list of columns near the surface; any value gives the same forces
REACH = 0.4  # m, no column is farther from the origin of the helmet frame
#: Largest share of a cell's radius by which a curved surface may lie behind its middle: an edge
#: sharper than the cell has no mean sagitta.
SAGITTA = 0.25


class Near(NamedTuple):
    """The list of columns that may touch the surface; state.

    Attributes:
        listed: indices of columns, their number in the last place, (n + 1,).
        distance: of every column from the surface when they were listed, (n,) [m].
        position, rotation: of the helmet when they were listed, (3,) [m], (9,).
    """

    listed: NDArray[np.int64]
    distance: FloatArray
    position: FloatArray
    rotation: FloatArray


class CrushingLiner(NamedTuple):
    """The liner of one helmet in one impact; row i belongs to column i.

    Attributes:
        columns: constants.
        helmet: MuJoCo's index of the helmet body.
        center, semi_axes: of the shell's ellipsoid, helmet frame [m].
        measured: whether the columns are a measured surface, not that of the ellipsoid.
        direction: to the deepest point of the shell on each shape, (shapes, 3); state, from which
            the next search starts.
        largest: largest strain so far, (n,); state.
        rest: the residual strain that belongs to it, below 0: not yet known, (n,); state.
        stick: elastic shear deflection (3), world axes, and plastic path, (n, 4) [m]; state.
        rate: fastest strain rate of the present contact [1/s], 0: none, and the factor that it
            puts on the stress, (n, 2); state.
        near: which columns may touch; state.
    """

    columns: Columns
    helmet: int
    center: Vec
    semi_axes: Vec
    measured: bool
    direction: FloatArray
    largest: FloatArray
    rest: FloatArray
    stick: FloatArray
    rate: FloatArray
    near: Near


def crushing_liner(
    columns: Columns, config: Helmet, helmet: int, shapes: int, largest: FloatArray
) -> CrushingLiner:
    """A liner whose columns have seen the given strains, (n,), against that many shapes."""
    shell, measured = config.shell, config.geometry is not None
    n = len(columns.area)
    near = Near(
        np.zeros(n + 1, dtype=np.int64), np.zeros(n), np.full(3, np.inf), np.full(9, np.inf)
    )
    return CrushingLiner(
        columns, helmet, shell.center, shell.semi_axes, measured, np.zeros((shapes, 3)), largest,
        np.full(n, -1.0), np.zeros((n, 4)), np.zeros((n, 2)), near,
    )  # fmt: skip


@inlined
def is_flat(surface: Surface) -> bool:
    """Whether the surface is one plane at rest."""
    return len(surface.kind) == 1 and surface.kind[0] == HALF_SPACE and len(surface.carrier) == 0


@compiled
def moved(near: Near, surface: Surface, position: FloatArray, rotation: FloatArray) -> float:
    """Bound of how much closer to the surface any column has come since the listing [m]."""
    if is_flat(surface):  # only along its normal
        axes = surface.rotation[0]
        normal = (axes[2], axes[5], axes[8])
        turn, travel = 0.0, 0.0
        for k in range(3):
            travel += normal[k] * (position[k] - near.position[k])
            change = 0.0
            for j in range(3):
                change += normal[j] * (rotation[3 * j + k] - near.rotation[3 * j + k])
            turn += change * change
        return float(abs(travel) + turn**0.5 * REACH)
    turn, travel = 0.0, 0.0
    for k in range(3):
        travel += (position[k] - near.position[k]) ** 2
    for k in range(9):
        turn += (rotation[k] - near.rotation[k]) ** 2
    # The spectral norm of a difference of rotations is its Frobenius norm over sqrt(2).
    return float(travel**0.5 + (0.5 * turn) ** 0.5 * REACH) + farthest(surface)


@compiled
def find_near(liner: CrushingLiner, surface: Surface, motion: Motion) -> None:
    """List the columns that touch the surface or may before the helmet has moved by ``MARGIN``."""
    near, points, radii = liner.near, liner.columns.point, liner.columns.radius
    position, rotation = motion.position[liner.helmet], motion.rotation[liner.helmet]
    # An infinite entry (nothing listed yet) gives infinity or nan: neither is below the margin.
    if moved(near, surface, position, rotation) < MARGIN:
        return
    write(near.position, position)
    write(near.rotation, rotation)
    remember(surface)
    helmet = rigid(motion, liner.helmet)
    listed, distances = near.listed, near.distance
    distances[:] = np.inf
    for k in range(len(surface.kind)):
        if surface.kind[k] == HALF_SPACE:  # its height is linear in the helmet's own axes
            normal = (surface.rotation[k, 2], surface.rotation[k, 5], surface.rotation[k, 8])
            height = dot(normal, sub(helmet.position, row(surface.position, k)))
            nx, ny, nz = turned_back(helmet.rotation, normal)
            for i in range(len(radii)):
                above = height + nx * points[i, 0] + ny * points[i, 1] + nz * points[i, 2]
                distances[i] = min(distances[i], above)
            continue
        for i in range(len(radii)):
            x, y, z = world_point(helmet, row(points, i))
            distances[i] = min(distances[i], signed_distance(surface, k, x, y, z)[0])
    count = 0
    for i in range(len(radii)):
        if distances[i] <= radii[i] + MARGIN:
            listed[count] = i
            count += 1
        else:
            release(liner, i)
    listed[-1] = count


@inlined
def release(liner: CrushingLiner, i: int) -> None:
    """A column touches nothing any more."""
    stick, rate = liner.stick, liner.rate
    stick[i, 0] = stick[i, 1] = stick[i, 2] = stick[i, 3] = rate[i, 0] = 0.0


@inlined
def quickened(liner: CrushingLiner, i: int, rate: float) -> float:
    """Factor that a column's strain rate [1/s], now and since it touched, puts on its stress."""
    if rate > liner.rate[i, 0] or liner.rate[i, 0] == 0.0:
        liner.rate[i, 0] = max(rate, SLOWEST)
        liner.rate[i, 1] = rate_factor(rate, liner.columns.foam[i])
    factor: float = liner.rate[i, 1]
    return factor


@compiled
def apply(
    liner: CrushingLiner, surface: Surface, step: float, motion: Motion, loads: Loads
) -> None:
    """Add the surface's forces on every column.

    Args:
        liner: constants and state; the state is changed in place.
        surface: what the helmet strikes.
        step: time step [s].
        motion, loads: of the bodies.
    """
    find_near(liner, surface, motion)
    points, normals, areas, thicknesses, radii, foams = liner.columns
    listed, largest, rest, sticks = liner.near.listed, liner.largest, liner.rest, liner.stick
    helmet = rigid(motion, liner.helmet)
    flat = is_flat(surface)  # one plane, taken out of its arrays once
    up = (surface.rotation[0, 2], surface.rotation[0, 5], surface.rotation[0, 8])
    base = row(surface.position, 0)
    force, moment, friction = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for n in range(listed[-1]):
        i = listed[n]
        radius, stick = radii[i], sticks[i]
        point = world_point(helmet, row(points, i))
        if flat:
            shape, normal, curvature = 0, up, 0.0
            distance = dot(up, sub(point, base))
        else:
            shape, distance, nx, ny, nz, curvature = nearest(surface, point[0], point[1], point[2])
            normal = (nx, ny, nz)
        cosine = -dot(normal, turned(helmet.rotation, row(normals, i)))
        sagitta = min(0.125 * radius * radius * curvature, SAGITTA * radius)
        share, low, high = part_below(-distance - sagitta, radius, cosine)
        if share == 0.0:
            release(liner, i)
            continue
        thickness, foam = thicknesses[i], foams[i]
        stress = compressed(
            low * cosine / thickness, high * cosine / thickness, foam, i, largest, rest
        )
        if stress <= 0.0:
            release(liner, i)
            continue
        area = areas[i] * share * cosine
        # The crushed shell lies on the surface: velocity of the helmet frame there.
        touch = add(point, scaled(normal, -distance))
        velocity = sub(velocity_at(helmet, touch), row(surface.velocity, shape))
        slip = across(velocity, normal)
        factor = quickened(liner, i, -dot(velocity, normal) * cosine / thickness)
        stress *= factor
        # Crushed cell walls have buckled: they yield in shear along the secant modulus.
        secant = loading_stress(largest[i], foam) / largest[i]
        per_modulus = factor * area / (2.0 * (1.0 + POISSON) * thickness)
        limit = surface.friction[shape] * stress * area
        rubbed = yielding_force(
            foam[MODULUS] * per_modulus,
            secant * per_modulus,
            limit,
            slip,
            normal,
            step,
            motion.ahead,
            stick,
        )
        pushed = add(scaled(normal, stress * area), rubbed)
        react(surface, shape, pushed)
        force, friction = add(force, pushed), add(friction, rubbed)
        moment = add(moment, cross(touch, pushed))
    load(loads, liner.helmet, force, sub(moment, cross(helmet.origin, force)))
    count_surface(loads, HELMET, force, moment, friction)


@inlined
def part_below(depth: float, radius: float, cosine: float) -> tuple[float, float, float]:
    """Share of a cell that is below the surface, and the least and greatest depth [m] there.

    Args:
        depth: of the cell's middle [m].
        radius: of the cell [m].
        cosine: of the angle between cell and surface.
    """
    if cosine <= 0.0:
        return 0.0, 0.0, 0.0
    # A tilted cell spans this height to either side of its centre.
    half = radius * max(0.0, 1.0 - cosine * cosine) ** 0.5
    if depth <= -half:
        return 0.0, 0.0, 0.0
    if depth < half:
        return (depth + half) / (2.0 * half), 0.0, depth + half
    return 1.0, depth - half, depth + half


@inlined
def compressed(
    low: float, high: float, foam: FloatArray, i: int, largest: FloatArray, rest: FloatArray
) -> float:
    """Mean stress [Pa] of a column strained between two values; remembers the largest strain.

    Args:
        low, high: strains.
        foam: constants of the column's foam.
        i: the column.
        largest, rest: see :class:`CrushingLiner`; changed in place.
    """
    strain = 0.5 * (low + high)
    if strain >= largest[i]:
        stress = loading_stress(strain, foam)
        largest[i] = strain
        rest[i] = -1.0
    else:
        if rest[i] < 0.0:
            rest[i] = residual_strain(largest[i], foam)
        stress = unloading_stress(strain, largest[i], rest[i], foam)
    if stress <= 0.0:
        return 0.0
    return stress * mean_over_point(low, high, foam)


@compiled
def press(
    columns: Columns, axis: FloatArray, depth: float, largest: FloatArray, rest: FloatArray
) -> float:
    """Force [N] of a plane pressed flat into the liner, at the rate of the foams' constants.

    Args:
        columns: of the helmet.
        axis: outward normal of the helmet where it is pressed, helmet frame, (3,).
        depth: of the plane behind the outermost column [m].
        largest, rest: strains of the columns, see :class:`CrushingLiner`; changed in place.
    """
    normal = (axis[0], axis[1], axis[2])
    outermost, force = -np.inf, 0.0
    for i in range(len(columns.area)):
        outermost = max(outermost, dot(normal, row(columns.point, i)))
    for i in range(len(columns.area)):
        below = dot(normal, row(columns.point, i)) - outermost + depth
        cosine = dot(normal, row(columns.normal, i))
        share, low, high = part_below(below, columns.radius[i], cosine)
        if share > 0.0:
            to_strain = cosine / columns.thickness[i]
            stress = compressed(
                low * to_strain, high * to_strain, columns.foam[i], i, largest, rest
            )
            force += stress * columns.area[i] * share * cosine
    return force


@compiled
def crush(liner: CrushingLiner, surface: Surface, motion: Motion, deepest: FloatArray) -> None:
    """How deep the undeformed shell would reach into the surface.

    Args:
        deepest: the depth [m], 0 without contact, times the outward normal, (3,); written.
    """
    most = 0.0
    deepest[:] = 0.0
    if liner.measured:
        deepest_column(liner, surface, motion, deepest)
        return
    center = world_point(rigid(motion, liner.helmet), liner.center)
    for k in range(len(surface.kind)):
        depth, _, (nx, ny, nz) = deepest_point(
            surface, k, center, motion.rotation[liner.helmet], liner.semi_axes, liner.direction[k]
        )
        if depth > most:
            most = depth
            deepest[0], deepest[1], deepest[2] = depth * nx, depth * ny, depth * nz


@compiled
def deepest_column(
    liner: CrushingLiner, surface: Surface, motion: Motion, deepest: FloatArray
) -> None:
    """:func:`crush` of a measured surface: how deep its lowest column reaches."""
    helmet = rigid(motion, liner.helmet)
    points, normals, radii = liner.columns.point, liner.columns.normal, liner.columns.radius
    listed = liner.near.listed
    most = 0.0
    for n in range(listed[-1]):
        i = listed[n]
        x, y, z = world_point(helmet, row(points, i))
        _, distance, nx, ny, nz, _ = nearest(surface, x, y, z)
        cosine = -dot((nx, ny, nz), turned(helmet.rotation, row(normals, i)))
        if cosine <= 0.0:
            continue
        depth = radii[i] * max(0.0, 1.0 - cosine * cosine) ** 0.5 - distance
        if depth > most:
            most = depth
            deepest[0], deepest[1], deepest[2] = depth * nx, depth * ny, depth * nz
