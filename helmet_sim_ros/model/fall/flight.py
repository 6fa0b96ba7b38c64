"""Free flight: the momentum that an integrator loses is given back.

Without contact a rider keeps his angular momentum about his centre of mass, which falls on a
parabola. Long steps of Euler's method do not know that. After each of them the whole body is
moved and turned as one, so that both hold to rounding; how its parts move against each other is
not touched. (A projection onto invariants: Hairer, Lubich & Wanner, Geometric Numerical
Integration, 2006, sec. IV.4.)
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force.bodies import Motion
from helmet_sim_ros.model.force.vector import Vec, cross, matrix, sub, turned_back

#: xx, yy, zz, xy, xz, yz of a symmetric matrix.
Symmetric = tuple[float, float, float, float, float, float]


class Flight(NamedTuple):
    """What the flight began with.

    Attributes:
        inertia: view of MuJoCo's ``cinert``: inertia of each body about ``Motion.origin``, (6)
            Ixx Iyy Izz Ixy Ixz Iyz, mass times arm (3), mass; (bodies, 10).
        gravity: (3,) [m/s^2].
        since: time of the start [s]; below 0: in contact; (1,).
        center, momentum, spin: of all, at the start: centre of mass [m], momentum [N s], angular
            momentum about it [N m s]; (3,) each.
    """

    inertia: FloatArray
    gravity: FloatArray
    since: FloatArray
    center: FloatArray
    momentum: FloatArray
    spin: FloatArray


def on_ground(model: mujoco.MjModel, data: mujoco.MjData) -> Flight:
    """No flight yet."""
    return Flight(
        data.cinert, model.opt.gravity, np.full(1, -1.0), np.zeros(3), np.zeros(3), np.zeros(3)
    )  # fmt: skip


@compiled
def momenta(flight: Flight, motion: Motion) -> tuple[float, Vec, Vec, Symmetric]:
    """Mass [kg], momentum [N s], angular momentum about the centre of mass [N m s], and the inertia
    of the whole about it [kg m^2]."""
    inertia, velocity = flight.inertia, motion.velocity
    mass = 0.0
    p0 = p1 = p2 = l0 = l1 = l2 = 0.0
    ixx = iyy = izz = ixy = ixz = iyz = 0.0
    for b in range(1, len(inertia)):
        xx, yy, zz, xy, xz, yz, hx, hy, hz, m = inertia[b]
        wx, wy, wz, vx, vy, vz = velocity[b]
        l0 += xx * wx + xy * wy + xz * wz + hy * vz - hz * vy
        l1 += xy * wx + yy * wy + yz * wz + hz * vx - hx * vz
        l2 += xz * wx + yz * wy + zz * wz + hx * vy - hy * vx
        p0 += m * vx + wy * hz - wz * hy
        p1 += m * vy + wz * hx - wx * hz
        p2 += m * vz + wx * hy - wy * hx
        ixx += xx
        iyy += yy
        izz += zz
        ixy += xy
        ixz += xz
        iyz += yz
        mass += m
    return mass, (p0, p1, p2), (l0, l1, l2), (ixx, iyy, izz, ixy, ixz, iyz)


@compiled
def solved(matrix: Symmetric, right: Vec) -> Vec:
    """x of A x = b for a positive definite matrix, by its adjugate."""
    xx, yy, zz, xy, xz, yz = matrix
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    scale = 1.0 / (xx * a + xy * b + xz * c)
    return (
        scale * (a * right[0] + b * right[1] + c * right[2]),
        scale * (b * right[0] + d * right[1] + e * right[2]),
        scale * (c * right[0] + e * right[1] + f * right[2]),
    )


@compiled
def begin(flight: Flight, motion: Motion, time: float) -> None:
    """Remember the present state, at ``time`` [s]."""
    _, momentum, spin, _ = momenta(flight, motion)
    flight.since[0] = time
    for k in range(3):
        flight.center[k] = motion.origin[k]
        flight.momentum[k] = momentum[k]
        flight.spin[k] = spin[k]


@compiled
def correct(flight: Flight, motion: Motion, time: float) -> None:
    """Move the root so that the whole has the momenta and the place it must have at ``time``."""
    mass, momentum, spin, whole = momenta(flight, motion)
    gone = time - flight.since[0]
    began = (flight.spin[0], flight.spin[1], flight.spin[2])
    turn = solved(whole, sub(began, spin))
    qpos, qvel = motion.qpos, motion.qvel
    root = (motion.position[1, 0], motion.position[1, 1], motion.position[1, 2])
    origin = (motion.origin[0], motion.origin[1], motion.origin[2])
    carried = cross(turn, sub(root, origin))
    own = turned_back(matrix(motion.rotation, 1), turn)
    for k in range(3):
        pulled = flight.gravity[k] * gone
        speed = (flight.momentum[k] - momentum[k]) / mass + pulled
        qvel[k] += speed + carried[k]
        qvel[3 + k] += own[k]
        place = flight.center[k] + gone * (flight.momentum[k] / mass + 0.5 * pulled)
        qpos[k] += place - origin[k]
