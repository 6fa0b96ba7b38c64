"""Forces on the helmet as arrows, for every kind of picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord, is_fall
from helmet_sim_ros.biomech.rotation import matrices

#: Length of an arrow per force [m/N]: 10 kN are half a metre.
LENGTH_PER_FORCE = 5e-5
#: Forces below this are not drawn [N]: 2.5 mm of arrow.
SMALLEST_FORCE = 50.0


#: Names of the arrows.
FORCES = ("normal", "friction")
#: Their colours: red, green, blue, opacity.
COLORS = {"normal": (0.80, 0.15, 0.15, 1.0), "friction": (0.95, 0.60, 0.10, 1.0)}


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


def force_arrows(record: ImpactRecord, index: int) -> tuple[Arrow, Arrow]:
    """Normal and tangential force of the surface at one sample, at their point of attack."""
    tangential = record.ground_friction[index]
    normal = record.ground_force[index] - tangential
    tail = point_of_attack(record, index)
    return (
        Arrow("normal", tail, tail + LENGTH_PER_FORCE * normal, COLORS["normal"]),
        Arrow("friction", tail, tail + LENGTH_PER_FORCE * tangential, COLORS["friction"]),
    )


def point_of_attack(record: ImpactRecord, index: int) -> FloatArray:
    """The point where the surface's force acts, world axes, shape (3,) [m].

    Where its line of action meets the plane of the contact: with force F, moment M about the world
    origin, normal n and a point q of the plane, q + n x (M - q x F) / (n . F). An impact begins at
    the world's origin; in a fall, or where one is struck again, q is the point of the undeformed
    shell that lies deepest.
    Without contact, the point of the ground below the helmet.
    """
    force, moment = record.ground_force[index], record.ground_torque[index]
    normal = force - record.ground_friction[index]
    pressed = float(np.linalg.norm(normal))
    if pressed < SMALLEST_FORCE:
        return np.array([*record.helmet_position[index][:2], 0.0])
    normal = normal / pressed
    if not is_fall(record.setup) and record.setup.get("impact.state") is None:
        first: FloatArray = np.cross(normal, moment) / (normal @ force)
        return first
    deepest = _deepest(record, index, normal)
    moment = moment - np.cross(deepest, force)
    point: FloatArray = deepest + np.cross(normal, moment) / (normal @ force)
    return point


def _deepest(record: ImpactRecord, index: int, normal: FloatArray) -> FloatArray:
    """The point of the shell's ellipsoid farthest against a normal, world axes, (3,) [m]."""
    axes = np.array(record.setup["helmet.shell.semi_axes"], dtype=float)
    center = np.array(record.setup["helmet.shell.center"], dtype=float)
    turn = matrices(record.helmet_orientation[index : index + 1])[0]
    inwards = axes * (turn.T @ -normal)
    reach = axes * inwards / float(np.linalg.norm(inwards))
    point: FloatArray = record.helmet_position[index] + turn @ (center + reach)
    return point
