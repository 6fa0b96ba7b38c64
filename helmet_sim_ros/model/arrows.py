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
    """Normal and tangential force of the ground at one sample, at their point of attack."""
    force = record.ground_force[index]
    tail = point_of_attack(record, index)
    normal, tangential = np.array([0.0, 0.0, force[2]]), np.array([force[0], force[1], 0.0])
    return (
        Arrow("normal", tail, tail + LENGTH_PER_FORCE * normal, _COLORS["normal"]),
        Arrow("friction", tail, tail + LENGTH_PER_FORCE * tangential, _COLORS["friction"]),
    )


def point_of_attack(record: ImpactRecord, index: int) -> FloatArray:
    """The point of the ground where the contact force acts, world axes, shape (3,) [m].

    From force F and moment M about the world's origin: x = -M_y / F_z, y = M_x / F_z on z = 0.
    Without contact, the point of the ground below the helmet.
    """
    force, moment = record.ground_force[index], record.ground_torque[index]
    if force[2] < SMALLEST_FORCE:
        return np.array([*record.helmet_position[index][:2], 0.0])
    return np.array([-moment[1] / force[2], moment[0] / force[2], 0.0])
