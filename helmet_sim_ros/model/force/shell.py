"""The shell as a plate between anvil and liner: neighbouring columns carry together.

A thin plate (Kirchhoff) with natural state flat lies between the struck surface and the foam. The
surface pushes it from below and cannot pull, the foam columns push it from above with their own
law. Its bending carries load to columns that the surface does not reach. What follows:

- without bending stiffness it lies on the surface: the columns as they are without a shell;
- rigid, it stays a plane: the load of flat ground on every surface;
- on flat ground it lies flat and does nothing: what flattening a curved shell costs is not
  modelled (Mills & Gilchrist 1992: fibre shells hardly deform on flat ground).

Its grid (:mod:`.plate`) lies in the tangent plane of the first contact, at rest in the world, and
follows the helmet by whole cells. The force on the helmet is the foam's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import allocating, compiled, inlined
from helmet_sim_ros.model.force.bodies import (
    HELMET,
    Loads,
    Motion,
    Rigid,
    count_surface,
    load,
    rigid,
    velocity_at,
    world_point,
)
from helmet_sim_ros.model.force.foam import POISSON, loading_stress
from helmet_sim_ros.model.force.friction import RELAXATION, friction_force
from helmet_sim_ros.model.force.liner import (
    CrushingLiner,
    compressed,
    find_near,
    is_flat,
    part_below,
    quickened,
    release,
)
from helmet_sim_ros.model.force.plate import Plate, move, plate, rests, soften
from helmet_sim_ros.model.force.vector import (
    across,
    add,
    cross,
    dot,
    norm,
    row,
    row3,
    scaled,
    sub,
    turned,
)
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
SLACK = 1.5  # cells that the helmet may move before the grid follows
HOLD = 12.5e-6  # s, longest time for which foam follows its tangent and moments their secant
#: How much faster than any point of the helmet a node of the plate may be: what has no inertia of
#: its own follows, and is not flung. Choice.
FLING = 1.5
#: Least cosine between a plate that has let go and the surface where the helmet meets it next:
#: below it is laid anew. Choice.
TURNED = 0.9

#: What is kept of each column: cell of the grid that it is over, and its place there from 0 to 1;
#: height over the tangent plane [m], cosine of its normal to the plane's, rate of the height [m/s],
#: and the force that it has now [N].
CELL_U, CELL_V, ACROSS, ALONG, HEIGHT, COSINE, RATE, PUSHED = range(8)

AWAY, RESTS, MOVES = range(3)  # of a shell: not in place; flat, and still; bent


class Shell(NamedTuple):
    """The shell of one helmet in one impact.

    Attributes:
        grid: the plate.
        engaged: ``AWAY``, ``RESTS`` or ``MOVES``; (1,), state.
        plane: the tangent plane as a surface; state.
        frame: origin (3) [m], and unit vectors x, y and outward normal; (12,), state.
        next: the same of where the helmet is deepest now; (12,), working memory.
        friction: of what lies below each node, (n, n); state.
        columns: of each column, see ``CELL_U`` to ``PUSHED``; (columns, 8).
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
def spreads(shell: Shell, surface: Surface) -> bool:
    """Whether the plate changes anything: it bends, and the surface is not one plane.

    On what moves or gives way it is left out: its grid rests in the world.
    """
    return shell.grid.stiffness > 0.0 and not is_flat(surface) and len(surface.carrier) == 0


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
def survey(shell: Shell, surface: Surface, i: int, j: int) -> None:
    """Find what lies below one node."""
    f, grid, cell = shell.frame, shell.grid, shell.grid.cell
    middle = (len(grid.height) - 1) // 2
    u, v = (i - middle) * cell, (j - middle) * cell
    way, which = below(
        surface,
        f[0] + u * f[3] + v * f[6] + ABOVE * f[9],
        f[1] + u * f[4] + v * f[7] + ABOVE * f[10],
        f[2] + u * f[5] + v * f[8] + ABOVE * f[11],
        f[9], f[10], f[11],
    )  # fmt: skip
    grid.anvil[i, j] = ABOVE - way if way <= ABOVE + BELOW else NOTHING
    shell.friction[i, j] = surface.friction[which]


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
    grid = shell.grid
    grid.height[:] = 0.0
    grid.speed[:] = 0.0
    grid.slow[:] = 0.0
    n = len(grid.height)
    for i in range(n):
        for j in range(n):
            survey(shell, surface, i, j)
    return True


