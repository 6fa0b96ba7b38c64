"""How a rider moves at one instant, as a list of numbers that fits any helmet.

A setup holds it as ``impact.state``: time in the scene [s]; struck point (3) [m] and outward
normal (3) there; of the head position (3) [m], orientation (4, x y z w), velocity (3) [m/s] and
angular velocity (3) [rad/s], all in world axes; of the helmet against the head, in head axes, how
far it has moved in its padding (3) [m] and turned (3, a rotation vector) [rad], and both rates
(6); of a spring helmet the displacement of its shell in helmet axes (3) [m] and its rate (3), else
0; the largest compression of its coupling so far [m], and the shortening that the neck keeps [m];
then, each for all joint coordinates of the body in the order of ``ImpactRecord.joint_names``:
positions, velocities, where their springs rest, and factors on their stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError

FIRST_JOINT = 40
LONGEST = 10.0  # s, latest time in a scene
FASTEST = 100.0  # m/s


class State(NamedTuple):
    """The parts of a state; see above."""

    time: float
    point: FloatArray
    normal: FloatArray
    position: FloatArray
    orientation: FloatArray
    velocity: FloatArray
    angular_velocity: FloatArray
    shift: FloatArray
    turn: FloatArray
    shift_rate: FloatArray
    turn_rate: FloatArray
    shell: FloatArray
    shell_rate: FloatArray
    compressed: FloatArray
    yielded: FloatArray
    joint_positions: FloatArray
    joint_velocities: FloatArray
    joint_rests: FloatArray
    joint_factors: FloatArray

    def numbers(self) -> tuple[float, ...]:
        """All of them as one list."""
        return (self.time, *(float(v) for part in self[1:] for v in part))


def read_state(numbers: Sequence[float]) -> State:
    """The parts of a list of numbers.

    Raises:
        SetupError: not such a list; names ``state``.
    """
    values, joints = np.array(numbers, dtype=float), len(numbers) - FIRST_JOINT
    shown = f"{len(numbers)} numbers"
    if joints < 0 or joints % 4:
        raise SetupError.of("state", shown, f"must be {FIRST_JOINT} numbers and four per joint")
    each = joints // 4
    at = np.cumsum([1, 3, 3, 3, 4, 3, 3, 3, 3, 3, 3, 3, 3, 1, 1, each, each, each])
    time, *parts = np.split(values, at)
    state = State(float(time[0]), *parts)
    if not np.isfinite(values).all():
        raise SetupError.of("state", shown, "each must be finite")
    if not ((state.joint_factors >= 0.1) & (state.joint_factors <= 100.0)).all():
        raise SetupError.of("state", shown, "factors on stiffness must be from 0.1 to 100")
    if not 0.0 <= state.time <= LONGEST:
        raise SetupError.of("state", state.time, f"its time must be from 0 to {LONGEST:g} s")
    for name, vector in (("orientation", state.orientation), ("normal", state.normal)):
        if abs(float(np.linalg.norm(vector)) - 1.0) > 1e-6:
            raise SetupError.of("state", vector.tolist(), f"its {name} must have the length 1")
    if float(np.abs(state.velocity).max()) > FASTEST:
        raise SetupError.of(
            "state", state.velocity.tolist(), f"its velocity must be below {FASTEST:g} m/s"
        )
    return state
