"""The stepping loop at several rates."""

from __future__ import annotations

import numpy as np

from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force import liner, shell
from helmet_sim_ros.model.force.bodies import clear
from helmet_sim_ros.model.force.vector import (
    add,
    cross,
    dot,
    matrix,
    matrix_of,
    quaternion,
    row,
    scaled,
    sub,
    turned,
    turned_back,
    write,
)
from helmet_sim_ros.model.loop import Rows, Simulation, fast_forces, integrate_pos
from helmet_sim_ros.model.rates.large import head_rate, joint_velocity, next_length, renew
from helmet_sim_ros.model.rates.parts import Rates
from helmet_sim_ros.model.rates.turning import conjugate, put, times, turned_by


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
    model, step = engine.model, clock.step
    qpos, qvel, slow = motion.qpos, motion.qvel, engine.acceleration
    foam, bends = carried.spring < 0, shell.spreads(forces.shell, forces.surface)
    first, chest, helmet = carried.slide, carried.head, carried.helmet
    first_v, spring, spring_v = carried.slide_velocity, carried.spring, carried.spring_velocity
    skull, inner, struck_shell, gauges = (
        carried.skull, carried.inner, carried.shell, carried.gauges
    )  # fmt: skip
    gravity, apparent = carried.gravity, carrier.apparent
    start_q, start_v, mean, latest = (
        carrier.position, carrier.velocity, carrier.mean, carrier.latest
    )  # fmt: skip
    twist, drift, turning, _, back, rate, wrench, impulse, impulses, average = carrier.scratch
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
        write(start_q, qpos)
        write(start_v, qvel)
        renew(simulation, carried, carrier, length)
        head_rate(motion, carried, carrier, slow, twist, drift, turning)
        following = next_length(carrier, drift, length)
        o = (motion.origin[0], motion.origin[1], motion.origin[2])
        # The head's pose at the start of the step, back from the middle; its velocity half a fine
        # step before.
        way, late = 0.5 * (length - step), 0.5 * step
        back[:] = 0.0
        for n in range(len(carried.chain)):
            j = carried.chain[n]
            for k in range(6):
                back[k] += carrier.jacobian[k, j] * latest[j]
        for k in range(6):
            back[k] = twist[k] + 0.5 * (way + step) * back[k] - 0.5 * way * turning[k]
            twist[k] -= 0.5 * length * turning[k]
        spin = (back[0], back[1], back[2])
        head_q = quaternion(carrier.quaternion[chest], 0)
        middle_r = matrix(motion.rotation, chest)
        head_q = turned_by(head_q, spin, -way)
        head_p = sub(
            row(motion.position, chest),
            scaled(turned(middle_r, (back[3], back[4], back[5])), way),
        )
        head_v = turned(middle_r, (twist[3], twist[4], twist[5]))
        # What pushes head and helmet from outside is not carried by the neck.
        w, h = slow_loads.wrenches[chest], slow_loads.wrenches[carried.rest]
        held = (w[0] + h[0], w[1] + h[1], w[2] + h[2])
        held_moment = (w[3] + h[3], w[4] + h[4], w[5] + h[5])
        held_moment = sub(held_moment, cross(sub(head_p, o), held))
        # The helmet's own state from its joints.
        write(qpos, start_q)
        write(qvel, start_v)
        head_r = matrix_of(head_q)
        helmet_q = times(head_q, quaternion(qpos, first + 3))
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
            # Velocities of the present: half a step of acceleration beyond the leapfrog's.
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
            qw, qx, qy, qz = times(conjugate(head_q), helmet_q)
            qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6] = qw, qx, qy, qz
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
            fast_forces(forces, foam, bends, step, motion, loads)
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
                        add(bending, cross(sub(middle, carried.neck_site), carrying)),
                    )  # fmt: skip
                for k in range(6):
                    average[k] = impulse[k] + late * wrench[k]
                joint_velocity(carrier, slow, time + late, average, mean)
                write(rows.qpos[i], qpos)
                write(rows.qvel[i], mean)
                for j in range(first_v, first_v + 6):
                    rows.qvel[i, j] = qvel[j]
                if not foam:
                    for j in range(spring_v, spring_v + 3):
                        rows.qvel[i, j] = qvel[j]
                write(rows.sensors[i], sensors)
                write(rows.coupling[i], loads.coupling)
                write(rows.spring[i], loads.spring)
                for k in range(2):
                    for j in range(rows.surface.shape[2]):
                        rows.surface[i, k, j] = loads.surface[k, j] + slow_loads.surface[k, j]
                if foam:
                    liner.crush(forces.liner, forces.surface, motion, rows.crush[i])
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
        qw, qx, qy, qz = times(conjugate(head_q), helmet_q)
        qpos[first + 3], qpos[first + 4], qpos[first + 5], qpos[first + 6] = qw, qx, qy, qz
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
    return int(-(-carrier.steps[0] // clock.substeps))
