"""Forces on the helmet as arrows, for every kind of picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord

#: Length of an arrow per force [m/N]: 10 kN are half a metre.
LENGTH_PER_FORCE = 5e-5
#: Forces below this are not drawn [N]: 2.5 mm of arrow.
SMALLEST_FORCE = 50.0


#: Names of the arrows.
FORCES = ("normal", "friction")


@dataclass(frozen=True)
class Arrow:
    """A force of the ground on the helmet.

    Attributes:
        name: ``normal`` or ``friction``.
        tail: where it acts, world axes, shape (3,) [m].
        tip: end of the arrow, shape (3,) [m].
        color: red, green, blue, opacity.
    """

    name: str
    tail: FloatArray
    tip: FloatArray
    color: tuple[float, float, float, float]

    @property
    def visible(self) -> bool:
        """Whether the force is large enough to be drawn."""
        length = float(np.linalg.norm(self.tip - self.tail))
        return length >= SMALLEST_FORCE * LENGTH_PER_FORCE


_COLORS = {"normal": (0.80, 0.15, 0.15, 1.0), "friction": (0.95, 0.60, 0.10, 1.0)}


def force_arrows(record: ImpactRecord, index: int) -> tuple[Arrow, Arrow]:
    """Normal and tangential force of the surface at one sample, at their point of attack."""
    tangential = record.ground_friction[index]
    normal = record.ground_force[index] - tangential
    tail = point_of_attack(record, index)
    return (
        Arrow("normal", tail, tail + LENGTH_PER_FORCE * normal, _COLORS["normal"]),
        Arrow("friction", tail, tail + LENGTH_PER_FORCE * tangential, _COLORS["friction"]),
    )


def point_of_attack(record: ImpactRecord, index: int) -> FloatArray:
    """The point where the surface's force acts, world axes, shape (3,) [m].

    Where its line of action meets the plane through the world's origin, at which the helmet
    touches first, normal to the contact: with force F, moment M about the origin and normal n,
    n x M / (n . F).
    Without contact, the point of the ground below the helmet.
    """
    force, moment = record.ground_force[index], record.ground_torque[index]
    normal = force - record.ground_friction[index]
    pressed = float(np.linalg.norm(normal))
    if pressed < SMALLEST_FORCE:
        return np.array([*record.helmet_position[index][:2], 0.0])
    normal = normal / pressed
    point: FloatArray = np.cross(normal, moment) / (normal @ force)
    return point
