"""The shell as a plate between anvil and liner: neighbouring columns carry together.

A thin plate (Kirchhoff) with natural state flat lies between the struck surface and the foam. The
surface pushes it from below and cannot pull, the foam columns push it from above with their own
law. Its bending carries load to columns that the surface does not reach. What follows:

- without bending stiffness it lies on the surface: the columns as they are without a shell;
- rigid, it stays a plane: the load of flat ground on every surface;
- on flat ground it lies flat and does nothing: what flattening a curved shell costs is not
  modelled (Mills & Gilchrist 1992: fibre shells hardly deform on flat ground).

Its grid (:mod:`.plate`) lies in the tangent plane of the first contact, at rest in the world; the
window that is stepped covers what the foam presses. The force on the helmet is the foam's.
"""

from __future__ import annotations

import math

import numpy as np

from helmet_sim_ros.model.compiled import compiled, inlined
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
from helmet_sim_ros.model.force.laying import (
    ACROSS,
    ALONG,
    AWAY,
    CELL,
    COSINE,
    HEIGHT,
    MOVES,
    PUSHED,
    RATE,
    RESTS,
    RISE,
    Shell,
    cover,
    engage,
    turned_away,
)
from helmet_sim_ros.model.force.liner import (
    CrushingLiner,
    compressed,
    find_near,
    is_flat,
    part_below,
    quickened,
    release,
)
from helmet_sim_ros.model.force.plate import (
    COLUMNS,
    FIRST_COLUMN,
    FIRST_ROW,
    ROWS,
    Plate,
    extent,
    flies,
    free_nodes,
    height_at,
    in_plate,
    move,
    node,
    rests,
    soften,
)
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
from helmet_sim_ros.model.surface.compiled import Surface

HOLD = 12.5e-6  # s, longest time for which foam follows its tangent and moments their secant
#: How much faster than any point of the helmet a node of the plate may be: what has no inertia of
#: its own follows, and is not flung. Choice.
FLING = 1.5


@compiled
def spreads(shell: Shell, surface: Surface) -> bool:
    """Whether the plate changes anything: it bends, and the surface is not one plane.

    On what moves or gives way it is left out: its grid rests in the world.
    """
    return shell.grid.stiffness > 0.0 and not is_flat(surface) and len(surface.carrier) == 0


@compiled
def find_cells(shell: Shell) -> None:
    """Find the cells of the window that active columns are over. Beyond the largest window the
    plate goes on as at its edge."""
    grid, active, state = shell.grid, shell.active, shell.columns
    for n in range(active[-1]):
        c = active[n]
        x, y = state[c, ACROSS], state[c, ALONG]
        i, j, a, b = in_plate(grid, x - grid.window[FIRST_ROW], y - grid.window[FIRST_COLUMN])
        state[c, CELL] = node(grid, i, j)
        state[c, ACROSS], state[c, ALONG] = min(max(a, 0.0), 1.0), min(max(b, 0.0), 1.0)


@compiled
def press(shell: Shell, liner: CrushingLiner, early: float) -> None:
    """Forces of the foam on the plate, and tangents, ``early`` seconds before the step ends."""
    _, _, areas, thicknesses, radii, foams = liner.columns
    grid, active, state = shell.grid, shell.active, shell.columns
    z, stride = grid.height, int(grid.window[COLUMNS]) + 2
    largest, rest = liner.largest, liner.rest
    _, end, _ = extent(grid)
    grid.pressed[:end] = 0.0
    grid.steepness[:end] = 0.0
    for n in range(active[-1]):
        c = active[n]
        height, cosine, rate = state[c, HEIGHT], state[c, COSINE], state[c, RATE]
        state[c, PUSHED] = 0.0
        k, a, b = int(state[c, CELL]), state[c, ACROSS], state[c, ALONG]
        q, r, s, t = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
        surface = q * z[k] + r * z[k + stride] + s * z[k + 1] + t * z[k + stride + 1]
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
        load_node(grid, k, q, force, slope)
        load_node(grid, k + stride, r, force, slope)
        load_node(grid, k + 1, s, force, slope)
        load_node(grid, k + stride + 1, t, force, slope)


@inlined
def load_node(grid: Plate, k: int, share: float, force: float, slope: float) -> None:
    """Add a share of a force [N] and of its slope [N/m] to a node."""
    grid.pressed[k] += share * (force - slope * grid.height[k])
    grid.steepness[k] += share * slope


@compiled
def place(shell: Shell, liner: CrushingLiner, helmet: Rigid, step: float, fastest: float) -> None:
    """Where every near column is over the plate, and which may touch it within ``step`` seconds
    before, if no node is faster than ``fastest`` [m/s].

    A column meets the plate from above: one that did not bear and is found deeper than it can have
    come since, as where an anvil slips under the rim or enters from the side, does not touch.
    """
    points, normals, radii = liner.columns.point, liner.columns.normal, liner.columns.radius
    thicknesses, grid = liner.columns.thickness, shell.grid
    listed, state, f, z = liner.near.listed, shell.columns, shell.frame, grid.height
    origin, ex, ey, up = row3(f, 0), row3(f, 3), row3(f, 6), row3(f, 9)
    stride, laid = int(grid.window[COLUMNS]) + 2, grid.window[ROWS] > 0
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
        x, y = dot(off, ex) / grid.cell, dot(off, ey) / grid.cell
        height, rate = dot(off, up), dot(velocity_at(helmet, point), up)
        surface = highest = 0.0
        if laid:
            u, v = x - grid.window[FIRST_ROW], y - grid.window[FIRST_COLUMN]
            i, j, _, _ = in_plate(grid, u, v)
            k = node(grid, i, j)
            surface = height_at(grid, z, u, v)
            highest = max(max(z[k], z[k + stride]), max(z[k + 1], z[k + stride + 1]), surface)
        half = radii[c] * max(0.0, 1.0 - cosine * cosine) ** 0.5
        way = half + (abs(rate) + fastest) * step
        # What was crushed before does not bear again until the foam's rest is reached.
        if (highest - height + way) * cosine <= max(0.0, liner.rest[c]) * thicknesses[c]:
            continue
        sunk = surface - height - way - fastest * step  # the last: as it slides along a slope
        if not bore and sunk * cosine > max(0.0, liner.rest[c]) * thicknesses[c]:
            continue
        state[c, ACROSS], state[c, ALONG] = x, y
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
        k = int(state[c, CELL])
        if z[k] > max(anvil[k], 0.0) + liner.columns.thickness[c]:
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
        free_nodes(shell.grid)
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
    helmet = rigid(motion, liner.helmet)
    points, foams, largest = liner.columns.point, liner.columns.foam, liner.largest
    state, f = shell.columns, shell.frame
    up = row3(f, 9)
    around = norm(helmet.spin) * max(liner.semi_axes)
    fastest = FLING * (norm(velocity_at(helmet, helmet.position)) + around)
    place(shell, liner, helmet, step, fastest)
    active = shell.active[-1] > 0
    if active:
        cover(shell, surface)
        find_cells(shell)
        lost = levered(shell, liner) or flies(shell.grid, RISE)
    else:
        lost = turned_away(shell, liner, surface, motion)
    if lost:
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
            shell.friction[int(state[c, CELL])] * pushed,
            slip, up, step, stick,
        )  # fmt: skip
        force = add(scaled(up, pushed), rubbed)
        total, friction = add(total, force), add(friction, rubbed)
        moment = add(moment, cross(point, force))
    load(loads, liner.helmet, total, sub(moment, cross(helmet.origin, total)))
    count_surface(loads, HELMET, total, moment, friction)
