"""Several rates: the body at a large step, head and helmet at the fine one.

A helmet floats on the head: six joint axes lie between them, so the two act on each other by forces
alone. The body without its helmet changes its configuration within milliseconds. Once per large
step H its kinematics, mass matrix M, bias and slow forces are taken at the middle of the step. With
B the Jacobian of the head's twist in head axes, M^-1 B^T tells what a wrench on the head does to
every joint, and A = B M^-1 B^T what it does to the head itself. Then head and helmet are advanced
as rigid bodies at the fine step h, under the same forces as at a single rate:

    head twist x' = B a + (B)' v + A g,   joints v(t) = v0 + a t + M^-1 B^T (integral of g)

with a the acceleration by slow forces and bias, g the wrench of the fine forces on the head. All
of it is of second order in H; in h it is the same leapfrog as the single rate. The joints' damping
D is taken by the trapezoidal rule: M + H D / 2 stands for M, -D v0 for the damping's force.

Positions never drift apart: what is integrated at the end are the joints themselves, the head's
pose follows from them anew in each large step, and the helmet's from the head's and its own joints.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force import liner, neck, shell
from helmet_sim_ros.model.force.bodies import Loads, Motion, add_generalised, clear
from helmet_sim_ros.model.force.vector import (
    Mat,
    Vec,
    add,
    cross,
    dot,
    matrix,
    row,
    scaled,
    sub,
    turned,
    turned_back,
)
from helmet_sim_ros.model.layout import Layout
from helmet_sim_ros.model.loop import (
    Clock,
    Engine,
    Forces,
    Rows,
    acceleration_,
    com_pos,
    energy_vel,
    factor_m,
    fast_forces,
    integrate_pos,
    kinematics,
    make_m,
    slow_forces,
    velocity_,
)

_solve_m: Any = types.ExternalFunction(
    "mj_solveM", types.void(types.intp, types.intp, types.intp, types.intp, types.int32)
)

SHORTEST, LONGEST = 5e-5, 4e-4  # s, bounds of the large step
#: Error of the head's speed that a large step may have [m/s], of its turning at this arm [m].
TOLERANCE, ARM = 5e-4, 0.1
GROWTH = 2.0  # from one large step to the next, at most


class Solid(NamedTuple):
    """A rigid body: mass [kg], centre in its frame [m], inertia about it [kg m^2] and inverse."""

    mass: float
    center: Vec
    inertia: Mat
    inverse: Mat


class Gauges(NamedTuple):
    """Where each sensor stands; ``neck_force`` is negative without a neck."""

    head_position: int
    head_orientation: int
    helmet_orientation: int
    head_velocity: int
    head_angular_velocity: int
    head_specific_force: int
    head_angular_acceleration: int
    neck_force: int
    neck_torque: int
    neck_site: Vec


class Carried(NamedTuple):
    """Head and helmet as the fine rate sees them.

    Attributes:
        head, helmet: bodies; of a spring helmet the latter is the struck shell.
        carrying: bodies of the helmet, which the body at the large step does not carry.
        chain: degrees of freedom that move the head.
        slide, slide_velocity: first of the six joint axes from head to helmet in qpos and qvel.
        spring, spring_velocity: first of the shell's three slides; negative: a foam helmet.
        skull: the head with what is fixed to it, head frame.
        inner: the helmet (spring: all but the struck shell), helmet frame.
        shell: of a spring helmet, which translates against ``inner``.
        gauges: sensors.
        gravity: [m/s^2].
    """

    head: int
    helmet: int
    carrying: NDArray[np.int64]
    chain: NDArray[np.int64]
    slide: int
    slide_velocity: int
    spring: int
    spring_velocity: int
    skull: Solid
    inner: Solid
    shell: Solid
    gauges: Gauges
    gravity: Vec


class Carrier(NamedTuple):
    """Working memory and state of the large step.

    Attributes:
        inertia, axes_rate, quaternion: views of MuJoCo's cinert, cdof_dot and xquat.
        position, velocity: at the start of the large step, (nq,), (nv,).
        mean: velocity over a part of the step, (nv,).
        latest: state: acceleration at the end of the step before, (nv,).
        jacobian: B, (6, nv): angular, then linear, head axes.
        response: M^-1 B^T, transposed, (6, nv); ``apparent``: A, (6, 6).
        steps: state: fine steps done, and of the next large step; (2,).
        drift: state: of the head in the large step before (6), and that step's length [s]; (7,).
        slope: state: rate of change of the drift, (6,).
        rates: state: accelerations of the fine step before: of the head (6, head axes), of the
            helmet's middle and the shell (3 each, world axes), of the helmet's turning (3); (15,).
        tolerance: see ``TOLERANCE``; ``longest``: large step [s].
    """

    inertia: FloatArray
    axes_rate: FloatArray
    quaternion: FloatArray
    position: FloatArray
    velocity: FloatArray
    mean: FloatArray
    latest: FloatArray
    jacobian: FloatArray
    response: FloatArray
    apparent: FloatArray
    steps: NDArray[np.int64]
    drift: FloatArray
    slope: FloatArray
    rates: FloatArray
    tolerance: float
    longest: float


def _solid(model: mujoco.MjModel, bodies: list[int]) -> Solid:
    """Bodies that are fixed to the first of them, frames aligned, as one."""
    masses = [float(model.body_mass[b]) for b in bodies]
    turns = [np.zeros(9) for _ in bodies]
    for turn, b in zip(turns, bodies, strict=True):
        mujoco.mju_quat2Mat(turn, model.body_iquat[b])
    mass = sum(masses)
    center = sum(m * model.body_ipos[b] for m, b in zip(masses, bodies, strict=True)) / mass
    inertia = np.zeros((3, 3))
    for m, b, turn in zip(masses, bodies, turns, strict=True):
        axes, off = turn.reshape(3, 3), model.body_ipos[b] - center
        inertia += axes @ np.diag(model.body_inertia[b]) @ axes.T
        inertia += m * (off @ off * np.eye(3) - np.outer(off, off))
    flat = [tuple(float(x) for x in a.ravel()) for a in (center, inertia, np.linalg.inv(inertia))]
    return Solid(mass, *flat)  # type: ignore[arg-type]


def carried(model: mujoco.MjModel, layout: Layout, chain: NDArray[np.int64]) -> Carried:
    """Head and helmet of a model; ``chain``: the degrees of freedom that move the head."""
    sprung = layout.slide >= 0
    inner = int(model.body("helmet_inside").id) if sprung else layout.helmet
    rest = int(model.body("helmet_rest").id)
    parts = [inner, layout.helmet] if sprung else [inner]
    shell_only, inside = _solid(model, [layout.helmet]), _solid(model, [inner])
    if sprung:  # the shell turns with what it slides on
        whole = np.reshape(inside.inertia, (3, 3)) + np.reshape(shell_only.inertia, (3, 3))
        inverse = np.linalg.inv(whole)
        inside = Solid(inside.mass, inside.center, tuple(whole.ravel()), tuple(inverse.ravel()))
    names = [name for name in Gauges._fields[:-1] if name in layout.sensors]
    places = [layout.sensors[name][0] for name in names] + [-1] * (9 - len(names))
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "neck_load")
    at = tuple(float(x) for x in model.site_pos[site]) if site >= 0 else (0.0, 0.0, 0.0)
    x, y, z = (float(g) for g in model.opt.gravity)
    return Carried(
        layout.head, layout.helmet, np.array(parts, dtype=np.int64), chain, layout.fit,
        layout.fit_velocity, layout.slide, layout.slide_velocity,
        _solid(model, [layout.head, rest]), inside, shell_only, Gauges(*places, at), (x, y, z),
    )  # fmt: skip


def carrier(model: mujoco.MjModel, data: mujoco.MjData) -> Carrier:
    """Working memory for a simulation that starts."""
    nv = model.nv
    return Carrier(
        data.cinert, data.cdof_dot, data.xquat, np.zeros(model.nq), np.zeros(nv), np.zeros(nv),
        np.zeros(nv), np.zeros((6, nv)), np.zeros((6, nv)), np.zeros((6, 6)),
        np.array([0, 1], dtype=np.int64), np.zeros(7), np.zeros(6), np.zeros(15),
        TOLERANCE, LONGEST,
    )  # fmt: skip


Quat = tuple[float, float, float, float]


@inlined
def turned_by(q: Quat, spin: Vec, time: float) -> Quat:
    """A unit quaternion after a small turn: angular velocity [rad/s] in its own axes times [s]."""
    x, y, z = 0.5 * time * spin[0], 0.5 * time * spin[1], 0.5 * time * spin[2]
    a = q[0] - q[1] * x - q[2] * y - q[3] * z
    b = q[1] + q[0] * x + q[2] * z - q[3] * y
    c = q[2] + q[0] * y + q[3] * x - q[1] * z
    d = q[3] + q[0] * z + q[1] * y - q[2] * x
    size = 1.0 / (a * a + b * b + c * c + d * d) ** 0.5
    return a * size, b * size, c * size, d * size


@inlined
def matrix_of(q: Quat) -> Mat:
    """The rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@inlined