@compiled
def turned_away(shell: Shell, liner: CrushingLiner, surface: Surface, motion: Motion) -> bool:
    """Whether the helmet meets the surface where that is turned from the plate: another shape, or
    the side of this one."""
    if not closest(liner, surface, motion, 0.0, shell.next):
        return False
    return dot(row3(shell.next, 9), row3(shell.frame, 9)) < TURNED


@allocating
def follow(shell: Shell, liner: CrushingLiner, surface: Surface, motion: Motion) -> None:
    """Move the grid by whole cells so that the lowest point of the helmet stays near its middle."""
    helmet = rigid(motion, liner.helmet)
    f, grid, cell = shell.frame, shell.grid, shell.grid.cell
    r = helmet.rotation
    d = (
        -(r[0] * f[9] + r[3] * f[10] + r[6] * f[11]),
        -(r[1] * f[9] + r[4] * f[10] + r[7] * f[11]),
        -(r[2] * f[9] + r[5] * f[10] + r[8] * f[11]),
    )  # fmt: skip
    a = liner.semi_axes
    scale = 1.0 / ((a[0] * d[0]) ** 2 + (a[1] * d[1]) ** 2 + (a[2] * d[2]) ** 2) ** 0.5
    c = liner.center
    lowest = world_point(helmet, (
        c[0] + a[0] * a[0] * d[0] * scale, c[1] + a[1] * a[1] * d[1] * scale,
        c[2] + a[2] * a[2] * d[2] * scale,
    ))  # fmt: skip
    off = sub(lowest, (f[0], f[1], f[2]))
    du, dv = dot(off, (f[3], f[4], f[5])), dot(off, (f[6], f[7], f[8]))
    if abs(du) <= SLACK * cell and abs(dv) <= SLACK * cell:
        return
    si, sj = round(du / cell), round(dv / cell)
    for k in range(3):
        f[k] += cell * (si * f[3 + k] + sj * f[6 + k])
    n = len(grid.height)
    height, speed = grid.height.copy(), grid.speed.copy()
    slow = grid.slow.copy()
    anvil, friction = grid.anvil.copy(), shell.friction.copy()
    for i in range(n):
        for j in range(n):
            oi, oj = i + si, j + sj
            if 0 <= oi < n and 0 <= oj < n:
                grid.height[i, j], grid.speed[i, j] = height[oi, oj], speed[oi, oj]
                grid.slow[i, j] = slow[oi, oj]
                grid.anvil[i, j], shell.friction[i, j] = anvil[oi, oj], friction[oi, oj]
            else:
                survey(shell, surface, i, j)
                ni, nj = min(max(oi, 0), n - 1), min(max(oj, 0), n - 1)
                grid.height[i, j] = max(height[ni, nj], grid.anvil[i, j])
                grid.speed[i, j] = speed[ni, nj]
                grid.slow[i, j] = slow[ni, nj]


@compiled
def on_plate(grid: Plate, u: float, v: float) -> tuple[int, int, float, float]:
    """Cell that holds a point of the plane, and the point's place in it from 0 to 1. Beyond the
    grid the plate goes on as at its edge."""
    n, middle = len(grid.height), (len(grid.height) - 1) // 2
    x = min(max(u / grid.cell + middle, 0.0), n - 1.0)
    y = min(max(v / grid.cell + middle, 0.0), n - 1.0)
    i, j = min(math.floor(x), n - 2), min(math.floor(y), n - 2)
    return i, j, x - i, y - j


