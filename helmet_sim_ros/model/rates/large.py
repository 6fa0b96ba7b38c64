"""The body at its large step: kinematics, inertia, bias and slow forces at the middle of it."""

from __future__ import annotations

from typing import Any

from numba import types

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force import neck
from helmet_sim_ros.model.force.bodies import Loads, Motion, add_generalised, clear
from helmet_sim_ros.model.force.vector import add, cross, matrix, row, sub, turned_back
from helmet_sim_ros.model.loop import (
    Simulation,
    acceleration_,
    com_pos,
    energy_vel,
    factor_m,
    integrate_pos,
    kinematics,
    make_m,
    slow_forces,
    velocity_,
)
from helmet_sim_ros.model.rates.parts import ARM, GROWTH, SHORTEST, Carried, Carrier
from helmet_sim_ros.model.rates.turning import put

_solve_m: Any = types.ExternalFunction(
    "mj_solveM", types.void(types.intp, types.intp, types.intp, types.intp, types.int32)
)


@compiled
def joint_velocity(carrier: Carrier, slow: FloatArray, time: float, impulse: FloatArray,
                   out: FloatArray) -> None:  # fmt: skip
    """Velocities at a time [s] in the large step after an impulse on the head, (6,)."""
    start, response = carrier.velocity, carrier.response
    for j in range(len(out)):
        out[j] = start[j] + time * slow[j]
    for k in range(6):
        for j in range(len(out)):
            out[j] += response[k, j] * impulse[k]


@compiled
def renew(
    simulation: Simulation, carried: Carried, carrier: Carrier, length: float, looks: bool
) -> None:
    """Take kinematics, inertia, bias and slow forces at the middle of a large step.

    Args:
        simulation: whose loads become those of the slow forces.
        length: H [s].
        looks: whether the body's energy is asked for.

    ``engine.acceleration`` gets the slow acceleration, ``engine.energy`` the body's energy; qpos
    is as before, qvel that of the middle.
    """
    engine, motion, loads, forces, _ = simulation
    model, data = engine.model, engine.data
    qpos, qvel, mass, diagonal = motion.qpos, motion.qvel, engine.mass, engine.diagonal
    start, latest, mean = carrier.velocity, carrier.latest, carrier.mean
    count = 9 if carried.spring >= 0 else 6
    first, last = carried.slide_velocity, carried.slide_velocity + count
    # In a leapfrog velocities stand half a fine step before their positions, and so does the
    # middle of the kicks from start to end before the middle of the positions.
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
    if looks:
        energy_vel(model, data)
    velocity_(model, data)
    clear(loads)
    slow_forces(forces, length, motion, loads)
    # Damping by the trapezoidal rule: the joints' by the velocity at the start. The neck's stops
    # act by that of the middle; what they lack to the rule is made up for, to keep it stable.
    mean[:] = 0.0
    neck.damping(forces.neck, loads.generalised, mean)
    add_generalised(motion, loads, engine.chains)
    loads.generalised[first:last] = 0.0  # what the body pushes the helmet with acts on the head
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
        for i in range(6):
            carrier.before[k, i] = apparent[k, i]
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
    bias = carrier.scratch.bias
    bias[:] = 0.0
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
def hold(motion: Motion, loads: Loads, carried: Carried, carrier: Carrier, length: float) -> None:
    """Take up what pushes the head from outside in this large step, and how that changes: the neck
    does not carry it. ``length``: of the step [s]; before :func:`next_length`."""
    o, w, h = motion.origin, loads.wrenches[carried.head], loads.wrenches[carried.rest]
    force = (w[0] + h[0], w[1] + h[1], w[2] + h[2])
    arm = sub(row(motion.position, carried.head), (o[0], o[1], o[2]))
    moment = sub((w[3] + h[3], w[4] + h[4], w[5] + h[5]), cross(arm, force))
    before, held, holding = carrier.drift[6], carrier.held, carrier.holding
    apart = 0.5 * (before + length)
    for k in range(3):
        if before > 0.0:
            holding[k] = (moment[k] - held[k]) / apart
            holding[3 + k] = (force[k] - held[3 + k]) / apart
        held[k], held[3 + k] = moment[k], force[k]


@compiled
def next_length(carrier: Carrier, drift: FloatArray, length: float) -> float:
    """Length [s] of the large step after one of this ``length`` with this drift of the head.

    What the drift differs from its extrapolation is an error of the step, in velocity it grows
    with the third power of the length. Two steps are compared under the same load on the head: the
    damping of the body, which is the mean of a step, leaves more of the drift the longer a step
    is, and as much less of what the load does.
    """
    before, load = carrier.drift[6], carrier.scratch.wrench
    apart = 0.5 * (before + length)
    turn, speed = 0.0, 0.0
    for k in range(6):
        change = drift[k] - carrier.drift[k]
        for i in range(6):
            change += (carrier.apparent[k, i] - carrier.before[k, i]) * load[i]
        off = change - apart * carrier.slope[k]
        if k < 3:
            turn += off * off
        else:
            speed += off * off
        if before > 0.0:
            carrier.slope[k] = change / apart
        carrier.drift[k] = drift[k]
    carrier.drift[6] = length
    if before == 0.0:
        return SHORTEST
    error = length * (speed + ARM * ARM * turn) ** 0.5
    ratio = (carrier.tolerance / max(error, 1e-12)) ** (1.0 / 3.0)
    return float(min(carrier.longest, max(SHORTEST, length * min(GROWTH, ratio))))
