"""The head in its helmet: comfort padding and the head's surface under local pressure, chin strap.

The head's surface is an ellipsoid inside the liner; patches spread over the part of it that the
helmet covers. At each patch the padding is compressed by how far the liner has come towards the
head, sheared by how far it has moved along it, and slips where the shear exceeds friction times
the *local* pressure. The strap runs on both sides from the helmet to the chin and pulls only.

Everything acts between two bodies, so it is applied to the six joint axes that join them: its sum
on both is zero to the last bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.bodies import Loads, Motion
from helmet_sim_ros.model.force.friction import friction_force
from helmet_sim_ros.model.force.vector import (
    Vec,
    across,
    add,
    cross,
    dot,
    matrix_of,
    norm,
    quaternion,
    row,
    scaled,
    sub,
    turned,
    turned_back,
)
from helmet_sim_ros.model.head_surface import HeadSurface
from helmet_sim_ros.model.helmet import Helmet

#: Share of the densification strain beyond which a padding's law goes on as a straight line.
LINEAR_FROM = 0.9
#: m, least way on which a compressed padding unloads: skin and skull give way too (a choice).
ELASTIC = 0.5e-3
#: Pa/m, no padding with skin and skull unloads more steeply, or is stiffer in shear (a choice: what
#: the step resolves; a friction of 1 MPa shears it by 0.25 mm).
STIFFEST = 4e9
#: s, in which a padding recovers from its compression: longer than an impact, shorter than the time
#: to the next one (a choice; slow-recovery foams take a second).
RECOVERY = 0.05


class Padding(NamedTuple):
    """Comfort padding and head surface as one layer in compression and shear.

    Attributes:
        thickness: of the padding at rest [m].
        modulus: of the padding, first compression [Pa].
        densification: strain at which its pores are closed [-].
        returned: share of the energy of compression that it gives back [-].
        damping: c of the pressure p + c v min(p, E) for a rate of compression v [s/m].
        preload: compression on the head at rest [m].
        shear: modulus of the padding in shear over that in compression [-]: what compresses it
            stiffens it in shear alike.
        skin: compliance in shear of the head's surface [m/Pa].
        relaxation: damping over stiffness in shear [s].
        friction: of the head's surface in the liner [-].
    """

    thickness: float
    modulus: float
    densification: float
    returned: float
    damping: float
    preload: float
    shear: float
    skin: float
    relaxation: float
    friction: float


class Strap(NamedTuple):
    """Chin strap and cheek straps.

    Attributes:
        anchor: on the helmet, left side, helmet frame [m]; the right one mirrors it.
        chin: on the head, head frame [m].
        length: at which a side is taut [m].
        stiffness: of each side [N/m]; ``damping`` [N s/m].
    """

    anchor: Vec
    chin: Vec
    length: float
    stiffness: float
    damping: float


class Fit(NamedTuple):
    """How a head sits in its helmet.

    Attributes:
        slide, slide_velocity: index of the first of the helmet's three slides against the head, in
            the generalised positions and velocities; a ball joint follows them.
        padding, strap: constants.
        axes: semi-axes of the head's surface, padding included [m]; ``center`` [m], head frame.
        point: patches on that surface, helmet frame, (n, 3) [m].
        area: (n,) [m^2].
        stick: shear deflection, head axes, (n, 3) [m]; state.
        deepest: largest compression, recovering, (n,) [m]; state.
        mass: the least that shear moves against the head: along the slides, or turning, at the
            farthest patch [kg].
        sheared: stiffness in shear of all patches in the last step [N/m], (1,); state.
        pressing: how hard head and helmet press on each other, all sides together, (1,) [N]; their
            stiffness against each other is at most this over :data:`ELASTIC`.
    """

    slide: int
    slide_velocity: int
    padding: Padding
    strap: Strap
    axes: Vec
    center: Vec
    point: FloatArray
    area: FloatArray
    stick: FloatArray
    deepest: FloatArray
    mass: float
    sheared: FloatArray
    pressing: FloatArray


def padding_of(helmet: Helmet, surface: HeadSurface) -> Padding:
    """The layer between a helmet's liner and a head with some surface."""
    pad = helmet.padding
    skin = surface.thickness / surface.shear_modulus if surface.shear_modulus else 0.0
    return Padding(
        pad.thickness, pad.modulus, pad.densification, pad.energy_returned, pad.damping,
        pad.preload, pad.shear_modulus / pad.modulus, skin, pad.relaxation, surface.friction,
    )  # fmt: skip


