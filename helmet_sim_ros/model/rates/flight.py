"""Head and helmet at the fine rate: two rigid bodies, and of a spring helmet its struck shell."""

from __future__ import annotations

from typing import NamedTuple

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.force.vector import (
    Quat,
    Vec,
    add,
    cross,
    matrix,
    matrix_of,
    quaternion,
    row,
    row3,
    scaled,
    sub,
    turned,
    turned_back,
)
from helmet_sim_ros.model.rates.parts import Carried, Carrier
from helmet_sim_ros.model.rates.turning import conjugate, put, times, turned_by


class Flight(NamedTuple):
    """Positions, and velocities half a fine step before them; world axes, angular velocities in
    the axes of what turns.

    Attributes:
        turn, position, speed, spin: of the head's frame.
        helmet_turn, helmet_spin: of the helmet.
        inner, inner_speed: of the mass centre of the helmet (spring: of all but the struck shell).
        shell, shell_speed: of the struck shell's; of a foam helmet the same as of ``inner``.
    """

    turn: Quat
    position: Vec
    speed: Vec
    spin: Vec
    helmet_turn: Quat
    helmet_spin: Vec
    inner: Vec
    inner_speed: Vec
    shell: Vec
    shell_speed: Vec


class Push(NamedTuple):
    """What acts on the helmet, world axes.

    Attributes:
        inner: force on its middle; ``about``: moment about that.
        shell: force on the struck shell.
    """

    inner: Vec
    about: Vec
    shell: Vec


@inlined
def begun(motion: Motion, carried: Carried, carrier: Carrier, length: float, step: float) -> Flight:
    """Where head and helmet are at the start of a large step, from the head at its middle and the
    helmet's joints at its start, which stand in ``motion``.

    Args:
        length: of the large step [s]; ``step``: the fine one [s].
    """
    twist, _, turning, _, back, _, _, _, _, _ = carrier.scratch
    qpos, qvel = motion.qpos, motion.qvel
    way = 0.5 * (length - step)
    back[:] = 0.0
    for n in range(len(carried.chain)):
        j = carried.chain[n]
        for k in range(6):
            back[k] += carrier.jacobian[k, j] * carrier.latest[j]
    for k in range(6):
        back[k] = twist[k] + 0.5 * (way + step) * back[k] - 0.5 * way * turning[k]
        twist[k] -= 0.5 * length * turning[k]
    middle_r = matrix(motion.rotation, carried.head)
    turn = turned_by(
        quaternion(carrier.quaternion[carried.head], 0), (back[0], back[1], back[2]), -way
    )
    position = sub(
        row(motion.position, carried.head),
        scaled(turned(middle_r, (back[3], back[4], back[5])), way),
    )
    speed = turned(middle_r, (twist[3], twist[4], twist[5]))
    spin = (twist[0], twist[1], twist[2])
    first, first_v, sprung = carried.slide, carried.slide_velocity, carried.spring
    head_r = matrix_of(turn)
    helmet_turn = times(turn, quaternion(qpos, first + 3))
    helmet_r = matrix_of(helmet_turn)
    shift = row3(qpos, first)
    place = add(position, turned(head_r, shift))
    helmet_spin = add(turned_back(helmet_r, turned(head_r, spin)), row3(qvel, first_v + 3))
    frame_speed = turned(
        head_r, add(add(turned_back(head_r, speed), cross(spin, shift)), row3(qvel, first_v))
    )
    inner = add(place, turned(helmet_r, carried.inner.center))
    inner_speed = add(frame_speed, turned(helmet_r, cross(helmet_spin, carried.inner.center)))
    shell, shell_speed = inner, inner_speed
    if sprung >= 0:
        middle = add(carried.shell.center, row3(qpos, sprung))
        shell = add(place, turned(helmet_r, middle))
        sliding = row3(qvel, carried.spring_velocity)
        shell_speed = add(frame_speed, turned(helmet_r, add(cross(helmet_spin, middle), sliding)))
    return Flight(
        turn,
        position,
        speed,
        spin,
        helmet_turn,
        helmet_spin,
        inner,
        inner_speed,
        shell,
        shell_speed,
    )


@inlined
def present(f: Flight, rates: FloatArray, late: float) -> Flight:
    """The same with velocities of the present, by the accelerations of the step before.

    Args:
        rates: see ``Carrier.rates``; ``late``: half a fine step [s].
    """
    linear = turned(matrix_of(f.turn), row3(rates, 3))
    return Flight(
        f.turn, f.position, add(f.speed, scaled(linear, late)),
        add(f.spin, scaled(row3(rates, 0), late)),
        f.helmet_turn, add(f.helmet_spin, scaled(row3(rates, 12), late)),
        f.inner, add(f.inner_speed, scaled(row3(rates, 6), late)),
        f.shell, add(f.shell_speed, scaled(row3(rates, 9), late)),
    )  # fmt: skip


@inlined
def stepped(f: Flight, rates: FloatArray, step: float) -> Flight:
    """A fine step on: velocities, then positions by the new ones."""
    linear = turned(matrix_of(f.turn), row3(rates, 3))
    speed, spin = add(f.speed, scaled(linear, step)), add(f.spin, scaled(row3(rates, 0), step))
    helmet_spin = add(f.helmet_spin, scaled(row3(rates, 12), step))
    inner_speed = add(f.inner_speed, scaled(row3(rates, 6), step))
    shell_speed = add(f.shell_speed, scaled(row3(rates, 9), step))
    return Flight(
        turned_by(f.turn, spin, step), add(f.position, scaled(speed, step)), speed, spin,
        turned_by(f.helmet_turn, helmet_spin, step), helmet_spin,
        add(f.inner, scaled(inner_speed, step)), inner_speed,
        add(f.shell, scaled(shell_speed, step)), shell_speed,
    )  # fmt: skip


