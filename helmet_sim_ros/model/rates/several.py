"""The stepping loop at several rates."""

from __future__ import annotations

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force import liner, shell
from helmet_sim_ros.model.force.bodies import Loads, clear
from helmet_sim_ros.model.force.vector import (
    add,
    cross,
    dot,
    matrix_of,
    row3,
    scaled,
    sub,
    turned,
    turned_back,
    write,
)
from helmet_sim_ros.model.loop import WATCHED, Rows, Simulation, fast_forces, integrate_pos
from helmet_sim_ros.model.rates.flight import (
    Flight,
    accelerate,
    begun,
    present,
    pushed,
    put_bodies,
    put_joints,
    stepped,
)
from helmet_sim_ros.model.rates.large import head_rate, hold, joint_velocity, next_length, renew
from helmet_sim_ros.model.rates.parts import Carried, Carrier, Rates
from helmet_sim_ros.model.rates.turning import put


@inlined
def kinetic_energy(flight: Flight, carried: Carried, body: float) -> float:
    """Of body, helmet and shell [J]; ``body``: with the head, of the large step."""
    energy: float = body + 0.5 * carried.inner.mass * dot(flight.inner_speed, flight.inner_speed)
    if carried.spring >= 0:
        energy += 0.5 * carried.shell.mass * dot(flight.shell_speed, flight.shell_speed)
    return energy


@inlined
def no_helmet(carried: Carried, velocity: FloatArray) -> None:
    """Set the velocities of the joints between head and helmet to zero."""
    velocity[carried.slide_velocity : carried.slide_velocity + 6] = 0.0
    if carried.spring >= 0:
        velocity[carried.spring_velocity : carried.spring_velocity + 3] = 0.0


@inlined
def sense(
    now: Flight, carried: Carried, carrier: Carrier, since: float, sensors: FloatArray
) -> None:
    """Write what sensors say of head and neck.

    Args:
        now: with the velocities of the present.
        carrier: its scratch has the head's acceleration and the wrench of the fine forces on it.
        since: time since the middle of the large step [s].
        sensors: MuJoCo's; written.
    """
    rate, wrench, gauges, skull = (
        carrier.scratch.rate, carrier.scratch.wrench, carried.gauges, carried.skull
    )  # fmt: skip
    head_r, alpha = matrix_of(now.turn), row3(rate, 0)
    felt = sub(row3(rate, 3), turned_back(head_r, carried.gravity))
    put(sensors, gauges.head_position, now.position)
    g = gauges.head_orientation
    sensors[g], sensors[g + 1], sensors[g + 2], sensors[g + 3] = now.turn
    g = gauges.helmet_orientation
    sensors[g], sensors[g + 1], sensors[g + 2], sensors[g + 3] = now.helmet_turn
    put(sensors, gauges.head_velocity, now.speed)
    put(sensors, gauges.head_angular_velocity, turned(head_r, now.spin))
    put(sensors, gauges.head_specific_force, turned(head_r, felt))
    put(sensors, gauges.head_angular_acceleration, turned(head_r, alpha))
    if gauges.neck_force < 0:
        return
    middle, spin = skull.center, now.spin
    at_center = add(felt, add(cross(alpha, middle), cross(spin, cross(spin, middle))))
    held, holding = carrier.held, carrier.holding
    held_force = add(row3(held, 3), scaled(row3(holding, 3), since))
    held_moment = add(row3(held, 0), scaled(row3(holding, 0), since))
    others = add(turned_back(head_r, held_force), row3(wrench, 3))
    other_moment = add(turned_back(head_r, held_moment), row3(wrench, 0))
    carrying = sub(scaled(at_center, skull.mass), others)
    bending = add(turned(skull.inertia, alpha), cross(spin, turned(skull.inertia, spin)))
    bending = sub(bending, sub(other_moment, cross(middle, others)))
    put(sensors, gauges.neck_force, carrying)
    put(
        sensors, gauges.neck_torque,
        add(bending, cross(sub(middle, carried.neck_site), carrying)),
    )  # fmt: skip


@inlined
def write_row(
    simulation: Simulation, carried: Carried, loads: Loads, velocity: FloatArray, rows: Rows, i: int
) -> None:
    """Write row i: positions, loads and sensors as they stand.

    Args:
        simulation: its loads are those of the slow forces; ``loads``: of the fine ones.
        velocity: of the body's joints, (nv,).
    """
    engine, motion, slow_loads, forces, _ = simulation
    write(rows.qpos[i], motion.qpos)
    write(rows.qvel[i], velocity)
    for j in range(carried.slide_velocity, carried.slide_velocity + 6):
        rows.qvel[i, j] = motion.qvel[j]
    if carried.spring >= 0:
        for j in range(carried.spring_velocity, carried.spring_velocity + 3):
            rows.qvel[i, j] = motion.qvel[j]
    else:
        liner.crush(forces.liner, forces.surface, motion, rows.crush[i])
    write(rows.sensors[i], engine.sensors)
    write(rows.coupling[i], loads.coupling)
    write(rows.spring[i], loads.spring)
    for k in range(2):
        for j in range(rows.surface.shape[2]):
            rows.surface[i, k, j] = loads.surface[k, j] + slow_loads.surface[k, j]


