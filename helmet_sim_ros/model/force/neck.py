"""Torques of the neck's ball joints and force of its slide; no pose is singular.

A ball joint's angle is the rotation vector r of child against parent: its x and y components are
the bending to the side and forwards, z is the twist. The elastic energy U(r) has one stiffness per
sense, about the posture at the first touch; beyond an elliptic cone of motion and a range of twist
a stop adds to it. The torque on the child, in its own axes, is -J(r)^-T grad U, where J(r) is the
right Jacobian of SO(3) (w = J r'): it does the work -dU, and stays finite for every rotation.

Along the neck: linear up to a plateau, in compression and in tension, along which the neck yields:
it gives nothing back of what it yielded. A neck pressed far beyond what it has meets a last stop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import allocating, compiled
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.force.vector import Vec, add, cross, dot, scaled, sub

STOP_STIFFENS = math.radians(4.0)  # beyond the range, where a stop is twice as stiff; choice
STOP_DAMPING = 0.02  # s/rad; choice: 0.05, as other joints' stops, jolts the head on the sled
BOTTOM_DAMPING = 0.2  # s/m, as the body's contact with the ground

FLEXION, EXTENSION, LATERAL, TORSION = 0, 1, 2, 3


class CervicalSpine(NamedTuple):
    """Properties of the neck's n ball joints (n = 3, or 0 without a rider) and its slide.

    Attributes:
        qpos, qvel: first index of each ball joint in MuJoCo's qpos and qvel, (n,).
        slide: index of the slide in qpos and in qvel.
        rest: quaternion w, x, y, z of each joint at rest, (n, 4).
        stiffness: in flexion, extension, to the side, in torsion, (n, 4) [N m/rad].
        ranges: in the same order, (n, 4) [rad].
        stop_stiffness: in bending and torsion, (n, 2) [N m/rad].
        compression, tension: stiffness of the slide [N/m].
        plateaus: compression and tension at which the neck yields [N].
        bottom, bottom_stiffness: shortening at which skull and shoulders meet [m], and how [N/m].
        yielded: state: shortening that the neck keeps, < 0 where it was drawn out, (1,) [m].
    """

    qpos: NDArray[np.int64]
    qvel: NDArray[np.int64]
    slide: tuple[int, int]
    rest: FloatArray
    stiffness: FloatArray
    ranges: FloatArray
    stop_stiffness: FloatArray
    compression: float
    tension: float
    plateaus: tuple[float, float]
    bottom: float
    bottom_stiffness: float
    yielded: FloatArray

    def fresh(self) -> CervicalSpine:
        """The same neck before it yielded, with a state of its own."""
        return self._replace(yielded=np.zeros(1))


@compiled
def rotation_vector(w: float, x: float, y: float, z: float) -> Vec:
    """Rotation vector [rad] of a unit quaternion, at most pi long."""
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return factor * x, factor * y, factor * z


@compiled
def along(r: Vec, g: Vec) -> Vec:
    """J(r)^-T g: the direction in which the child's angular velocity, in its own axes, changes the
    rotation vector r along g.

    J(r)^-T = 1 - [r]/2 + c [r]^2, c = (1 - (t/2) cot(t/2)) / t^2, t = |r|.
    """
    square = dot(r, r)
    if square > 1e-4:
        half = 0.5 * math.sqrt(square)
        c = (1.0 - half * math.cos(half) / math.sin(half)) / square
    else:
        c = (1.0 + square / 60.0) / 12.0
    once = cross(r, g)
    return add(sub(g, scaled(once, 0.5)), scaled(cross(r, once), c))


@compiled
def bending_excess(bent: Vec, ranges: FloatArray) -> tuple[float, Vec]:
    """Bending beyond the elliptic cone of motion [rad], and its slope over the rotation vector."""
    rx, ry, _ = bent
    side, fore = ranges[LATERAL], ranges[FLEXION] if ry >= 0.0 else ranges[EXTENSION]
    reach = math.hypot(rx / side, ry / fore)
    if reach <= 1.0:
        return 0.0, (0.0, 0.0, 0.0)
    bend = math.hypot(rx, ry)
    radial, outwards = (1.0 - 1.0 / reach) / bend, bend / reach**3
    slope = (rx * (radial + outwards / side**2), ry * (radial + outwards / fore**2), 0.0)
    return bend * (1.0 - 1.0 / reach), slope


@compiled
def largest_excess(bent: FloatArray, ranges: FloatArray) -> float:
    """The largest :func:`bending_excess` [rad] of many rotation vectors, (n, 3)."""
    largest = 0.0
    for i in range(len(bent)):
        largest = max(largest, bending_excess((bent[i, 0], bent[i, 1], bent[i, 2]), ranges)[0])
    return largest


@compiled
def stop_torque(stiffness: float, excess: float, rate: float) -> float:
    """Torque [N m] of a stop passed by ``excess`` [rad] at ``rate`` [rad/s].

    K e (1 + (e/e0)^2), times 1 + c e' held between 0 and 2: a stop never pulls, and its damping
    stays small enough for an explicit step.
    """
    elastic = stiffness * excess * (1.0 + (excess / STOP_STIFFENS) ** 2)
    return elastic * min(2.0, max(0.0, 1.0 + STOP_DAMPING * rate))


@compiled
def elastic_length(neck: CervicalSpine, pressed: float, yielded: float) -> float:
    """The part of a shortening [m] that is elastic, the rest being yielded: it stays within what
    the two plateaus allow (an elastic-plastic element, the "play" operator)."""
    elastic = min(pressed - yielded, neck.plateaus[0] / neck.compression)
    return max(elastic, -neck.plateaus[1] / neck.tension)


@compiled
def axial_force(neck: CervicalSpine, length: float, rate: float) -> float:
    """Force along the slide [N], > 0 where it lengthens the neck; updates the yielded length.

    Args:
        length: of the slide, against the neck at rest [m].
        rate: of the length [m/s].
    """
    elastic = elastic_length(neck, -length, neck.yielded[0])
    neck.yielded[0] = -length - elastic
    force = elastic * (neck.compression if elastic > 0.0 else neck.tension)
    over = -length - neck.bottom
    if over > 0.0:
        force += neck.bottom_stiffness * over * min(2.0, max(0.0, 1.0 - BOTTOM_DAMPING * rate))
    return force


@compiled
def angles(neck: CervicalSpine, qpos: FloatArray, i: int) -> tuple[Vec, Vec]:
    """Rotation vectors [rad] of ball joint i: child against parent, and against its rest."""
    first = neck.qpos[i]
    w, x, y, z = qpos[first], qpos[first + 1], qpos[first + 2], qpos[first + 3]
    a, b, c, d = neck.rest[i]
    from_rest = rotation_vector(  # conj(rest) * q
        a * w + b * x + c * y + d * z,
        a * x - b * w - c * z + d * y,
        a * y + b * z - c * w - d * x,
        a * z - b * y + c * x - d * w,
    )
    return rotation_vector(w, x, y, z), from_rest


@compiled
def apply(neck: CervicalSpine, motion: Motion, loads: Loads) -> None:
    """Add the neck's torques [N m] and its axial force [N] to the generalised forces."""
    qpos, qvel, applied = motion.qpos, motion.qvel, loads.generalised
    for i in range(len(neck.qpos)):
        dof = neck.qvel[i]
        spin = (qvel[dof], qvel[dof + 1], qvel[dof + 2])
        bent, (sx, sy, sz) = angles(neck, qpos, i)
        fore = neck.stiffness[i, FLEXION if sy >= 0.0 else EXTENSION]
        pull = (-neck.stiffness[i, LATERAL] * sx, -fore * sy, -neck.stiffness[i, TORSION] * sz)
        torque = along((sx, sy, sz), pull)
        excess, slope = bending_excess(bent, neck.ranges[i])
        if excess > 0.0:
            axis = along(bent, slope)
            held = stop_torque(neck.stop_stiffness[i, 0], excess, dot(axis, spin))
            torque = sub(torque, scaled(axis, held))
        excess = abs(bent[2]) - neck.ranges[i, TORSION]
        if excess > 0.0:
            axis = along(bent, (0.0, 0.0, math.copysign(1.0, bent[2])))
            held = stop_torque(neck.stop_stiffness[i, 1], excess, dot(axis, spin))
            torque = sub(torque, scaled(axis, held))
        for k in range(3):
            applied[dof + k] += torque[k]
    if len(neck.qpos):
        slide, dof = neck.slide
        applied[dof] += axial_force(neck, qpos[slide], qvel[dof])


