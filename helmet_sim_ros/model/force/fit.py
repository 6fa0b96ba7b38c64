"""The head in the liner of a foam helmet: friction of padding and scalp where the load passes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import inlined
from helmet_sim_ros.model.force.bodies import (
    FORCE,
    FRICTION,
    HELMET,
    Loads,
    Motion,
    push,
)
from helmet_sim_ros.model.force.friction import friction_force
from helmet_sim_ros.model.force.vector import add, cross, norm, row, scaled
from helmet_sim_ros.model.helmet import Helmet


class Fit(NamedTuple):
    """How the head sits in its helmet.

    Attributes:
        head, helmet: MuJoCo's indices of the bodies; ``head`` is negative for a spring helmet.
        friction: of head in liner [-].
        stiffness: shear stiffness of padding and scalp [N/m].
        relaxation: of padding and scalp [s].
        radius: of the liner's inner surface [m].
        stick: shear deflection, world axes, (3,) [m]; state.
    """

    head: int
    helmet: int
    friction: float
    stiffness: float
    relaxation: float
    radius: float
    stick: FloatArray


def fit(helmet: Helmet, thickness: FloatArray, head_body: int, helmet_body: int) -> Fit:
    """The fit of a helmet whose columns have these thicknesses [m]; none: a spring helmet."""
    liner = helmet.liner
    foam = len(thickness) > 0
    inner = float(np.mean(helmet.shell.semi_axes) - thickness.mean()) if foam else 0.0
    return Fit(
        head_body if foam else -1, helmet_body, liner.head_friction, liner.padding_stiffness,
        liner.padding_relaxation, inner, np.zeros(3),
    )  # fmt: skip


@inlined
def apply(fit: Fit, step: float, motion: Motion, loads: Loads) -> None:
    """Add the friction between head and helmet under the surface's load on the helmet."""
    total = loads.surface[HELMET]
    pressed = (
        total[FORCE] - total[FRICTION], total[FORCE + 1] - total[FRICTION + 1],
        total[FORCE + 2] - total[FRICTION + 2],
    )  # fmt: skip
    load = norm(pressed)
    normal = scaled(pressed, 1.0 / load) if load > 0.0 else (0.0, 0.0, 1.0)
    center = row(motion.position, fit.head)
    # The helmet turns about the head's centre: only the difference of the spins slides there.
    arm = scaled(normal, -fit.radius)
    helmet, head = motion.velocity[fit.helmet], motion.velocity[fit.head]
    spin = (helmet[0] - head[0], helmet[1] - head[1], helmet[2] - head[2])
    force = friction_force(
        fit.stiffness, fit.relaxation, fit.friction * load, cross(spin, arm), normal, step,
        fit.stick,
    )  # fmt: skip
    point = add(center, arm)
    push(motion, loads, fit.helmet, point, force)
    push(motion, loads, fit.head, point, scaled(force, -1.0))