@compiled
def press(shell: Shell, liner: CrushingLiner, early: float) -> None:
    """Forces of the foam on the plate, and tangents, ``early`` seconds before the step ends."""
    _, _, areas, thicknesses, radii, foams = liner.columns
    grid, active, state = shell.grid, shell.active, shell.columns
    z, pressed, steepness = grid.height, grid.pressed, grid.steepness
    largest, rest = liner.largest, liner.rest
    pressed[:] = 0.0
    steepness[:] = 0.0
    for n in range(active[-1]):
        c = active[n]
        height, cosine, rate = state[c, HEIGHT], state[c, COSINE], state[c, RATE]
        state[c, PUSHED] = 0.0
        i, j, a, b = int(state[c, CELL_U]), int(state[c, CELL_V]), state[c, ACROSS], state[c, ALONG]
        q, r, s, t = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
        surface = q * z[i, j] + r * z[i + 1, j] + s * z[i, j + 1] + t * z[i + 1, j + 1]
        depth = surface - (height - rate * early)
        share, low, high = part_below(depth, radii[c], cosine)
        if share == 0.0:
            continue
        over = cosine / thicknesses[c]
        stress = compressed(low * over, high * over, foams[c], c, largest, rest)
        if stress <= 0.0:
            continue
        # The plate follows without inertia: the helmet's speed is what compresses.
        stress *= quickened(liner, c, -rate * over)
        force = stress * areas[c] * share * cosine
        state[c, PUSHED] = force
        # Of the line to where it has no force: its tangent as it unloads and before it yields.
        strain = 0.5 * (low + high) * over
        slope = force * over / (strain - (rest[c] if strain < largest[c] else 0.0))
        load_node(grid, i, j, q, force, slope)
        load_node(grid, i + 1, j, r, force, slope)
        load_node(grid, i, j + 1, s, force, slope)
        load_node(grid, i + 1, j + 1, t, force, slope)


@inlined
def load_node(grid: Plate, i: int, j: int, share: float, force: float, slope: float) -> None:
    """Add a share of a force [N] and of its slope [N/m] to a node."""
    grid.pressed[i, j] += share * (force - slope * grid.height[i, j])
    grid.steepness[i, j] += share * slope


@compiled
def place(shell: Shell, liner: CrushingLiner, helmet: Rigid, step: float, fastest: float) -> None:
    """Where every near column is over the plate, and which may touch it within ``step`` seconds
    before, if no node is faster than ``fastest`` [m/s].

    A column meets the plate from above: one that did not bear and is found deeper than it can have
    come since, as where an anvil slips under the rim or enters from the side, does not touch.
    """
    points, normals, radii = liner.columns.point, liner.columns.normal, liner.columns.radius
    thicknesses = liner.columns.thickness
    listed, state, f, z = liner.near.listed, shell.columns, shell.frame, shell.grid.height
    origin, ex, ey, up = row3(f, 0), row3(f, 3), row3(f, 6), row3(f, 9)
    count = 0
    for n in range(listed[-1]):
        c = listed[n]
        bore = state[c, PUSHED] > 0.0
        state[c, PUSHED] = 0.0
        cosine = -dot(up, turned(helmet.rotation, row(normals, c)))
        if cosine <= 0.0:
            continue
        point = world_point(helmet, row(points, c))
        off = sub(point, origin)
        i, j, a, b = on_plate(shell.grid, dot(off, ex), dot(off, ey))
        height, rate = dot(off, up), dot(velocity_at(helmet, point), up)
        highest = max(max(z[i, j], z[i + 1, j]), max(z[i, j + 1], z[i + 1, j + 1]))
        half = radii[c] * max(0.0, 1.0 - cosine * cosine) ** 0.5
        way = half + (abs(rate) + fastest) * step
        # What was crushed before does not bear again until the foam's rest is reached.
        if (highest - height + way) * cosine <= max(0.0, liner.rest[c]) * thicknesses[c]:
            continue
        surface = (1.0 - b) * ((1.0 - a) * z[i, j] + a * z[i + 1, j])
        surface += b * ((1.0 - a) * z[i, j + 1] + a * z[i + 1, j + 1])
        sunk = surface - height - way - fastest * step  # the last: as it slides along a slope
        if not bore and sunk * cosine > max(0.0, liner.rest[c]) * thicknesses[c]:
            continue
        state[c, CELL_U], state[c, CELL_V], state[c, ACROSS], state[c, ALONG] = i, j, a, b
        state[c, HEIGHT], state[c, COSINE], state[c, RATE] = height, cosine, rate
        shell.active[count] = c
        count += 1
    shell.active[-1] = count