@compiled
def damping(neck: CervicalSpine, applied: FloatArray, bound: FloatArray) -> None:
    """Add to ``bound``, (nv,), by how much at most the stops' forces fall with their own velocity
    [N m s/rad, or N s/m along the slide].

    Args:
        applied: generalised forces, the neck's among them, (nv,).
    """
    for i in range(len(neck.qpos)):
        dof = neck.qvel[i]
        torque = (applied[dof] ** 2 + applied[dof + 1] ** 2 + applied[dof + 2] ** 2) ** 0.5
        for k in range(3):
            bound[dof + k] += STOP_DAMPING * torque
    if len(neck.qpos):
        dof = neck.slide[1]
        bound[dof] += BOTTOM_DAMPING * abs(applied[dof])


@compiled
def _stop_energy(stiffness: float, excess: float) -> float:
    return stiffness * (0.5 * excess**2 + 0.25 * excess**4 / STOP_STIFFENS**2)


@compiled
def _bent_energy(neck: CervicalSpine, qpos: FloatArray) -> float:
    """Elastic energy of the ball joints and their stops [J]."""
    energy = 0.0
    for i in range(len(neck.qpos)):
        bent, (sx, sy, sz) = angles(neck, qpos, i)
        fore = neck.stiffness[i, FLEXION if sy >= 0.0 else EXTENSION]
        energy += 0.5 * (
            neck.stiffness[i, LATERAL] * sx**2 + fore * sy**2 + neck.stiffness[i, TORSION] * sz**2
        )
        excess, _ = bending_excess(bent, neck.ranges[i])
        energy += _stop_energy(neck.stop_stiffness[i, 0], excess)
        excess = max(0.0, abs(bent[2]) - neck.ranges[i, TORSION])
        energy += _stop_energy(neck.stop_stiffness[i, 1], excess)
    return energy