def fit(helmet: Helmet, surface: HeadSurface, slide: int, slide_velocity: int) -> Fit:
    """A helmet at rest on a head.

    Args:
        helmet: its liner's inner surface is the shell less the mean thickness of each axis.
        surface: of the head.
        slide, slide_velocity: see :class:`Fit`.
    """
    shell, liner = helmet.shell, helmet.liner
    front, back, side, top = (
        liner.zone_thickness(zone) for zone in ("front", "back", "side", "top")
    )
    a, b, c = shell.semi_axes
    axes = (a - 0.5 * (front + back), b - side, c - top)
    # The left half of a Fibonacci lattice about the y axis, mirrored: a head has two equal sides.
    half = helmet.padding.patches // 2
    n, index = 2 * half, np.arange(half)
    left = 1.0 - (2.0 * index + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - left**2)
    u = np.column_stack([ring * np.cos(turn), left, ring * np.sin(turn)])
    u = np.vstack([u, u * [1.0, -1.0, 1.0]])
    point = u * axes
    area = np.prod(axes) * np.linalg.norm(u / axes, axis=1) * 4.0 * np.pi / n
    covered = point[:, 2] + shell.center[2] >= helmet.padding.lowest
    point, area = point[covered] + np.array(shell.center), area[covered]
    strap = helmet.strap
    length = float(np.linalg.norm(np.subtract(strap.anchor, strap.chin))) + strap.slack
    return Fit(
        slide, slide_velocity, padding_of(helmet, surface),
        Strap(strap.anchor, strap.chin, length, strap.stiffness, strap.damping),
        axes, shell.center, np.ascontiguousarray(point), np.ascontiguousarray(area),
        np.zeros((len(area), 3)), np.zeros(len(area)),
        min(helmet.fitted_mass, min(helmet.inertia) / max(axes) ** 2), np.zeros(1), np.zeros(1),
    )  # fmt: skip


@inlined
def pressure(padding: Padding, compression: float) -> float:
    """Pressure of the padding [Pa] at a compression [m]: E e / (1 - e / e_d), an initial slope E
    and closed pores at e_d; a straight line beyond ``LINEAR_FROM`` e_d."""
    if compression <= 0.0:
        return 0.0
    strain = compression / padding.thickness
    edge = LINEAR_FROM * padding.densification
    if strain <= edge:
        return padding.modulus * strain / (1.0 - strain / padding.densification)
    at_edge = padding.modulus * edge / (1.0 - LINEAR_FROM)
    return at_edge + padding.modulus / (1.0 - LINEAR_FROM) ** 2 * (strain - edge)


@inlined
def energy(padding: Padding, compression: float) -> float:
    """Energy per area [J/m^2] up to a compression [m], the integral of :func:`pressure`."""
    strain, limit = compression / padding.thickness, padding.densification
    edge = LINEAR_FROM * limit
    share = min(strain, edge) / limit
    taken = padding.modulus * limit * limit * (-share - math.log(1.0 - share))
    if strain > edge:
        at_edge = padding.modulus * edge / (1.0 - LINEAR_FROM)
        slope = padding.modulus / (1.0 - LINEAR_FROM) ** 2
        taken += (at_edge + 0.5 * slope * (strain - edge)) * (strain - edge)
    return taken * padding.thickness


@inlined
def way_back(padding: Padding, largest: float, full: float) -> float:
    """The way [m] on which the padding unloads from a compression [m] of pressure ``full`` [Pa];
    so long at most that it gives back all that it took up."""
    lossless = 2.0 * energy(padding, largest) / full
    return min(lossless, max(padding.returned * lossless, ELASTIC, full / STIFFEST))


@inlined
def shear_stiffness(padding: Padding, largest: float, full: float) -> float:
    """Of padding and head surface in series [Pa/m], at the largest compression [m] of pressure
    ``full`` [Pa]: 1 / (1 / (shear full / largest) + skin), at most ``STIFFEST``."""
    sheared = padding.shear * full
    return min(STIFFEST, sheared / (largest + padding.skin * sheared))


