"""Contact of body and shell with the surface: stiff normal law, Coulomb friction that sticks.

MuJoCo's own contacts are not used: their convex friction cone couples the normal force to the
slip speed. In a headform drop at 5 m/s it more than doubled the first force peak when 20 m/s of
tangential speed were added, which Coulomb friction cannot do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import (
    BODY,
    HELMET,
    Loads,
    Motion,
    count_surface,
    push,
    rigid,
    velocity_at,
)
from helmet_sim_ros.model.force.friction import TANGENTIAL_SHARE, friction_force, normal_force
from helmet_sim_ros.model.force.tissue import elastic_energy as tissue_energy
from helmet_sim_ros.model.force.tissue import elastic_force, resisting
from helmet_sim_ros.model.force.vector import (
    Vec,
    across,
    add,
    cross,
    dot,
    matrix,
    row,
    scaled,
    sub,
    turned,
)
from helmet_sim_ros.model.surface.carrier import react, share_of_body
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import signed_distance


class Contact(NamedTuple):
    """Ellipsoids (spheres among them) that may touch the surface; row i belongs to ellipsoid i.

    Attributes:
        helmet: MuJoCo's index of the helmet body.
        body: MuJoCo body that carries the ellipsoid, (n,).
        center: in that body's frame, (n, 3) [m].
        semi_axes: along the body's axes, (n, 3) [m].
        reach: the longest of them, (n,) [m].
        stiffness: k [N/m], (n,).
        damping: c [s/m], (n,).
        returned: share of the elastic energy that unloading gives back, (n,) [-]: below the deepest
            point so far the stiffness is k / returned (Walton & Braun, J. Rheol. 30, 1986).
        friction: mu [-], (n,); negative: that of the surface.
        thickness: of the tissue, see :mod:`helmet_sim_ros.model.force.tissue`, (n,) [m];
            infinite: a linear spring, the shell's.
        straight: share of it beyond which its law is a straight line, (n,) [-].
        mass: the least that a force on the ellipsoid moves, (n,) [kg].
        relaxation: damping over stiffness along the surface, (n,) [s].
        stick: elastic deflection on each shape of the surface, world axes, (n, shapes, 3) [m];
            state.
        peak: deepest in each shape since they touched, (n, shapes) [m]; state.
        direction: to the deepest point on each shape, in body axes, scaled by the semi-axes,
            (n, shapes, 3); state, from which the next search starts.
    """

    helmet: int
    body: NDArray[np.int64]
    center: FloatArray
    semi_axes: FloatArray
    reach: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    returned: FloatArray
    friction: FloatArray
    thickness: FloatArray
    straight: FloatArray
    mass: FloatArray
    relaxation: FloatArray
    stick: FloatArray
    peak: FloatArray
    direction: FloatArray

    def fresh(self, shapes: int) -> Contact:
        """The same with no deflection yet, for a surface of that many shapes."""
        size = (len(self.body), shapes, 3)
        return self._replace(
            stick=np.zeros(size), peak=np.zeros(size[:2]), direction=np.zeros(size)
        )

    def parts(self, count: int) -> tuple[Contact, Contact]:
        """The first ``count`` ellipsoids and the others, with the same state."""
        arrays = self[1:]
        first, others = (
            Contact(self.helmet, *(array[rows] for array in arrays))  # type: ignore[arg-type]
            for rows in (slice(count), slice(count, None))
        )
        return first, others


@inlined
def center_of(contact: Contact, motion: Motion, i: int) -> Vec:
    """Centre of an ellipsoid, world axes [m]."""
    body = contact.body[i]
    return add(
        row(motion.position, body), turned(matrix(motion.rotation, body), row(contact.center, i))
    )


@inlined
def distance_of(contact: Contact, surface: Surface, k: int, motion: Motion, i: int) -> float:
    """Distance of an ellipsoid's centre from shape k of the surface [m]."""
    x, y, z = center_of(contact, motion, i)
    distance: float = signed_distance(surface, k, x, y, z)[0]
    return distance


@inlined
def touch(
    contact: Contact, surface: Surface, k: int, motion: Motion, i: int
) -> tuple[float, Vec, Vec]:
    """How deep ellipsoid i lies in shape k of the surface [m] (0 or less: no contact), its deepest
    point, and the shape's outward normal there, world axes."""
    return deepest_point(
        surface, k, center_of(contact, motion, i), motion.rotation[contact.body[i]],
        row(contact.semi_axes, i), contact.direction[i, k],
    )  # fmt: skip