@inlined
def place_of(f: Flight, carried: Carried) -> Vec:
    """Origin of the helmet's frame [m]."""
    return sub(f.inner, turned(matrix_of(f.helmet_turn), carried.inner.center))


@inlined
def frame_speed_of(f: Flight, carried: Carried) -> Vec:
    """Velocity of that [m/s]."""
    turning = cross(f.helmet_spin, carried.inner.center)
    return sub(f.inner_speed, turned(matrix_of(f.helmet_turn), turning))


@inlined
def put_joints(f: Flight, carried: Carried, qpos: FloatArray, qvel: FloatArray) -> None:
    """Write the joints from head to helmet."""
    first, first_v, sprung = carried.slide, carried.slide_velocity, carried.spring
    head_r, helmet_r = matrix_of(f.turn), matrix_of(f.helmet_turn)
    place, frame_speed = place_of(f, carried), frame_speed_of(f, carried)
    shift = turned_back(head_r, sub(place, f.position))
    put(qpos, first, shift)
    relative = times(conjugate(f.turn), f.helmet_turn)
    qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6] = relative
    speed = turned_back(head_r, sub(frame_speed, f.speed))
    put(qvel, first_v, sub(speed, cross(f.spin, shift)))
    put(qvel, first_v + 3, sub(f.helmet_spin, turned_back(helmet_r, turned(head_r, f.spin))))
    if sprung >= 0:
        middle = turned_back(helmet_r, sub(f.shell, place))
        put(qpos, sprung, sub(middle, carried.shell.center))
        speed = turned_back(helmet_r, sub(f.shell_speed, frame_speed))
        put(qvel, carried.spring_velocity, sub(speed, cross(f.helmet_spin, middle)))


@inlined
def put_bodies(f: Flight, carried: Carried, motion: Motion) -> None:
    """Write position, rotation and velocity of head and helmet (spring: of its shell)."""
    head, helmet, o = carried.head, carried.helmet, row3(motion.origin, 0)
    head_r, helmet_r = matrix_of(f.turn), matrix_of(f.helmet_turn)
    place, speed = place_of(f, carried), frame_speed_of(f, carried)
    spin = turned(helmet_r, f.helmet_spin)
    if carried.spring >= 0:
        center = turned(helmet_r, carried.shell.center)
        place, speed = sub(f.shell, center), sub(f.shell_speed, cross(spin, center))
    put(motion.position[helmet], 0, place)
    put(motion.velocity[helmet], 0, spin)
    put(motion.velocity[helmet], 3, add(speed, cross(spin, sub(o, place))))
    put(motion.position[head], 0, f.position)
    spin = turned(head_r, f.spin)
    put(motion.velocity[head], 0, spin)
    put(motion.velocity[head], 3, add(f.speed, cross(spin, sub(o, f.position))))
    for k in range(9):
        motion.rotation[helmet, k] = helmet_r[k]
        motion.rotation[head, k] = head_r[k]


@inlined
def pushed(f: Flight, carried: Carried, origin: Vec, loads: Loads, wrench: FloatArray) -> Push:
    """What the fine forces do to the helmet, and to the head.

    Args:
        origin: of moments in ``loads``.
        wrench: moment about the head's origin, then force on it, head axes, (6,); written.
    """
    head, helmet, first_v = carried.head, carried.helmet, carried.slide_velocity
    head_r, helmet_r = matrix_of(f.turn), matrix_of(f.helmet_turn)
    place = place_of(f, carried)
    fit = turned(head_r, row3(loads.generalised, first_v))
    torque = turned(helmet_r, row3(loads.generalised, first_v + 3))
    struck = row3(loads.wrenches[helmet], 0)
    moment = row3(loads.wrenches[helmet], 3)
    inner, shell = fit, struck
    about = add(cross(sub(place, f.inner), fit), torque)
    about = add(about, sub(moment, cross(sub(f.shell, origin), struck)))
    if carried.spring >= 0:
        pulled = turned(helmet_r, row3(loads.generalised, carried.spring_velocity))
        inner, shell = sub(inner, pulled), add(struck, pulled)
        about = sub(about, cross(sub(f.shell, f.inner), pulled))
    else:
        inner = add(inner, struck)
    # The joints' forces act back on the head.
    direct = row3(loads.wrenches[head], 0)
    moment = sub(row3(loads.wrenches[head], 3), cross(sub(f.position, origin), direct))
    moment = sub(moment, add(cross(sub(place, f.position), fit), torque))
    put(wrench, 0, turned_back(head_r, moment))
    put(wrench, 3, turned_back(head_r, sub(direct, fit)))
    return Push(inner, about, shell)


@inlined
def accelerate(
    f: Flight, carried: Carried, push: Push, rate: FloatArray, rates: FloatArray
) -> None:
    """Write the accelerations of a fine step.

    Args:
        rate: of the head, head axes, angular then linear, (6,).
        rates: see ``Carrier.rates``; written.
    """
    inner, gravity = carried.inner, carried.gravity
    gyration = cross(f.helmet_spin, turned(inner.inertia, f.helmet_spin))
    about = turned_back(matrix_of(f.helmet_turn), push.about)
    put(rates, 0, row3(rate, 0))
    put(rates, 3, row3(rate, 3))
    put(rates, 6, add(scaled(push.inner, 1.0 / inner.mass), gravity))
    if carried.spring >= 0:
        put(rates, 9, add(scaled(push.shell, 1.0 / carried.shell.mass), gravity))
    put(rates, 12, turned(inner.inverse, sub(about, gyration)))