@inlined
def inverse_of(axes: Vec) -> Vec:
    """1 / axes: divisions are most of what a patch costs."""
    return 1.0 / axes[0], 1.0 / axes[1], 1.0 / axes[2]


@inlined
def level_of(point: Vec, inverse: Vec) -> float:
    """Square of the factor that makes the head's ellipsoid reach a point: of a distance d [m] from
    it, at least (1 + d / its shortest semi-axis)^2. Most patches touch nothing: this tells."""
    ux, uy, uz = point[0] * inverse[0], point[1] * inverse[1], point[2] * inverse[2]
    return ux * ux + uy * uy + uz * uz


@inlined
def above_head(point: Vec, inverse: Vec) -> tuple[float, Vec]:
    """Distance [m] of a point from the ellipsoid of the head to first order, and its normal.

    Args:
        inverse: one over the semi-axes [1/m].
    """
    ux, uy, uz = point[0] * inverse[0], point[1] * inverse[1], point[2] * inverse[2]
    level = (ux * ux + uy * uy + uz * uz) ** 0.5
    gx, gy, gz = ux * inverse[0], uy * inverse[1], uz * inverse[2]
    over = 1.0 / (gx * gx + gy * gy + gz * gz) ** 0.5
    return (level - 1.0) * level * over, (gx * over, gy * over, gz * over)


@inlined
def strap_force(strap: Strap, anchor: Vec, velocity: Vec) -> Vec:
    """Force [N] of one side of the strap on the helmet at its anchor, head axes.

    Args:
        anchor: where it is now, head frame [m]; ``velocity`` against the head [m/s].
    """
    path = sub(strap.chin, anchor)
    length = norm(path)
    stretch = length - strap.length
    if stretch <= 0.0:
        return 0.0, 0.0, 0.0
    direction = scaled(path, 1.0 / length)
    tension = strap.stiffness * stretch - strap.damping * dot(direction, velocity)
    return scaled(direction, max(0.0, tension))


def approach(fit: Fit, direction: FloatArray, force: float) -> float:
    """How far a force presses the head into its padding, slowly [m].

    Args:
        direction: in which the head moves against the helmet, unit vector, (3,).
        force: [N].
    """
    low, high = 0.0, 2.0 * fit.padding.thickness
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _resistance(fit, direction, middle) > force else (middle, high)
    return high


def _resistance(fit: Fit, direction: FloatArray, distance: float) -> float:
    """Force of the padding against the head [N] after a distance [m] from the middle."""
    axes = np.array(fit.axes)
    moved = fit.point - np.array(fit.center) - distance * direction
    unit = moved / axes
    level, gradient = np.linalg.norm(unit, axis=1), unit / axes
    slope = np.linalg.norm(gradient, axis=1)
    compression = fit.padding.preload - (level - 1.0) * level / slope
    pressed = np.array([_pressure(fit.padding, float(c)) for c in compression])
    return float((pressed * fit.area * (gradient @ direction) / slope).sum())


@compiled
def _pressure(padding: Padding, compression: float) -> float:
    return pressure(padding, compression)


@inlined
def resolved_relaxation(fit: Fit, step: float, ahead: float) -> float:
    """Relaxation of the padding in shear [s], less where its damping would stop the helmet
    on the head within a step [s], or two where velocities are ``ahead`` [s] of positions: explicit
    damping turns such a motion round at every step."""
    relaxation = fit.padding.relaxation
    if relaxation * fit.sheared[0] * (step + 2.0 * ahead) > fit.mass:
        return float(fit.mass / (fit.sheared[0] * (step + 2.0 * ahead)))
    return relaxation