@inlined
def finish(carrier: Carrier, slow: FloatArray) -> None:
    """Carry the joints' accelerations to the end of a large step."""
    wrench, latest = carrier.scratch.wrench, carrier.latest
    for j in range(len(latest)):
        value = slow[j]
        for k in range(6):
            value += carrier.response[k, j] * wrench[k]
        latest[j] = value


@compiled
def advance_several(simulation: Simulation, rates: Rates, rows: Rows, last: int) -> int:
    """Step until sample ``last`` is reached or passed; each row is the state before its step.

    Args:
        simulation: whose clock has the fine step, and whose loads are those of the slow forces.
        rates: of it.
        rows: samples to write.

    Returns:
        The number of samples written, or the index of the first sample at or after which the state
        has left physics.
    """
    engine, motion, slow_loads, forces, clock = simulation
    carried, carrier, loads = rates
    step, late, substeps = clock.step, 0.5 * clock.step, clock.substeps
    qpos, qvel, slow, mean = motion.qpos, motion.qvel, engine.acceleration, carrier.mean
    foam, bends = carried.spring < 0, shell.spreads(forces.shell, forces.surface)
    twist, drift, turning, _, _, rate, wrench, impulse, impulses, average = carrier.scratch
    total = len(rows.qpos) * substeps
    while carrier.steps[0] < min(last * substeps, total):
        done = carrier.steps[0]
        count = min(carrier.steps[1], total - done)
        length = count * step
        way, looks = 0.5 * (length - step), done >= carrier.steps[2]
        write(carrier.position, qpos)
        write(carrier.velocity, qvel)
        renew(simulation, carried, carrier, length, looks)
        head_rate(motion, carried, carrier, slow, twist, drift, turning)
        hold(motion, slow_loads, carried, carrier, length)
        following = next_length(carrier, drift, length)
        write(qpos, carrier.position)
        write(qvel, carrier.velocity)
        flight = begun(motion, carried, carrier, length, step)
        if looks:
            carrier.steps[2] = done + WATCHED * substeps
            elapsed = done * step
            most = clock.energy + elapsed * (clock.power + elapsed * clock.growth)
            if not kinetic_energy(flight, carried, engine.energy[1]) <= most:
                return int(np.ceil(done / substeps))
        impulse[:] = 0.0
        impulses[:] = 0.0
        gathered, moments = 0, 0.0
        for n in range(count):
            time = n * step
            now = present(flight, carrier.rates, late)
            put_joints(now, carried, qpos, qvel)
            put_bodies(now, carried, motion)
            clear(loads)
            fast_forces(forces, foam, bends, step, motion, loads)
            push = pushed(now, carried, row3(motion.origin, 0), loads, wrench)
            for k in range(6):
                value = drift[k] + (time - way) * carrier.slope[k]
                for i in range(6):
                    value += carrier.apparent[k, i] * wrench[i]
                rate[k] = value
            if (done + n) % substeps == 0:
                sense(now, carried, carrier, time - way, engine.sensors)
                for k in range(6):
                    average[k] = impulse[k] + late * wrench[k]
                joint_velocity(carrier, slow, time + late, average, mean)
                write_row(simulation, carried, loads, mean, rows, (done + n) // substeps)
            accelerate(now, carried, push, rate, carrier.rates)
            if not abs(carrier.rates.sum()) < 1e12:  # also true for NaN
                return int(np.ceil((done + n) / substeps))
            flight = stepped(flight, carrier.rates, step)
            for k in range(6):
                impulse[k] += step * wrench[k]
                impulses[k] += impulse[k]
            gathered += 1
            moments += time + step
            if n == count - 1 or (done + n + 1) % substeps == 0:
                for k in range(6):
                    average[k] = impulses[k] / gathered
                joint_velocity(carrier, slow, moments / gathered, average, mean)
                no_helmet(carried, mean)
                integrate_pos(engine.model, qpos.ctypes.data, mean.ctypes.data, gathered * step)
                impulses[:] = 0.0
                gathered, moments = 0, 0.0
        # The joints of the body by their own, of the helmet from the poses.
        joint_velocity(carrier, slow, length, impulse, qvel)
        put_joints(flight, carried, qpos, qvel)
        finish(carrier, slow)
        carrier.steps[0] = done + count
        carrier.steps[1] = max(1, int(following / step + 1e-9))
    return int(-(-carrier.steps[0] // substeps))
