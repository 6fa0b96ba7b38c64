"""The shell as a plate between anvil and liner: neighbouring columns carry together.

A thin plate (Kirchhoff) with natural state flat lies between the struck surface and the foam. The
surface pushes it from below and cannot pull, the foam columns push it from above with their own
law. Its bending carries load to columns that the surface does not reach. What follows:

- without bending stiffness it lies on the surface: the columns as they are without a shell;
- rigid, it stays a plane: the load of flat ground on every surface;
- on flat ground it lies flat and does nothing: what flattening a curved shell costs is not
  modelled (Mills & Gilchrist 1992: fibre shells hardly deform on flat ground).

The plate is a square grid in the tangent plane of the first contact, at rest in the world, that
follows the helmet by whole cells. It has no inertia of its own; the small mass that its explicit
steps need is internal, and the force on the helmet is the foam's. Bending moments saturate at the
shell's strength.

Bending energy per area (Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, eq. 47)::

    D/2 (zxx^2 + zyy^2 + 2 nu zxx zyy + 2 (1 - nu) zxy^2),    D = E t^3 / (12 (1 - nu^2))
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import allocating, compiled
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
from helmet_sim_ros.model.force.foam import MODULUS, RETURNED, loading_stress
from helmet_sim_ros.model.force.friction import RELAXATION, friction_force
from helmet_sim_ros.model.force.liner import (
    POISSON,
    CrushingLiner,
    compressed,
    find_near,
    is_flat,
    part_below,
)
from helmet_sim_ros.model.force.vector import (
    Vec,
    across,
    add,
    cross,
    dot,
    norm,
    row,
    scaled,
    sub,
    turned,
)
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.surface.compiled import COLUMNS as SIZES
from helmet_sim_ros.model.surface.compiled import HALF_SPACE, Surface, at_rest
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import nearest, signed_distance, tangent

REACH = 0.1  # m, half width of the grid: what a helmet crushed by 40 mm touches
ABOVE = 0.05  # m over the tangent plane, from where the surface is looked for
BELOW = 0.15  # m, how far down it is looked for
NOTHING = -1.0  # m, height where there is no surface
RISE = 0.01  # m over the tangent plane, below which columns count as near
FOUND = 1e-7  # m
STEPS = 60  # of the search for the surface
SLACK = 1.5  # cells that the helmet may move before the grid follows
SHARE = 0.8  # of the largest stable step
#: The plate is without inertia. This mass per area gives it explicit steps; a third of it changes
#: no peak by more than 1 %. [kg/m^2]
MASS = 0.5
#: Vibration of that mass is damped at this rate [1/s], against its speed of the last moments [s].
QUIET, SLOW = 5e3, 3e-4
DAMPING = 0.2  # of the fastest bending mode; the foam damps all slow ones

#: What is kept of each column: cell of the grid that it is over, and its place there from 0 to 1;
#: height over the tangent plane [m], cosine of its normal to the plane's, rate of the height [m/s],
#: the force that it has now [N], and whether it has met the plate from above.
CELL_U, CELL_V, ACROSS, ALONG, HEIGHT, COSINE, RATE, PUSHED, MET = range(9)
#: How much closer than by its own rate a column may come to the plate between two calls [m/s]: the
#: plate is no faster than what strikes it.
FASTEST = 40.0
#: How much faster than any point of the helmet a node of the plate may be: what has no inertia of
#: its own follows, and is not flung. Choice.
FLING = 1.5


class Plate(NamedTuple):
    """The shell of one helmet in one impact.

    Attributes:
        stiffness: D [N m]; 0: no plate.
        poisson: nu [-].
        strongest: curvature at which an elastic moment would reach the strength [1/m].
        lag: damping over stiffness in bending [s].
        longest: largest stable step [s].
        cell: of the grid [m].
        engaged: 1 while the grid has its place; (1,), state.
        plane: the tangent plane as a surface; state.
        frame: origin (3) [m], and unit vectors x, y and outward normal; (12,), state.
        height, speed: of the plate over the tangent plane, (n, n) [m], [m/s]; state.
        slow: its speed of the last moments, (n, n) [m/s]; state.
        anvil, friction: height of what lies below and its friction, (n, n); state.
        lagging: height and the damping's share of the speed over the cell's area, (n, n) [1/m];
            working memory.
        bent: moments xx, yy and xy over D with a border of 0, (3, n + 2, n + 2); working memory.
        pressed: force of the foam on each node, (n, n) [N]; working memory.
        columns: of each column, see ``CELL_U`` to ``MET``; (columns, 9).
        active: indices of the columns that may touch the plate, their number in the last place.
    """

    stiffness: float
    poisson: float
    strongest: float
    lag: float
    longest: float
    cell: float
    engaged: NDArray[np.int64]
    plane: Surface
    frame: FloatArray
    height: FloatArray
    speed: FloatArray
    slow: FloatArray
    anvil: FloatArray
    friction: FloatArray
    lagging: FloatArray
    bent: FloatArray
    pressed: FloatArray
    columns: FloatArray
    active: NDArray[np.int64]


def plate(helmet: Helmet, liner: CrushingLiner) -> Plate:
    """The plate of a helmet, not yet in place."""
    material, cell = helmet.shell.material, helmet.shell.cell
    stiffness = material.bending_stiffness
    areas, foam = liner.columns.area, liner.columns.foam
    count = len(areas)
    n = 2 * math.ceil(REACH / cell) + 1 if stiffness > 0.0 and count else 3
    longest = math.inf
    lag = 0.0
    if stiffness > 0.0 and count:
        # Foam that has hardly crushed unloads along its modulus over the share returned.
        steep = float((foam[:, MODULUS] / foam[:, RETURNED]).max() / liner.columns.thickness.min())
        crowded = max(1.0, float(areas.max()) / cell**2)
        fastest = math.sqrt((64.0 * stiffness / cell**4 + crowded * steep) / MASS)
        lag = 2.0 * DAMPING / fastest
        longest = SHARE * 2.0 / fastest * (math.hypot(1.0, DAMPING) - DAMPING)
    plane = at_rest(
        np.array([HALF_SPACE]),
        np.zeros((1, 3)),
        np.zeros((1, 9)),
        np.zeros((1, SIZES)),
        np.zeros(1),
    )
    height, speed, slow, anvil, friction, lagging, pressed = (np.zeros((n, n)) for _ in range(7))
    return Plate(
        stiffness if count else 0.0, material.poisson, material.strongest_curvature, lag, longest,
        cell, np.zeros(1, dtype=np.int64), plane, np.zeros(12), height, speed, slow, anvil,
        friction, lagging, np.zeros((3, n + 2, n + 2)), pressed, np.zeros((count, MET + 1)),
        np.zeros(count + 1, dtype=np.int64),
    )  # fmt: skip


@compiled
def spreads(plate: Plate, surface: Surface) -> bool:
    """Whether the plate changes anything: it bends, and the surface is not one plane.

    On what moves or gives way it is left out: its grid rests in the world.
    """
    return plate.stiffness > 0.0 and not is_flat(surface) and len(surface.carrier) == 0


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
def survey(plate: Plate, surface: Surface, i: int, j: int) -> None:
    """Find what lies below one node."""
    f, middle, cell = plate.frame, (len(plate.height) - 1) // 2, plate.cell
    u, v = (i - middle) * cell, (j - middle) * cell
    way, which = below(
        surface,
        f[0] + u * f[3] + v * f[6] + ABOVE * f[9],
        f[1] + u * f[4] + v * f[7] + ABOVE * f[10],
        f[2] + u * f[5] + v * f[8] + ABOVE * f[11],
        f[9], f[10], f[11],
    )  # fmt: skip
    plate.anvil[i, j] = ABOVE - way if way <= ABOVE + BELOW else NOTHING
    plate.friction[i, j] = surface.friction[which]


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
def engage(plate: Plate, liner: CrushingLiner, surface: Surface, motion: Motion) -> bool:
    """Lay the plate into the tangent plane of the deepest contact; False: there is none yet."""
    f = plate.frame
    if liner.measured and not touches(liner, surface, motion):
        return False
    if not closest(liner, surface, motion, -np.inf if liner.measured else 0.0, f):
        return False
    normal = (f[9], f[10], f[11])
    ex, ey, ez = tangent(f[9], f[10], f[11])
    f[3], f[4], f[5] = ex, ey, ez
    f[6], f[7], f[8] = cross(normal, (ex, ey, ez))
    for k in range(3):
        plate.plane.position[0, k] = f[k] + RISE * f[9 + k]
        for j in range(3):
            plate.plane.rotation[0, 3 * k + j] = f[3 + 3 * j + k]
    liner.near.position[:] = np.inf  # the list of near columns is now that of the plane
    plate.height[:] = 0.0
    plate.speed[:] = 0.0
    plate.slow[:] = 0.0
    n = len(plate.height)
    for i in range(n):
        for j in range(n):
            survey(plate, surface, i, j)
    return True


@allocating
def follow(plate: Plate, liner: CrushingLiner, surface: Surface, motion: Motion) -> None:
    """Move the grid by whole cells so that the lowest point of the helmet stays near its middle."""
    helmet = rigid(motion, liner.helmet)
    f, cell = plate.frame, plate.cell
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
    n = len(plate.height)
    height, speed = plate.height.copy(), plate.speed.copy()
    slow = plate.slow.copy()
    anvil, friction = plate.anvil.copy(), plate.friction.copy()
    for i in range(n):
        for j in range(n):
            oi, oj = i + si, j + sj
            if 0 <= oi < n and 0 <= oj < n:
                plate.height[i, j], plate.speed[i, j] = height[oi, oj], speed[oi, oj]
                plate.slow[i, j] = slow[oi, oj]
                plate.anvil[i, j], plate.friction[i, j] = anvil[oi, oj], friction[oi, oj]
            else:
                survey(plate, surface, i, j)
                ni, nj = min(max(oi, 0), n - 1), min(max(oj, 0), n - 1)
                plate.height[i, j] = max(height[ni, nj], plate.anvil[i, j])
                plate.speed[i, j] = speed[ni, nj]
                plate.slow[i, j] = slow[ni, nj]


@compiled
def bend(plate: Plate) -> None:
    """Moments over D from the curvatures of the plate, including damping.

    Loops over rows without branches, which the compiler does eight nodes at a time.
    """
    z, w, bent, lagging = plate.height, plate.speed, plate.bent, plate.lagging
    lag, nu, n = plate.lag, plate.poisson, len(plate.height)
    scale = 1.0 / (plate.cell * plate.cell)
    yielding = 1.0 / (plate.strongest * plate.strongest)
    twisting = 2.0 * (1.0 - nu) * yielding
    xx, yy, xy = bent[0], bent[1], bent[2]
    for i in range(n):
        for j in range(n):
            lagging[i, j] = scale * (z[i, j] + lag * w[i, j])
    for i in range(n):
        # The border of the moments is 0; so is the curvature across the grid's edge.
        over, under = max(i - 1, 0), min(i + 1, n - 1)
        inside = 1.0 if under - over == 2 else 0.0
        for j in range(n):
            kx = lagging[over, j] - 2.0 * lagging[i, j] + lagging[under, j]
            xx[i + 1, j + 1] = inside * kx
        for j in range(1, n - 1):
            yy[i + 1, j + 1] = lagging[i, j - 1] - 2.0 * lagging[i, j] + lagging[i, j + 1]
        yy[i + 1, 1] = yy[i + 1, n] = 0.0
        for j in range(1, n + 1):
            kx, ky = xx[i + 1, j], yy[i + 1, j]
            size = (kx * kx + ky * ky + 2.0 * nu * kx * ky) * yielding
            part = 1.0 / math.sqrt(1.0 + size)
            xx[i + 1, j] = inside * part * (kx + nu * ky)
            yy[i + 1, j] = part * (ky + nu * kx)
        yy[i + 1, 1] = yy[i + 1, n] = 0.0
    for i in range(n - 1):
        for j in range(n - 1):
            kz = lagging[i, j] - lagging[i + 1, j] - lagging[i, j + 1] + lagging[i + 1, j + 1]
            part = 1.0 / math.sqrt(1.0 + kz * kz * twisting)
            xy[i + 1, j + 1] = (1.0 - nu) * kz * part


@compiled
def move(plate: Plate, step: float, most: float) -> None:
    """One step of the plate under the foam's forces in ``plate.pressed``; no node is faster than
    ``most`` [m/s]."""
    z, w, anvil, pressed = plate.height, plate.speed, plate.anvil, plate.pressed
    bend(plate)
    xx, yy, xy, slow = plate.bent[0], plate.bent[1], plate.bent[2], plate.slow
    n = len(z)
    area = plate.cell * plate.cell
    stiff = plate.stiffness / (area * MASS)
    loaded = 1.0 / (area * MASS)
    gained = step / SLOW
    for i in range(n):
        for j in range(n):
            # Transposed stencils: the plate's own forces add up to no force and no moment.
            f = xx[i, j + 1] - 2.0 * xx[i + 1, j + 1] + xx[i + 2, j + 1]
            f += yy[i + 1, j] - 2.0 * yy[i + 1, j + 1] + yy[i + 1, j + 2]
            f += 2.0 * (xy[i, j] - xy[i, j + 1] - xy[i + 1, j] + xy[i + 1, j + 1])
            shaking = w[i, j] - slow[i, j]
            speed = w[i, j] - step * (stiff * f + loaded * pressed[i, j] + QUIET * shaking)
            speed = min(max(speed, -most), most)
            slow[i, j] += gained * (speed - slow[i, j])
            height = z[i, j] + step * speed
            stopped = height < anvil[i, j]
            z[i, j] = anvil[i, j] if stopped else height
            w[i, j] = max(speed, 0.0) if stopped else speed


@compiled
def on_plate(plate: Plate, u: float, v: float) -> tuple[int, int, float, float]:
    """Cell that holds a point of the plane, and the point's place in it from 0 to 1. Beyond the
    grid the plate goes on as at its edge."""
    n, middle = len(plate.height), (len(plate.height) - 1) // 2
    x = min(max(u / plate.cell + middle, 0.0), n - 1.0)
    y = min(max(v / plate.cell + middle, 0.0), n - 1.0)
    i, j = min(math.floor(x), n - 2), min(math.floor(y), n - 2)
    return i, j, x - i, y - j


@compiled
def press(plate: Plate, liner: CrushingLiner, early: float) -> None:
    """Forces of the foam on the plate, ``early`` seconds before the step ends."""
    _, _, areas, thicknesses, radii, foams = liner.columns
    active, state, z, pressed = plate.active, plate.columns, plate.height, plate.pressed
    largest, rest = liner.largest, liner.rest
    pressed[:] = 0.0
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
        force = stress * areas[c] * share * cosine
        state[c, PUSHED] = force
        pressed[i, j] += q * force
        pressed[i + 1, j] += r * force
        pressed[i, j + 1] += s * force
        pressed[i + 1, j + 1] += t * force


@compiled
def place(plate: Plate, liner: CrushingLiner, helmet: Rigid, step: float) -> None:
    """Where every near column is over the plate, and which may touch it within ``step`` seconds
    before.

    A column meets the plate from above: one that is found below it and has not come there, as
    where an anvil has slipped under the rim and what was its back is turned to it, does not touch.
    """
    points, normals, radii = liner.columns.point, liner.columns.normal, liner.columns.radius
    listed, state, f, z = liner.near.listed, plate.columns, plate.frame, plate.height
    origin, ex, ey, up = row3(f, 0), row3(f, 3), row3(f, 6), row3(f, 9)
    count = 0
    for n in range(listed[-1]):
        c = listed[n]
        state[c, PUSHED] = 0.0
        cosine = -dot(up, turned(helmet.rotation, row(normals, c)))
        if cosine <= 0.0:
            state[c, MET] = 0.0
            continue
        point = world_point(helmet, row(points, c))
        off = sub(point, origin)
        i, j, a, b = on_plate(plate, dot(off, ex), dot(off, ey))
        height, rate = dot(off, up), dot(velocity_at(helmet, point), up)
        highest = max(max(z[i, j], z[i + 1, j]), max(z[i, j + 1], z[i + 1, j + 1]))
        way = radii[c] + (abs(rate) + FASTEST) * step
        if height - highest > way:
            state[c, MET] = 1.0
            continue
        if state[c, MET] == 0.0 and highest - height > way:
            continue
        state[c, MET] = 1.0
        state[c, CELL_U], state[c, CELL_V], state[c, ACROSS], state[c, ALONG] = i, j, a, b
        state[c, HEIGHT], state[c, COSINE], state[c, RATE] = height, cosine, rate
        plate.active[count] = c
        count += 1
    plate.active[-1] = count


@compiled
def apply(
    plate: Plate, liner: CrushingLiner, surface: Surface, step: float, motion: Motion, loads: Loads
) -> None:
    """Step the plate to the present and add the foam's forces to the helmet's load.

    Args:
        plate, liner: constants and state; the state is changed in place.
        surface: what the helmet strikes.
        step: time since the last call [s].
        motion, loads: of the bodies.
    """
    listed, sticks = liner.near.listed, liner.stick
    if plate.engaged[0] == 0:
        find_near(liner, surface, motion)
        if listed[-1] == 0 or not engage(plate, liner, surface, motion):
            return
        plate.engaged[0] = 1
    find_near(liner, plate.plane, motion)
    if listed[-1] == 0:
        plate.engaged[0] = 0
        liner.near.position[:] = np.inf
        return
    follow(plate, liner, surface, motion)
    helmet = rigid(motion, liner.helmet)
    points, foams, largest = liner.columns.point, liner.columns.foam, liner.largest
    state, f = plate.columns, plate.frame
    up = row3(f, 9)
    place(plate, liner, helmet, step)
    if plate.active[-1] > 0:  # else it rests: it has let go of all that bent it
        count = math.ceil(step / plate.longest)
        part = step / count
        around = norm(helmet.spin) * max(liner.semi_axes)
        most = FLING * (norm(velocity_at(helmet, helmet.position)) + around)
        for k in range(count):
            press(plate, liner, step - (k + 1) * part)
            move(plate, part, most)
        press(plate, liner, 0.0)
    total, moment, friction = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for n in range(listed[-1]):
        c = listed[n]
        pushed, stick = state[c, PUSHED], sticks[c]
        if pushed <= 0.0:
            stick[0] = stick[1] = stick[2] = 0.0
            continue
        point = world_point(helmet, row(points, c))
        slip = across(velocity_at(helmet, point), up)
        shear = loading_stress(largest[c], foams[c]) / largest[c] / (2.0 * (1.0 + POISSON))
        shear *= liner.columns.area[c] * state[c, COSINE] / liner.columns.thickness[c]
        rubbed = friction_force(
            shear, RELAXATION - motion.ahead,
            plate.friction[int(state[c, CELL_U]), int(state[c, CELL_V])] * pushed,
            slip, up, step, stick,
        )  # fmt: skip
        force = add(scaled(up, pushed), rubbed)
        total, friction = add(total, force), add(friction, rubbed)
        moment = add(moment, cross(point, force))
    load(loads, liner.helmet, total, sub(moment, cross(helmet.origin, total)))
    count_surface(loads, HELMET, total, moment, friction)


@compiled
def row3(values: FloatArray, first: int) -> Vec:
    """Three numbers of a flat array."""
    return values[first], values[first + 1], values[first + 2]
