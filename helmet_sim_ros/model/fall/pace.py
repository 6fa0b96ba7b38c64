"""How long the next step of a fall may be: decided by distances, closing speeds and forces.

A strike of the head takes the fine steps of an impact, from shortly before the first touch on. The
body takes steps that press tissue by a small share of its thickness and change the speed of what
is pressed by little. Otherwise steps are long; none is longer than the way to the next touch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import Motion, rigid, velocity_at
from helmet_sim_ros.model.force.contact import Contact, center_of, touch
from helmet_sim_ros.model.force.liner import CrushingLiner
from helmet_sim_ros.model.force.tissue import FAST, elastic_force, resolving_step
from helmet_sim_ros.model.force.vector import Vec, add, dot, matrix, norm, row, sub, turned
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.shapes import signed_distance

SLACK = 0.01  # m, that a measured helmet may reach beyond its ellipsoid; choice
TINY = 1e-9  # s, by which a step that no strike asks for is longer than a fine one
CLOSE = 1e-3  # m, of a head to what it lies on, or rocks on
FARTHEST = 0.12  # m, from which on nothing touches within a step: 100 m/s for 1 ms
NEAR = 0.03  # m, of a part's sphere, from which on its closest point is looked for
TURN = 2.0  # times the arc on which that point moves over a sphere; a choice, parts are not spheres


class Limits(NamedTuple):
    """What bounds a step. All values are choices; ``bench/bench_falls.py`` shows what they do to
    peaks and cost.

    Attributes:
        free: longest step before a strike of the head [s]; ``calm``: after one, with what it loaded
            held [s]; ``lying``: with a bare head or the shell of a spring helmet on what it struck,
            a contact much stiffer than foam and tissue [s].
        body: shortest step that the body asks for [s], but for tissue pressed fast or to its end.
        depth_share: of a tissue's thickness, that a step may press [-].
        speed_change: of what is pressed in a step [m/s]; ``turn_change``: of a joint [rad/s].
        ahead: time before a touch of the head from which on steps are fine [s].
        after: time after the last sign of a strike up to which they are [s].
        quiet_force: on the helmet or in its spring, below which it lies or slides [N];
            ``quiet_speed``: towards what
            it lies on [m/s].
    """

    free: float = 5e-4
    calm: float = 1e-3
    lying: float = 5e-4
    body: float = 7e-5
    depth_share: float = 0.04
    speed_change: float = 0.3
    turn_change: float = 4.0
    ahead: float = 1e-3
    after: float = 3e-3
    quiet_force: float = 1000.0
    quiet_speed: float = 1.0


class Pace(NamedTuple):
    """What the choice of the step knows.

    Attributes:
        fine: step of an impact [s]; ``substeps`` of them make a dense sample.
        thin: time between the samples elsewhere [s].
        head: whether an ellipsoid belongs to helmet or head, (n,).
        stiffness: of the joints between head, liner and shell, (nv,) [N/m, N m/rad]: longer steps
            are implicit in it.
        pressed: what the shell's contact adds to it while it touches, (nv,) [N/m].
        inertia: that moves least against each of all joints, (nv,) [kg, kg m^2].
        damping: of all joints, (nv,) [N s/m, N m s/rad].
        hinges: degrees of freedom of the body's joints, (m,).
        still: kinetic energy below which the rider is at rest [J].
        limits: of a step.
    """

    fine: float
    substeps: int
    thin: float
    head: NDArray[np.bool_]
    stiffness: FloatArray
    pressed: FloatArray
    inertia: FloatArray
    damping: FloatArray
    hinges: NDArray[np.int64]
    still: float
    limits: Limits


@inlined
def closing(
    motion: Motion, body: int, point: Vec, normal: Vec, turning: float, shape: Vec
) -> float:
    """How fast a part of a body comes closer to a shape of that velocity at most [m/s].

    Args:
        point: of the part.
        turning: speed that its turn adds at most, per rad/s [m].
    """
    moving = rigid(motion, body)
    speed: float = -dot(sub(velocity_at(moving, point), shape), normal)
    return speed + norm(moving.spin) * turning


@inlined
def turn_ahead(motion: Motion, body: int, reach: float, limits: Limits) -> float:
    """What of its turn lets a part whose closest point is known come closer, per rad/s [m]: as it
    turns on for ``Limits.ahead``, another point is the closest."""
    spin: float = norm(rigid(motion, body).spin)
    return min(reach, TURN * reach * spin * limits.ahead)


@inlined
def gap_of(
    limits: Limits, contact: Contact, surface: Surface, k: int, motion: Motion, i: int
) -> tuple[float, float]:
    """Gap of ellipsoid i to shape k, or less [m], and how fast it closes at most [m/s]."""
    center, body = center_of(contact, motion, i), contact.body[i]
    distance, nx, ny, nz, _ = signed_distance(surface, k, center[0], center[1], center[2])
    reach, shape = contact.reach[i], row(surface.velocity, k)
    gap = distance - reach
    if gap > FARTHEST:
        return gap, 0.0
    if gap > NEAR:
        return gap, closing(motion, body, center, (nx, ny, nz), reach, shape)
    depth, point, normal = touch(contact, surface, k, motion, i)
    turning = turn_ahead(motion, body, reach, limits) if depth < 0.0 else 0.0
    return -depth, closing(motion, body, point, normal, turning, shape)


@inlined
def liner_gap(
    limits: Limits, liner: CrushingLiner, surface: Surface, k: int, motion: Motion
) -> tuple[float, float]:
    """The same of a foam helmet."""
    body = liner.helmet
    turn = matrix(motion.rotation, body)
    center = add(row(motion.position, body), turned(turn, liner.center))
    distance, nx, ny, nz, _ = signed_distance(surface, k, center[0], center[1], center[2])
    ax, ay, az = liner.semi_axes
    reach, shape = max(ax, ay, az), row(surface.velocity, k)
    slack = SLACK if liner.measured else 0.0
    gap = distance - reach - slack
    if gap > FARTHEST:
        return gap, 0.0
    if gap > NEAR:
        return gap, closing(motion, body, center, (nx, ny, nz), reach, shape)
    depth, point, normal = deepest_point(
        surface, k, center, motion.rotation[body], liner.semi_axes, liner.direction[k]
    )
    gap = -depth - slack
    turning = turn_ahead(motion, body, reach, limits) if gap > 0.0 else 0.0
    return gap, closing(motion, body, point, normal, turning, shape)


@inlined
def head_step(pace: Pace, gap: float, speed: float, longest: float) -> float:
    """The step that a part of the head asks for; ``pace.fine``: it strikes, or is about to.

    Args:
        gap: [m]; ``speed`` at which it closes [m/s].
        longest: step that is allowed otherwise [s].
    """
    limits = pace.limits
    if gap <= 0.0:
        if abs(speed) > limits.quiet_speed:
            return pace.fine
        return min(longest, limits.calm)
    if speed <= 0.0:
        return longest
    left = gap / speed
    if left < limits.ahead and speed > limits.quiet_speed:
        return pace.fine
    return min(longest, max(pace.fine, left - 0.5 * limits.ahead))


@inlined
def body_step(
    limits: Limits, contact: Contact, i: int, gap: float, speed: float, longest: float
) -> float:
    """The step that ellipsoid i of the body asks for [s]."""
    thickness = contact.thickness[i]
    fast = limits.depth_share * thickness / max(abs(speed), 1e-6)
    if gap > 0.0:
        if speed <= 0.0:
            return longest
        return min(longest, float(max(fast, 0.7 * gap / speed)))
    stiffness, straight, mass = contact.stiffness[i], contact.straight[i], contact.mass[i]
    force = FAST * elastic_force(stiffness, thickness, straight, -gap)
    slowed = max(limits.body, limits.speed_change * mass / max(force, 1e-6))
    resolved = resolving_step(stiffness, thickness, straight, -gap, mass)
    return float(min(longest, limits.calm, fast, slowed, resolved))


@compiled
def wanted(
    pace: Pace,
    contact: Contact,
    liner: CrushingLiner,
    surface: Surface,
    motion: Motion,
    acceleration: FloatArray,
    struck: float,
    held: bool,
) -> float:
    """The next step [s]; ``pace.fine``: the head strikes.

    Args:
        pace, contact, liner, surface, motion: present.
        acceleration: of all degrees of freedom in the last step.
        struck: force on the helmet or in its spring in the last step [N].
        held: whether the helmet was struck and is held, see ``Limits.calm``.
    """
    limits = pace.limits
    if struck > limits.quiet_force:
        return pace.fine
    step = limits.calm if held else limits.free
    body = step
    for dof in pace.hinges:
        turning = abs(acceleration[dof])
        if turning * step > limits.turn_change:
            body = step = max(limits.body, limits.turn_change / turning)
    foam = len(liner.columns.area) > 0
    for k in range(len(surface.kind)):
        for i in range(len(contact.body)):
            gap, speed = gap_of(limits, contact, surface, k, motion, i)
            if gap > FARTHEST:
                continue
            if pace.head[i]:
                step = min(step, head_step(pace, gap, speed, step))
                if gap < CLOSE:
                    step = min(step, limits.lying)
            else:
                body = min(body, body_step(limits, contact, i, gap, speed, body))
        if foam:
            gap, speed = liner_gap(limits, liner, surface, k, motion)
            if gap <= FARTHEST:
                step = min(step, head_step(pace, gap, speed, step))
    if step <= pace.fine:
        return pace.fine
    return max(min(step, body), pace.fine + TINY)