@compiled
def apply(fit: Fit, step: float, motion: Motion, loads: Loads) -> None:
    """Add padding, friction and strap to the joint axes between head and helmet.

    Args:
        fit: constants and state; the state is changed in place.
        step: time step [s].
        motion, loads: of the bodies; ``loads.coupling`` gets force and moment about the helmet
            frame's origin of the helmet on the head, head axes.
    """
    if fit.slide < 0:  # a bare head
        return
    qpos, qvel, q, v = motion.qpos, motion.qvel, fit.slide, fit.slide_velocity
    points, areas, sticks, deepest = fit.point, fit.area, fit.stick, fit.deepest
    padding, strap = fit.padding, fit.strap
    shift = (qpos[q], qpos[q + 1], qpos[q + 2])
    rotation = matrix_of(quaternion(qpos, q + 3))
    speed = (qvel[v], qvel[v + 1], qvel[v + 2])
    # A ball joint's velocity is in the axes of the child.
    spin = turned(rotation, (qvel[v + 3], qvel[v + 4], qvel[v + 5]))
    inverse, center = inverse_of(fit.axes), fit.center
    farthest = (1.0 + padding.preload * max(inverse)) ** 2
    recovered = min(1.0, step / RECOVERY)
    relaxation, sheared = resolved_relaxation(fit, step, motion.ahead) - motion.ahead, 0.0
    force, moment, pressing = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for i in range(len(areas)):
        arm = turned(rotation, row(points, i))
        at = sub(add(shift, arm), center)
        compression = 0.0
        if level_of(at, inverse) < farthest:
            outside, normal = above_head(at, inverse)
            compression = padding.preload - outside
        if compression <= 0.0:
            deepest[i] -= deepest[i] * recovered
            sticks[i, 0] = sticks[i, 1] = sticks[i, 2] = 0.0
            continue
        velocity = add(speed, cross(spin, arm))
        rate = -dot(normal, velocity)
        largest = max(deepest[i], compression)
        full = pressure(padding, largest)
        shear = shear_stiffness(padding, largest, full)
        if compression < largest:
            width = way_back(padding, largest, full)
            full *= max(0.0, 1.0 - (largest - compression) / width)
        deepest[i] = largest + (compression - largest) * recovered
        pressing += areas[i] * full
        viscous = padding.damping * rate * min(full, padding.modulus)
        pressed = areas[i] * max(0.0, full + viscous)
        sheared += shear * areas[i]
        rubbed = friction_force(
            shear * areas[i], relaxation, padding.friction * pressed,
            across(velocity, normal), normal, step, sticks[i],
        )  # fmt: skip
        here = add(scaled(normal, pressed), rubbed)
        force, moment = add(force, here), add(moment, cross(arm, here))
    fit.sheared[0] = sheared
    for side in (1.0, -1.0):
        arm = turned(rotation, (strap.anchor[0], side * strap.anchor[1], strap.anchor[2]))
        here = strap_force(strap, add(shift, arm), add(speed, cross(spin, arm)))
        force, moment = add(force, here), add(moment, cross(arm, here))
    fit.pressing[0] = pressing
    turning = turned_back(rotation, moment)
    for k in range(3):
        loads.generalised[v + k] += force[k]
        loads.generalised[v + 3 + k] += turning[k]
        loads.coupling[k] = -force[k]
        loads.coupling[3 + k] = -moment[k]


@compiled
def held_energy(fit: Fit, qpos: FloatArray) -> float:
    """Energy [J] that padding and strap hold: what they took up less what they have given back.

    Of the padding in compression this is more than what fast unloading gives back: a padding that
    has time to recover gives more, and what it holds is lost while it recovers.

    Args:
        fit: with the state that :func:`apply` left for the same positions.
        qpos: generalised positions.
    """
    if fit.slide < 0:
        return 0.0
    padding, strap = fit.padding, fit.strap
    shift = (qpos[fit.slide], qpos[fit.slide + 1], qpos[fit.slide + 2])
    rotation = matrix_of(quaternion(qpos, fit.slide + 3))
    held = 0.0
    for i in range(len(fit.area)):
        largest = fit.deepest[i]
        if largest <= 0.0:
            continue
        arm = turned(rotation, row(fit.point, i))
        outside, _ = above_head(sub(add(shift, arm), fit.center), inverse_of(fit.axes))
        compression = max(0.0, padding.preload - outside)
        full = pressure(padding, largest)
        width = way_back(padding, largest, full)
        back = min(largest - compression, width)
        per_area = energy(padding, largest) - full * back * (1.0 - 0.5 * back / width)
        s = row(fit.stick, i)
        per_area += 0.5 * shear_stiffness(padding, largest, full) * dot(s, s)
        held += fit.area[i] * per_area
    for side in (1.0, -1.0):
        arm = turned(rotation, (strap.anchor[0], side * strap.anchor[1], strap.anchor[2]))
        stretch = norm(sub(strap.chin, add(shift, arm))) - strap.length
        if stretch > 0.0:
            held += 0.5 * strap.stiffness * stretch * stretch
    return held