def times(a: Quat, b: Quat) -> Quat:
    """The product of two quaternions."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    )  # fmt: skip


@inlined
def conjugate(a: Quat) -> Quat:
    """The inverse of a unit quaternion."""
    return a[0], -a[1], -a[2], -a[3]


@compiled
def joint_velocity(carrier: Carrier, slow: FloatArray, time: float, impulse: FloatArray,
                   out: FloatArray) -> None:  # fmt: skip
    """Velocities at a time [s] in the large step after an impulse on the head, (6,)."""
    start, response = carrier.velocity, carrier.response
    for j in range(len(out)):
        total = start[j] + time * slow[j]
        for k in range(6):
            total += response[k, j] * impulse[k]
        out[j] = total


@compiled
def put(array: FloatArray, first: int, value: Vec) -> None:
    """Write three numbers."""
    for k in range(3):
        array[first + k] = value[k]


@compiled
def renew(
    engine: Engine,
    motion: Motion,
    loads: Loads,
    forces: Forces,
    carried: Carried,
    carrier: Carrier,
    length: float,
) -> None:
    """Take kinematics, inertia, bias and slow forces at the middle of a large step.

    Args:
        loads: of the slow forces.
        length: H [s].

    ``engine.acceleration`` gets the slow acceleration, ``engine.energy`` the body's energy; qpos
    is as before, qvel that of the middle.
    """
    model, data = engine.model, engine.data
    qpos, qvel, mass, diagonal = motion.qpos, motion.qvel, engine.mass, engine.diagonal
    start, latest, mean = carrier.velocity, carrier.latest, carrier.mean
    struck, _, stopped, necked, touching, _, _, _, _ = forces
    count = 9 if carried.spring >= 0 else 6
    first, last = carried.slide_velocity, carried.slide_velocity + count
    # In a leapfrog velocities stand half a fine step before their positions: of the kicks from start
    # to end the middle is half a fine step before that of the positions.
    way = 0.5 * (length - engine.step)
    for j in range(len(qvel)):
        mean[j] = start[j] + (0.5 * way + 0.5 * engine.step) * latest[j]
        qvel[j] = start[j] + 0.5 * length * latest[j]
    mean[first:last] = 0.0
    qvel[first:last] = 0.0
    integrate_pos(model, qpos.ctypes.data, mean.ctypes.data, way)
    kinematics(model, data)
    com_pos(model, data)
    for k in range(len(carried.carrying)):
        carrier.inertia[carried.carrying[k]] = 0.0
    make_m(model, data)
    energy_vel(model, data)
    velocity_(model, data)
    clear(loads)
    slow_forces(stopped, necked, touching, struck, length, motion, loads)
    # Damping by the trapezoidal rule: the joints' by the velocity at the start. The neck's stops act
    # by that of the middle, and what they lack to the rule is made up for, which keeps it stable.
    mean[:] = 0.0
    neck.damping(necked, loads.generalised, mean)
    add_generalised(motion, loads, engine.chains)
    for j in range(len(diagonal)):
        damping = engine.damping[j] / engine.step + mean[j]
        mass[diagonal[j]] += 0.5 * length * damping
        loads.generalised[j] += damping * (qvel[j] - start[j])
    for j in range(first, last):
        mass[diagonal[j]] += 1.0
    factor_m(model, data)
    acceleration_(model, data)

    jacobian, response, apparent = carrier.jacobian, carrier.response, carrier.apparent
    position, rotation = row(motion.position, carried.head), matrix(motion.rotation, carried.head)
    o = motion.origin
    arm = sub(position, (o[0], o[1], o[2]))
    for n in range(len(carried.chain)):
        j = carried.chain[n]
        c = motion.axes[j]
        spin, speed = (c[0], c[1], c[2]), (c[3], c[4], c[5])
        turning = turned_back(rotation, spin)
        moving = turned_back(rotation, add(speed, cross(spin, arm)))
        for k in range(3):
            jacobian[k, j] = turning[k]
            jacobian[3 + k, j] = moving[k]
    _solve_m(model, data, response.ctypes.data, jacobian.ctypes.data, 6)
    for k in range(6):
        for i in range(k + 1):
            total = 0.0
            for n in range(len(carried.chain)):
                j = carried.chain[n]
                total += jacobian[k, j] * response[i, j]
            apparent[k, i] = apparent[i, k] = total


@compiled
def head_rate(
    motion: Motion, carried: Carried, carrier: Carrier, slow: FloatArray, twist: FloatArray,
    drift: FloatArray, turning: FloatArray,
) -> None:  # fmt: skip
    """What the head does without fine forces, head axes, angular then linear.

    Args:
        slow: acceleration of the joints by slow forces and bias.
        twist: B v0; written.
        drift: B a + (B)' v; written. ``turning``: the second part alone; written.
    """
    twist[:] = 0.0
    drift[:] = 0.0
    bias = np.zeros(6)
    for n in range(len(carried.chain)):
        j = carried.chain[n]
        for k in range(6):
            twist[k] += carrier.jacobian[k, j] * carrier.velocity[j]
            drift[k] += carrier.jacobian[k, j] * slow[j]
            bias[k] += carrier.axes_rate[j, k] * motion.qvel[j]
    rotation, o = matrix(motion.rotation, carried.head), motion.origin
    v = motion.velocity[carried.head]
    arm = sub(row(motion.position, carried.head), (o[0], o[1], o[2]))
    turn, spin = (v[0], v[1], v[2]), (bias[0], bias[1], bias[2])
    # Of the head's own point, not of what passes the origin: it does not know how fast all moves.
    speed = add((v[3], v[4], v[5]), cross(turn, arm))
    moved = add(add((bias[3], bias[4], bias[5]), cross(spin, arm)), cross(turn, speed))
    put(turning, 0, turned_back(rotation, spin))
    put(turning, 3, turned_back(rotation, moved))
    for k in range(6):
        drift[k] += turning[k]


@compiled
def next_length(carrier: Carrier, drift: FloatArray, length: float) -> float:
    """Length [s] of the large step after one of this ``length`` with this drift of the head.

    What the drift differs from its extrapolation is an error of the step, in velocity it grows
    with the third power of the length.
    """
    before = carrier.drift[6]
    apart = 0.5 * (before + length)
    turn, speed = 0.0, 0.0
    for k in range(6):
        off = drift[k] - carrier.drift[k] - apart * carrier.slope[k]
        if k < 3:
            turn += off * off
        else:
            speed += off * off
        if before > 0.0:
            carrier.slope[k] = (drift[k] - carrier.drift[k]) / apart
        carrier.drift[k] = drift[k]
    carrier.drift[6] = length
    if before == 0.0:
        return SHORTEST
    error = length * (speed + ARM * ARM * turn) ** 0.5
    ratio = (carrier.tolerance / max(error, 1e-12)) ** (1.0 / 3.0)
    return min(carrier.longest, max(SHORTEST, length * min(GROWTH, ratio)))


@compiled
def advance_several(
    engine: Engine,
    motion: Motion,
    slow_loads: Loads,
    loads: Loads,
    forces: Forces,
    clock: Clock,
    carried: Carried,
    carrier: Carrier,
    rows: Rows,
    last: int,
) -> int:
    """Step until sample ``last`` is reached or passed; each row is the state before its step.

    Args:
        engine, motion: of one simulation.
        slow_loads: written to MuJoCo's applied forces; ``loads``: of the fine forces.
        forces, carrier: their states are changed in place.
        clock: fine step and steps per sample.
        rows: samples to write.

    Returns:
        The number of samples written, or the index of the first sample at or after which the state
        has left physics.
    """
    model, step = engine.model, clock.step
    qpos, qvel, slow = motion.qpos, motion.qvel, engine.acceleration
    struck, sprung, _, _, _, outside, crushing, plate, fitted = forces
    foam = carried.spring < 0
    bends = shell.spreads(plate, struck)
    first, chest, helmet = carried.slide, carried.head, carried.helmet
    first_v, spring, spring_v = carried.slide_velocity, carried.spring, carried.spring_velocity
    skull, inner, struck_shell, gauges = (
        carried.skull, carried.inner, carried.shell, carried.gauges
    )  # fmt: skip
    gravity, apparent = carried.gravity, carrier.apparent
    start_q, start_v, mean, latest = (
        carrier.position, carrier.velocity, carrier.mean, carrier.latest
    )  # fmt: skip
    twist, drift, turning, rate = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    wrench, impulse, impulses, average = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    total = len(rows.qpos) * clock.substeps
    position_h, rotation_h, velocity_h = (
        motion.position[helmet], motion.rotation[helmet], motion.velocity[helmet]
    )  # fmt: skip
    position_0, rotation_0, velocity_0 = (
        motion.position[chest], motion.rotation[chest], motion.velocity[chest]
    )  # fmt: skip
    sensors, generalised, pushed = engine.sensors, loads.generalised, loads.wrenches
    while carrier.steps[0] < min(last * clock.substeps, total):
        done = carrier.steps[0]
        count = min(carrier.steps[1], total - done)
        length = count * step
        start_q[:] = qpos
        start_v[:] = qvel
        renew(engine, motion, slow_loads, forces, carried, carrier, length)
        head_rate(motion, carried, carrier, slow, twist, drift, turning)
        following = next_length(carrier, drift, length)
        o = (motion.origin[0], motion.origin[1], motion.origin[2])
        # The head's pose at the start of the step, back from the middle; its velocity half a fine
        # step before.
        way, late = 0.5 * (length - step), 0.5 * step
        back = np.zeros(6)
        for n in range(len(carried.chain)):
            j = carried.chain[n]
            for k in range(6):
                back[k] += carrier.jacobian[k, j] * latest[j]
        for k in range(6):
            back[k] = twist[k] + 0.5 * (way + step) * back[k] - 0.5 * way * turning[k]
            twist[k] -= 0.5 * length * turning[k]
        spin = (back[0], back[1], back[2])
        q = carrier.quaternion[chest]
        head_q = (q[0], q[1], q[2], q[3])
        middle_r = matrix(motion.rotation, chest)
        head_q = turned_by(head_q, spin, -way)
        head_p = sub(
            row(motion.position, chest),
            scaled(turned(middle_r, (back[3], back[4], back[5])), way),
        )
        head_v = turned(middle_r, (twist[3], twist[4], twist[5]))
        held = row(slow_loads.wrenches, chest)
        w = slow_loads.wrenches[chest]
        held_moment = sub((w[3], w[4], w[5]), cross(sub(head_p, o), held))
        # The helmet's own state from its joints.
        qpos[:] = start_q
        qvel[:] = start_v
        head_r = matrix_of(head_q)
        helmet_q = times(
            head_q, (qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6])
        )
        helmet_r = matrix_of(helmet_q)
        shift = (qpos[first], qpos[first + 1], qpos[first + 2])
        helmet_p = add(head_p, turned(head_r, shift))
        head_spin, head_speed = (twist[0], twist[1], twist[2]), turned_back(head_r, head_v)
        relative = (qvel[first_v + 3], qvel[first_v + 4], qvel[first_v + 5])
        spin_h = add(turned_back(helmet_r, turned(head_r, head_spin)), relative)
        frame_v = turned(
            head_r,
            add(
                add(head_speed, cross(head_spin, shift)),
                (qvel[first_v], qvel[first_v + 1], qvel[first_v + 2]),
            ),
        )
        inner_v = add(frame_v, turned(helmet_r, cross(spin_h, inner.center)))
        inner_x = add(helmet_p, turned(helmet_r, inner.center))
        shell_v, shell_x = inner_v, inner_x
        if not foam:
            slid = (qpos[spring], qpos[spring + 1], qpos[spring + 2])
            middle = add(struck_shell.center, slid)
            shell_x = add(helmet_p, turned(helmet_r, middle))
            sliding = (qvel[spring_v], qvel[spring_v + 1], qvel[spring_v + 2])
            shell_v = add(frame_v, turned(helmet_r, add(cross(spin_h, middle), sliding)))
        kinetic = engine.energy[1] + 0.5 * inner.mass * dot(inner_v, inner_v)
        if not foam:
            kinetic += 0.5 * struck_shell.mass * dot(shell_v, shell_v)
        elapsed = done * step
        if not kinetic <= clock.energy + elapsed * (clock.power + elapsed * clock.growth):
            return int(np.ceil(done / clock.substeps))
        impulse[:] = 0.0
        impulses[:] = 0.0
        gathered, moments = 0, 0.0
        for n in range(count):
            time = n * step
            head_r, helmet_r = matrix_of(head_q), matrix_of(helmet_q)
            # Velocities of the present: half a step of the latest acceleration beyond the leapfrog's.
            b = carrier.rates
            spin_0 = add(head_spin, scaled((b[0], b[1], b[2]), late))
            v_0 = add(head_v, scaled(turned(head_r, (b[3], b[4], b[5])), late))
            v_inner = add(inner_v, scaled((b[6], b[7], b[8]), late))
            v_shell = add(shell_v, scaled((b[9], b[10], b[11]), late))
            spin_1 = add(spin_h, scaled((b[12], b[13], b[14]), late))
            head_speed = turned_back(head_r, v_0)
            # What MuJoCo's arrays say of head and helmet, as at a single rate.
            helmet_p = sub(inner_x, turned(helmet_r, inner.center))
            arm = sub(helmet_p, head_p)
            shift = turned_back(head_r, arm)
            world_spin = turned(helmet_r, spin_1)
            frame_v = sub(v_inner, cross(world_spin, sub(inner_x, helmet_p)))
            put(qpos, first, shift)
            a, b, c, d = times(conjugate(head_q), helmet_q)
            qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6] = a, b, c, d
            put(
                qvel, first_v,
                sub(sub(turned_back(head_r, frame_v), head_speed), cross(spin_0, shift)),
            )  # fmt: skip
            put(
                qvel, first_v + 3,
                sub(spin_1, turned_back(helmet_r, turned(head_r, spin_0))),
            )  # fmt: skip
            shell_p, point_v = helmet_p, frame_v
            if not foam:
                middle = turned_back(helmet_r, sub(shell_x, helmet_p))
                put(qpos, spring, sub(middle, struck_shell.center))
                put(
                    qvel, spring_v,
                    sub(turned_back(helmet_r, sub(v_shell, frame_v)), cross(spin_1, middle)),
                )  # fmt: skip
                shell_p = sub(shell_x, turned(helmet_r, struck_shell.center))
                point_v = sub(v_shell, cross(world_spin, sub(shell_x, shell_p)))
            put(position_h, 0, shell_p)
            put(velocity_h, 0, world_spin)
            put(velocity_h, 3, add(point_v, cross(world_spin, sub(o, shell_p))))
            put(position_0, 0, head_p)
            world = turned(head_r, spin_0)
            put(velocity_0, 0, world)
            put(velocity_0, 3, add(v_0, cross(world, sub(o, head_p))))
            for k in range(9):
                rotation_h[k] = helmet_r[k]
                rotation_0[k] = head_r[k]

            clear(loads)
            fast_forces(
                fitted, outside, foam, bends, plate, crushing, sprung, struck, step, motion, loads
            )
            # On the helmet, world axes, moments about the mass centres.
            fit = turned(head_r, (
                generalised[first_v], generalised[first_v + 1], generalised[first_v + 2]
            ))  # fmt: skip
            torque = turned(helmet_r, (
                generalised[first_v + 3], generalised[first_v + 4], generalised[first_v + 5]
            ))  # fmt: skip
            p = pushed[helmet]
            force, moment = (p[0], p[1], p[2]), (p[3], p[4], p[5])
            on_inner = fit
            about = add(cross(sub(helmet_p, inner_x), fit), torque)
            if foam:
                on_inner = add(on_inner, force)
                about = add(about, sub(moment, cross(sub(inner_x, o), force)))
            else:
                pulled = turned(helmet_r, (
                    generalised[spring_v], generalised[spring_v + 1], generalised[spring_v + 2]
                ))  # fmt: skip
                on_inner = sub(on_inner, pulled)
                about = add(about, sub(moment, cross(sub(shell_x, o), force)))
                about = sub(about, cross(sub(shell_x, inner_x), pulled))
                put(carrier.rates, 9, add(
                    scaled(add(force, pulled), 1.0 / struck_shell.mass), gravity
                ))  # fmt: skip
            # On the head, head axes, about its origin; the joints' forces act back on it.
            p = pushed[chest]
            direct = (p[0], p[1], p[2])
            on_head = sub(direct, fit)
            about_head = sub(sub((p[3], p[4], p[5]), cross(sub(head_p, o), direct)),
                             add(cross(arm, fit), torque))  # fmt: skip
            put(wrench, 0, turned_back(head_r, about_head))
            put(wrench, 3, turned_back(head_r, on_head))
            for k in range(6):
                value = drift[k] + (time - way) * carrier.slope[k]
                for i in range(6):
                    value += apparent[k, i] * wrench[i]
                rate[k] = value

            if (done + n) % clock.substeps == 0:
                i = (done + n) // clock.substeps
                alpha, linear = (rate[0], rate[1], rate[2]), (rate[3], rate[4], rate[5])
                felt = sub(linear, turned_back(head_r, gravity))
                put(sensors, gauges.head_position, head_p)
                g = gauges.head_orientation
                sensors[g], sensors[g + 1], sensors[g + 2], sensors[g + 3] = head_q
                g = gauges.helmet_orientation
                sensors[g], sensors[g + 1], sensors[g + 2], sensors[g + 3] = helmet_q
                put(sensors, gauges.head_velocity, v_0)
                put(sensors, gauges.head_angular_velocity, world)
                put(sensors, gauges.head_specific_force, turned(head_r, felt))
                put(sensors, gauges.head_angular_acceleration, turned(head_r, alpha))
                if gauges.neck_force >= 0:
                    middle = skull.center
                    at_center = add(felt, add(
                        cross(alpha, middle), cross(spin_0, cross(spin_0, middle))
                    ))  # fmt: skip
                    others = add(turned_back(head_r, held), (wrench[3], wrench[4], wrench[5]))
                    other_moment = add(
                        turned_back(head_r, held_moment), (wrench[0], wrench[1], wrench[2])
                    )
                    carrying = sub(scaled(at_center, skull.mass), others)
                    bending = add(
                        turned(skull.inertia, alpha),
                        cross(spin_0, turned(skull.inertia, spin_0)),
                    )
                    bending = sub(bending, sub(other_moment, cross(middle, others)))
                    put(sensors, gauges.neck_force, carrying)
                    put(
                        sensors, gauges.neck_torque,
                        add(bending, cross(sub(middle, gauges.neck_site), carrying)),
                    )  # fmt: skip
                for k in range(6):
                    average[k] = impulse[k] + late * wrench[k]
                joint_velocity(carrier, slow, time + late, average, mean)
                rows.qpos[i] = qpos
                rows.qvel[i] = mean
                for j in range(first_v, first_v + 6):
                    rows.qvel[i, j] = qvel[j]
                if not foam:
                    for j in range(spring_v, spring_v + 3):
                        rows.qvel[i, j] = qvel[j]
                rows.sensors[i] = sensors
                rows.coupling[i] = loads.coupling
                rows.spring[i] = loads.spring
                for k in range(2):
                    for j in range(rows.surface.shape[2]):
                        rows.surface[i, k, j] = loads.surface[k, j] + slow_loads.surface[k, j]
                if foam:
                    liner.crush(crushing, struck, motion, rows.crush[i])
            # Leapfrog: velocities, then positions by the new ones.
            spun = turned(inner.inertia, spin_1)
            put(carrier.rates, 0, (rate[0], rate[1], rate[2]))
            put(carrier.rates, 3, (rate[3], rate[4], rate[5]))
            put(carrier.rates, 6, add(scaled(on_inner, 1.0 / inner.mass), gravity))
            put(carrier.rates, 12, turned(
                inner.inverse, sub(turned_back(helmet_r, about), cross(spin_1, spun))
            ))  # fmt: skip
            b = carrier.rates
            if not abs(b.sum()) < 1e12:  # also true for NaN
                return int(np.ceil((done + n) / clock.substeps))
            inner_v = add(inner_v, scaled((b[6], b[7], b[8]), step))
            shell_v = add(shell_v, scaled((b[9], b[10], b[11]), step))
            spin_h = add(spin_h, scaled((b[12], b[13], b[14]), step))
            time += step
            for k in range(6):
                impulse[k] += step * wrench[k]
            for k in range(6):
                impulses[k] += impulse[k]
            gathered += 1
            moments += time
            head_v = add(head_v, scaled(turned(head_r, (rate[3], rate[4], rate[5])), step))
            head_spin = add(head_spin, scaled((rate[0], rate[1], rate[2]), step))
            head_p = add(head_p, scaled(head_v, step))
            head_q = turned_by(head_q, head_spin, step)
            helmet_q = turned_by(helmet_q, spin_h, step)
            inner_x = add(inner_x, scaled(inner_v, step))
            shell_x = add(shell_x, scaled(shell_v, step))
            if n == count - 1 or (done + n + 1) % clock.substeps == 0:
                for k in range(6):
                    average[k] = impulses[k] / gathered
                joint_velocity(carrier, slow, moments / gathered, average, mean)
                mean[first_v : first_v + 6] = 0.0
                if not foam:
                    mean[spring_v : spring_v + 3] = 0.0
                integrate_pos(model, qpos.ctypes.data, mean.ctypes.data, gathered * step)
                impulses[:] = 0.0
                gathered, moments = 0, 0.0
        # The end of the large step: joints of the body by their own, of the helmet from the poses.
        joint_velocity(carrier, slow, length, impulse, qvel)
        head_r, helmet_r = matrix_of(head_q), matrix_of(helmet_q)
        head_speed = turned_back(head_r, head_v)
        helmet_p = sub(inner_x, turned(helmet_r, inner.center))
        shift = turned_back(head_r, sub(helmet_p, head_p))
        frame_v = sub(inner_v, turned(helmet_r, cross(spin_h, inner.center)))
        put(qpos, first, shift)
        a, b, c, d = times(conjugate(head_q), helmet_q)
        qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6] = a, b, c, d
        put(
            qvel, first_v,
            sub(sub(turned_back(head_r, frame_v), head_speed), cross(head_spin, shift)),
        )  # fmt: skip
        put(qvel, first_v + 3, sub(spin_h, turned_back(helmet_r, turned(head_r, head_spin))))
        if not foam:
            middle = turned_back(helmet_r, sub(shell_x, helmet_p))
            put(qpos, spring, sub(middle, struck_shell.center))
            put(
                qvel, spring_v,
                sub(turned_back(helmet_r, sub(shell_v, frame_v)), cross(spin_h, middle)),
            )  # fmt: skip
        for j in range(len(latest)):
            value = slow[j]
            for k in range(6):
                value += carrier.response[k, j] * wrench[k]
            latest[j] = value
        carrier.steps[0] = done + count
        carrier.steps[1] = max(1, int(following / step + 1e-9))
    return -(-carrier.steps[0] // clock.substeps)
