"""Second-order recursions over samples, the core of every digital filter, solved by LAPACK.

The same as ``scipy.signal.lfilter``, whose import takes half a second at the start of every process
and 40 MB in every worker of a study.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dtbtrs

from helmet_sim_ros.biomech.pulse import FloatArray


def recursion(feedback: FloatArray, drive: FloatArray, backward: bool = False) -> FloatArray:
    """The y with y_i + a1 y_(i-1) + a2 y_(i-2) = r_i, at rest before the first sample.

    Args:
        feedback: 1, a1, a2; shape (3,).
        drive: r, samples along the last axis, shape (n,) or (m, n).
        backward: from the last sample to the first, with y_(i+1) and y_(i+2), at rest after it.

    Returns:
        y, shape of ``drive``.
    """
    bands = _bands(*feedback.tolist(), drive.shape[-1])
    columns, _ = dtbtrs(
        bands, np.atleast_2d(drive).T, uplo="L", trans="T" if backward else "N", diag="U"
    )
    answer: FloatArray = columns.T.reshape(drive.shape)
    return answer


@lru_cache(maxsize=32)
def _bands(a0: float, a1: float, a2: float, samples: int) -> FloatArray:
    """A triangular matrix with two bands below its diagonal of ones, as LAPACK stores one."""
    bands = np.empty((3, samples), order="F")
    bands[:] = [[a0], [a1], [a2]]
    bands.flags.writeable = False
    return bands


def weighted(weights: FloatArray, values: FloatArray) -> FloatArray:
    """b0 x_i + b1 x_(i-1) + b2 x_(i-2), with x = 0 before the first sample.

    Args:
        weights: b of each row, shape (m, 3).
        values: x, samples along the last axis, shape (m, n).

    Returns:
        Shape of ``values``.
    """
    total: FloatArray = weights[:, :1] * values
    for lag in (1, 2):
        total[:, lag:] += weights[:, lag : lag + 1] * values[:, :-lag]
    return total
