"""Shapes as compiled code takes them; importing this does not load the compiler."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray

HALF_SPACE, SPHERE, CAPSULE, BOX, DISC, WEDGE, ELLIPSOID = range(7)

#: Columns of a size row. The radius of a sphere, a capsule or an edge; 0 where there is none.
RADIUS = 0  # m
#: Half the length of a capsule's core, half sizes of a box's core, semi-axes of an ellipsoid,
#: radius and half height of a disc's core, half length and height of a wedge's core [m].
FIRST, SECOND, THIRD = 1, 2, 3
SINE, COSINE = 3, 4  # of a wedge's half angle [-]
COLUMNS = 5

#: A size row.
Size = tuple[float, float, float, float, float]


#: Columns of a row of :attr:`Surface.carrier`. Constants of the panel that a shape is the face of:
#: stiffness [N/m] (0: rigid), effective mass [kg], damping [N s/m], share of the elastic energy
#: returned [-]; and deceleration of what carries the shape [m/s^2].
STIFFNESS, MASS, DAMPING, RETURNED, BRAKING = range(5)
#: State: largest deflection so far [m]; then three each: where the shape would be undeflected [m]
#: and how fast that moves [m/s], deflection of the panel [m] and its rate [m/s], and position when
#: the liner last listed its columns [m].
PEAK, PLACE, SPEED, DEFLECTION, RATE, LISTED = 5, 6, 9, 12, 15, 18
CARRIED = 21


class Surface(NamedTuple):
    """Shapes in compiled form; row i belongs to shape i.

    Attributes:
        kind: ``HALF_SPACE`` to ``ELLIPSOID``, shape (n,).
        position: origin of the shape axes, world axes, (n, 3) [m].
        rotation: shape axes to world, row-major, (n, 9).
        size: by kind, see the named columns, (n, COLUMNS).
        friction: of a shell on this shape, (n,) [-].
        velocity: of the shape, world axes, (n, 3) [m/s]; state, 0 where nothing moves.
        reaction: of what touches it on the shape, world axes, (n, 3) [N]; state.
        carrier: how it moves and gives way, see ``STIFFNESS``, (n, CARRIED); without rows: nothing
            moves.
    """

    kind: NDArray[np.int64]
    position: FloatArray
    rotation: FloatArray
    size: FloatArray
    friction: FloatArray
    velocity: FloatArray
    reaction: FloatArray
    carrier: FloatArray


def at_rest(
    kind: NDArray[np.int64],
    position: FloatArray,
    rotation: FloatArray,
    size: FloatArray,
    friction: FloatArray,
) -> Surface:
    """Shapes that neither move nor give way."""
    still = np.zeros((len(kind), 3))
    return Surface(
        kind, position, rotation, size, friction, still, still, np.zeros((0, CARRIED))
    )  # fmt: skip