@compiled
def _pressed_energy(neck: CervicalSpine, length: float, elastic: float) -> float:
    """Elastic energy of the slide [J] at its length and the elastic part of its shortening [m]."""
    energy = 0.5 * elastic**2 * (neck.compression if elastic > 0.0 else neck.tension)
    return energy + 0.5 * neck.bottom_stiffness * max(0.0, -length - neck.bottom) ** 2


@compiled
def held_energy(neck: CervicalSpine, qpos: FloatArray) -> float:
    """What the neck would give back now [J], with the yielded length that :func:`apply` left."""
    if not len(neck.qpos):
        return 0.0
    length = qpos[neck.slide[0]]
    elastic = elastic_length(neck, -length, neck.yielded[0])
    return _bent_energy(neck, qpos) + _pressed_energy(neck, length, elastic)


@allocating
def stored_energy(neck: CervicalSpine, positions: FloatArray) -> FloatArray:
    """What the neck would give back at each sample of an impact [J], (samples,).

    Args:
        positions: qpos of every sample since the first touch, (samples, nq).
    """
    energy = np.zeros(len(positions))
    yielded = 0.0
    for k in range(len(positions)):
        energy[k] = _bent_energy(neck, positions[k])
        if len(neck.qpos):
            length = positions[k, neck.slide[0]]
            elastic = elastic_length(neck, -length, yielded)
            yielded = -length - elastic
            energy[k] += _pressed_energy(neck, length, elastic)
    return energy
