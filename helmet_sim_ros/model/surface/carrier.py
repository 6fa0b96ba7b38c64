"""What moves and gives way behind a shape: a vehicle that brakes, a panel on a spring.

A carried shape is the face of a panel: an effective mass on a spring and damper, whose other end
moves with a vehicle on a straight line. The vehicle is so heavy that nothing slows it but its
brakes. The panel is deflected by helmet or bare head, and gives back only a share of the energy:
below its deepest deflection so far it is stiffer (Walton & Braun, J. Rheol. 30, 1986). All other
parts of the body dent it elsewhere: each has the panel's stiffness in series with its own, and the
head does not find their dents.
"""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.vector import Vec
from helmet_sim_ros.model.surface.compiled import (
    BRAKING,
    DAMPING,
    DEFLECTION,
    LISTED,
    MASS,
    PEAK,
    PLACE,
    RATE,
    RETURNED,
    SPEED,
    STIFFNESS,
    Surface,
)


@inlined
def react(surface: Surface, k: int, force: Vec) -> None:
    """Remember what of the head presses on shape k; ``force`` is that of the shape on it [N]."""
    if len(surface.carrier) > 0:
        reaction = surface.reaction
        reaction[k, 0] -= force[0]
        reaction[k, 1] -= force[1]
        reaction[k, 2] -= force[2]


@inlined
def share_of_body(surface: Surface, k: int, stiffness: float) -> float:
    """Share of a depth in shape k that is the body's own, of that stiffness [N/m]; the rest is the
    panel's."""
    if len(surface.carrier) == 0 or surface.carrier[k, STIFFNESS] == 0.0:
        return 1.0
    share: float = surface.carrier[k, STIFFNESS] / (surface.carrier[k, STIFFNESS] + stiffness)
    return share


@inlined
def carry(surface: Surface, step: float) -> None:
    """Move all shapes on by a step [s]; nothing where nothing moves."""
    if len(surface.carrier) > 0:
        moved_on(surface, step)


@compiled
def moved_on(surface: Surface, step: float) -> None:
    """:func:`carry` of shapes that move: semi-implicit Euler, as the bodies."""
    carrier, reaction = surface.carrier, surface.reaction
    for k in range(len(carrier)):
        c = carrier[k]
        speed = (c[SPEED] ** 2 + c[SPEED + 1] ** 2 + c[SPEED + 2] ** 2) ** 0.5
        share = max(0.0, 1.0 - c[BRAKING] * step / speed) if speed > 0.0 else 0.0
        length = (
            c[DEFLECTION] ** 2 + c[DEFLECTION + 1] ** 2 + c[DEFLECTION + 2] ** 2
        ) ** 0.5  # fmt: skip
        c[PEAK] = max(c[PEAK], length)
        elastic = max(0.0, c[PEAK] - (c[PEAK] - length) / c[RETURNED])
        stiffness = c[STIFFNESS] * elastic / length if length > 0.0 else c[STIFFNESS]
        for j in range(3):
            c[SPEED + j] *= share
            c[PLACE + j] += step * c[SPEED + j]
            if c[STIFFNESS] > 0.0:
                held = stiffness * c[DEFLECTION + j] + c[DAMPING] * c[RATE + j]
                c[RATE + j] += step * (reaction[k, j] - held) / c[MASS]
                c[DEFLECTION + j] += step * c[RATE + j]
            surface.position[k, j] = c[PLACE + j] + c[DEFLECTION + j]
            surface.velocity[k, j] = c[SPEED + j] + c[RATE + j]
            reaction[k, j] = 0.0


@compiled
def farthest(surface: Surface) -> float:
    """How far any shape has moved since :func:`remember` [m]."""
    most = 0.0
    for k in range(len(surface.carrier)):
        square = 0.0
        for j in range(3):
            square += (surface.position[k, j] - surface.carrier[k, LISTED + j]) ** 2
        most = max(most, square)
    return float(most**0.5)


@compiled
def remember(surface: Surface) -> None:
    """Remember where all shapes are, for :func:`farthest`."""
    for k in range(len(surface.carrier)):
        for j in range(3):
            surface.carrier[k, LISTED + j] = surface.position[k, j]
