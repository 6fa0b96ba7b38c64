"""The one stepping loop: coupling force in, ``mj_step``, samples out; compiled by numba.

The loop calls MuJoCo's C function directly and works on numpy views of MuJoCo's arrays, so it
costs hardly more than ``mj_step`` itself and releases the interpreter lock.
"""

from __future__ import annotations

from pathlib import Path

import llvmlite.binding
import mujoco
from numba import njit, types

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.coupling import spring_force


def _link_mujoco() -> None:
    """Make MuJoCo's C functions known to compiled code by name (so that it can be cached)."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(folder.glob("libmujoco.*")) or sorted(folder.glob("mujoco.dll"))
    if not libraries:
        raise ImportError(f"no MuJoCo library in {folder}")
    llvmlite.binding.load_library_permanently(str(libraries[0]))


_link_mujoco()
_mj_step = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))


@njit(cache=True, nogil=True)
def advance(
    model: int,
    data: int,
    first: int,
    last: int,
    qpos: FloatArray,
    qvel: FloatArray,
    qacc: FloatArray,
    applied: FloatArray,
    sensors: FloatArray,
    slides: tuple[int, int],
    law: FloatArray,
    energy_loss: float,
    state: FloatArray,
    samples: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> int:
    """Step from sample ``first`` up to ``last``; each row is the state before its step.

    Args:
        model, data: addresses of mjModel and mjData.
        qpos, qvel, qacc, applied, sensors: views of MuJoCo's arrays (``qfrc_applied``,
            ``sensordata``).
        slides: index of the first coupling slide in qpos and in qvel.
        law, energy_loss, state: see :mod:`helmet_sim_ros.model.coupling`.
        samples: rows of qpos, qvel, qacc, sensordata and spring force (3) to write.

    Returns:
        ``last``, or the index of the first sample whose acceleration is not finite.
    """
    q_rows, v_rows, a_rows, sensor_rows, force_rows = samples
    q0, v0 = slides
    for i in range(first, last):
        spring_force(qpos[q0 : q0 + 3], law, energy_loss, state, force_rows[i])
        applied[v0 : v0 + 3] = force_rows[i]
        q_rows[i] = qpos
        v_rows[i] = qvel
        _mj_step(model, data)
        a_rows[i] = qacc
        sensor_rows[i] = sensors
        if not abs(qacc.sum()) < 1e12:  # also true for NaN
            return i
    return last