@compiled
def levered(shell: Shell, liner: CrushingLiner) -> bool:
    """Whether the plate, tipped over the anvil, has risen under a column by more than its foam is
    thick: it is then no longer what lies between that column and the surface."""
    z, anvil, state = shell.grid.height, shell.grid.anvil, shell.columns
    for n in range(shell.active[-1]):
        c = shell.active[n]
        i, j = int(state[c, CELL_U]), int(state[c, CELL_V])
        if z[i, j] > max(anvil[i, j], 0.0) + liner.columns.thickness[c]:
            return True
    return False


@compiled
def settle(shell: Shell, liner: CrushingLiner, step: float, fastest: float) -> None:
    """Step the plate to the present; no node is faster than ``fastest`` [m/s].

    While all that presses it lies on the anvil it stays as it was laid.
    """
    if shell.engaged[0] == RESTS:
        press(shell, liner, 0.0)
        if rests(shell.grid):
            return
        shell.engaged[0] = MOVES
    blocks = math.ceil(step / HOLD)
    block = step / blocks
    count = math.ceil(block / shell.grid.longest)
    for k in range(blocks):
        press(shell, liner, step - (k + 0.5) * block)
        soften(shell.grid)
        for _ in range(count):
            move(shell.grid, block / count, fastest)
    press(shell, liner, 0.0)


@compiled
def apply(
    shell: Shell, liner: CrushingLiner, surface: Surface, step: float, motion: Motion, loads: Loads
) -> None:
    """Step the plate to the present and add the foam's forces to the helmet's load.

    Args:
        shell, liner: constants and state; the state is changed in place.
        surface: what the helmet strikes.
        step: time since the last call [s].
        motion, loads: of the bodies.
    """
    listed, sticks = liner.near.listed, liner.stick
    if shell.engaged[0] == AWAY:
        find_near(liner, surface, motion)
        if listed[-1] == 0 or not engage(shell, liner, surface, motion):
            return
        shell.engaged[0] = RESTS
    find_near(liner, shell.plane, motion)
    if listed[-1] == 0:
        shell.engaged[0] = AWAY
        liner.near.position[:] = np.inf
        return
    follow(shell, liner, surface, motion)
    helmet = rigid(motion, liner.helmet)
    points, foams, largest = liner.columns.point, liner.columns.foam, liner.largest
    state, f = shell.columns, shell.frame
    up = row3(f, 9)
    around = norm(helmet.spin) * max(liner.semi_axes)
    fastest = FLING * (norm(velocity_at(helmet, helmet.position)) + around)
    place(shell, liner, helmet, step, fastest)
    active = shell.active[-1] > 0
    if levered(shell, liner) if active else turned_away(shell, liner, surface, motion):
        shell.engaged[0] = AWAY
        liner.near.position[:] = np.inf
    elif active:  # else it rests: it has let go of all that bent it
        settle(shell, liner, step, fastest)
    total, moment, friction = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for n in range(listed[-1]):
        c = listed[n]
        pushed, stick = state[c, PUSHED], sticks[c]
        if pushed <= 0.0:
            release(liner, c)
            continue
        point = world_point(helmet, row(points, c))
        slip = across(velocity_at(helmet, point), up)
        shear = loading_stress(largest[c], foams[c]) / largest[c] / (2.0 * (1.0 + POISSON))
        shear *= liner.columns.area[c] * state[c, COSINE] / liner.columns.thickness[c]
        shear *= liner.rate[c, 1]
        rubbed = friction_force(
            shear, RELAXATION - motion.ahead,
            shell.friction[int(state[c, CELL_U]), int(state[c, CELL_V])] * pushed,
            slip, up, step, stick,
        )  # fmt: skip
        force = add(scaled(up, pushed), rubbed)
        total, friction = add(total, force), add(friction, rubbed)
        moment = add(moment, cross(point, force))
    load(loads, liner.helmet, total, sub(moment, cross(helmet.origin, total)))
    count_surface(loads, HELMET, total, moment, friction)
