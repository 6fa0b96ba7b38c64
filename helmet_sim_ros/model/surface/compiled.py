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


class Surface(NamedTuple):
    """Shapes in compiled form; row i belongs to shape i.

    Attributes:
        kind: ``HALF_SPACE`` to ``ELLIPSOID``, shape (n,).
        position: origin of the shape axes, world axes, (n, 3) [m].
        rotation: shape axes to world, row-major, (n, 9).
        size: by kind, see the named columns, (n, COLUMNS).
        friction: of a shell on this shape, (n,) [-].
    """

    kind: NDArray[np.int64]
    position: FloatArray
    rotation: FloatArray
    size: FloatArray
    friction: FloatArray