@compiled
def deepest(contact: Contact, surface: Surface, motion: Motion) -> tuple[int, int, float]:
    """Ellipsoid and shape that overlap most, and how deep [m]; -1, -1, 0: none overlap."""
    which, where, most = -1, -1, 0.0
    for k in range(len(surface.kind)):
        for i in range(len(contact.body)):
            if distance_of(contact, surface, k, motion, i) < contact.reach[i]:
                depth = touch(contact, surface, k, motion, i)[0]
                if depth > most:
                    which, where, most = i, k, depth
    return which, where, most


@inlined
def effective_depth(contact: Contact, i: int, k: int, depth: float) -> float:
    """The depth at which a purely elastic contact has the force of the present one [m]."""
    peak = contact.peak[i, k]
    if depth >= peak:
        return depth
    elastic: float = max(0.0, peak - (peak - depth) / contact.returned[i])
    return elastic


@compiled
def elastic_energy(contact: Contact, surface: Surface, motion: Motion) -> float:
    """Energy that the normal forces would still give back [J]; ``contact.peak`` is carried on."""
    energy = 0.0
    for k in range(len(surface.kind)):
        for i in range(len(contact.body)):
            if distance_of(contact, surface, k, motion, i) < contact.reach[i]:
                depth = max(0.0, touch(contact, surface, k, motion, i)[0])
                contact.peak[i, k] = max(contact.peak[i, k], depth) if depth > 0.0 else 0.0
                depth = effective_depth(contact, i, k, depth)
                energy += contact.returned[i] * tissue_energy(
                    contact.stiffness[i], contact.thickness[i], contact.straight[i], depth
                )
            else:
                contact.peak[i, k] = 0.0
    return energy


@compiled
def stick_energy(contact: Contact) -> float:
    """Elastic energy of the deflections along the surface [J]."""
    energy = 0.0
    for i in range(len(contact.body)):
        square = 0.0
        for k in range(contact.stick.shape[1]):
            s = row(contact.stick[i], k)
            square += dot(s, s)
        energy += 0.5 * TANGENTIAL_SHARE * contact.stiffness[i] * square
    return energy


@inlined
def apply(contact: Contact, surface: Surface, step: float, motion: Motion, loads: Loads) -> None:
    """Add the surface's forces on all ellipsoids.

    Args:
        contact: constants and state; the state is changed in place.
        surface: what they touch.
        step: time step [s].
        motion, loads: of the bodies.
    """
    reach, stick, peak = contact.reach, contact.stick, contact.peak
    for k in range(len(surface.kind)):
        for i in range(len(reach)):
            if distance_of(contact, surface, k, motion, i) < reach[i]:
                press(contact, surface, k, motion, loads, i, step)
            else:  # out of reach in any orientation
                stick[i, k, 0] = stick[i, k, 1] = stick[i, k, 2] = peak[i, k] = 0.0


@inlined
def press(
    contact: Contact, surface: Surface, k: int, motion: Motion, loads: Loads, i: int, step: float
) -> None:
    """Add the force of shape k on ellipsoid i."""
    stick = contact.stick[i, k]
    depth, point, normal = touch(contact, surface, k, motion, i)
    if depth <= 0.0:
        stick[:] = 0.0
        contact.peak[i, k] = 0.0
        return
    if contact.body[i] != contact.helmet:
        depth *= share_of_body(surface, k, contact.stiffness[i])
    contact.peak[i, k] = max(contact.peak[i, k], depth)
    depth = effective_depth(contact, i, k, depth)
    body, stiffness = contact.body[i], contact.stiffness[i]
    velocity = sub(velocity_at(rigid(motion, body), point), row(surface.velocity, k))
    rate = -dot(velocity, normal)
    if contact.thickness[i] == math.inf:
        pressed = normal_force(stiffness, contact.damping[i], depth, rate)
    else:
        elastic = elastic_force(stiffness, contact.thickness[i], contact.straight[i], depth)
        pressed = resisting(elastic, contact.damping[i], rate, step, contact.mass[i])
    mu = contact.friction[i] if contact.friction[i] >= 0.0 else surface.friction[k]
    friction = friction_force(
        TANGENTIAL_SHARE * stiffness, contact.relaxation[i] - motion.ahead, mu * pressed,
        across(velocity, normal), normal, step, stick,
    )  # fmt: skip
    force = add(scaled(normal, pressed), friction)
    push(motion, loads, body, point, force)
    receiver = HELMET if body == contact.helmet else BODY
    if receiver == HELMET:
        react(surface, k, force)
    count_surface(loads, receiver, force, cross(point, force), friction)
