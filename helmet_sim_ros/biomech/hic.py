"""Head Injury Criterion: the exact maximum over all windows of a sampled pulse.

HIC = max over t1 < t2 of (t2 - t1) [ (integral of a from t1 to t2) / (t2 - t1) ]^2.5, a in g
(J. Versace, "A review of the Severity Index", SAE 710881, 1971; 49 CFR 571.208).

With the velocity V (integral of a by the trapezoidal rule, linear between samples) and
T = t2 - t1, HIC = max (dV / T^0.6)^2.5. Along a straight piece of V the score dV / T^0.6 has no
inner maximum (its only stationary point is a minimum), so the optimum has both ends on samples,
unless the window limit cuts it: then T equals the limit and one end is on a sample. Searching
these candidates gives the exact maximum, and it can only grow with the window. Against the
continuous pulse the error is of second order in the time step.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import ArrayLike, NDArray

from helmet_sim_ros.biomech.pulse import FloatArray, positive, resultant_g

#: Windows looked at in one go.
BATCH = 12_000
#: Samples by which the part of a record that is searched grows.
UNIT = 64


class Hic(NamedTuple):
    """A maximum and its window; times count from the first sample [s]."""

    value: float
    t1: float
    t2: float


def hic(acceleration_g: ArrayLike, time_step: float, window: float | None = None) -> Hic:
    """Head Injury Criterion with its window.

    Args:
        acceleration_g: head acceleration, components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].
        window: longest window [s] (0.015, 0.036); None: unlimited. It need not be a multiple of
            the time step.

    Raises:
        PulseError: bad signal, time step or window, or values that look like m/s^2.
    """
    resultant = resultant_g(acceleration_g, time_step)
    limit = None if window is None else positive("window", window)
    return maximum_window(resultant, float(time_step), limit)


def maximum_window(values: FloatArray, time_step: float, window: float | None = None) -> Hic:
    """The HIC formula on any checked signal of amounts, shape (n,), nowhere negative."""
    gains = 0.5 * (values[1:] + values[:-1])  # in units of one time step, like the velocity
    velocity = np.zeros(len(values))
    gains.cumsum(out=velocity[1:])
    last = len(values) - 1
    best = (0.0, 0.0, 0.0)  # score, first and last sample of the window
    max_lag = last
    if velocity[-1] <= 0.0:
        return Hic(0.0, 0.0, 0.0)
    if window is not None and window < last * time_step:
        lags = window / time_step
        max_lag = int(lags * (1.0 + 1e-12))
        if lags - max_lag > 1e-9:  # else its ends are both on samples
            best = _limit_windows(velocity, lags)
    if max_lag >= 1:
        best = _sample_windows(velocity, gains, max_lag, float(values.max()), best)
    score, first, final = best
    return Hic(score**2.5 * time_step, first * time_step, final * time_step)


def _limit_windows(velocity: FloatArray, lags: float) -> tuple[float, float, float]:
    """The best window of exactly ``lags`` samples that has one end on a sample."""
    nodes = np.arange(len(velocity), dtype=np.float64)
    starts = nodes[: int(nodes[-1] - lags) + 1]
    ends = nodes[int(np.ceil(lags)) :]
    first = np.concatenate((starts, ends - lags))
    final = np.concatenate((starts + lags, ends))
    gain = np.interp(final, nodes, velocity) - np.interp(first, nodes, velocity)
    i = int(gain.argmax())
    return float(gain[i]) / lags**0.6, float(first[i]), float(final[i])


def _sample_windows(
    velocity: FloatArray,
    gains: FloatArray,
    max_lag: int,
    peak: float,
    best: tuple[float, float, float],
) -> tuple[float, float, float]:
    """The best window between samples, if it beats ``best``: branch and bound over block pairs.

    The best window gains in its first step and in its last at least 0.6 of its mean, or it would
    be better without that step: (1 - x)^0.6 <= 1 - 0.6 x. So it lies among steps as high as that.

    No window from block I to block J scores more than the velocity gained from the start of I to
    the end of J over the shortest time between them, nor more than the peak held for the longest.
    """
    weight = _weights(max_lag)
    best = _climbed(velocity, weight, int(gains.argmax()), best)
    high = (gains >= (0.6 - 1e-9) * best[0] * max_lag**-0.4).nonzero()[0]
    begin, end = _widened(int(high[0]), int(high[-1]) + 2, len(velocity))
    velocity = velocity[begin:end]

    grid = _grid(len(velocity), max_lag)
    block, rows, steps = grid.block, grid.rows, len(grid.reach)
    # Row I holds block I; zeros follow, so that no window beyond the record gains anything.
    table = np.zeros((rows + steps, block))
    table.ravel()[: len(velocity)] = velocity
    late = table[:, -1].copy()
    late[rows - 1] = velocity[-1]
    bound = (late[grid.later] - table[:rows, :1]) * grid.reach
    bound = np.minimum(bound, peak * grid.hold, out=bound).ravel()
    # A hair of slack: rounding of a bound must not drop the optimum.
    pairs = np.flatnonzero(bound > best[0] * (1.0 - 1e-12))
    batch_size = max(1, BATCH // block**2)
    if len(pairs) > batch_size:
        pairs = pairs[np.argsort(-bound[pairs], kind="stable")]
    for k in range(0, len(pairs), batch_size):
        if k and bound[pairs[k]] <= best[0]:
            break
        first, step = np.divmod(pairs[k : k + batch_size], steps)
        final = first + step
        score = table[final][:, None, :] - table[first][:, :, None]
        score *= grid.within[step]
        top = int(score.argmax())
        if score.flat[top] > best[0]:
            pair, a, b = np.unravel_index(top, score.shape)
            t1, t2 = (float(begin + block * i[pair] + k) for i, k in ((first, a), (final, b)))
            best = (float(score.flat[top]), t1, t2)
    return best


def _climbed(
    velocity: FloatArray, weight: FloatArray, first: int, best: tuple[float, float, float]
) -> tuple[float, float, float]:
    """The better of ``best`` and the window reached by moving one end at a time, from ``first``."""
    max_lag = len(weight) - 1
    while True:
        ends = velocity[first + 1 : first + 1 + max_lag]
        final = first + 1 + int(((ends - velocity[first]) * weight[1 : len(ends) + 1]).argmax())
        begins = velocity[max(0, final - max_lag) : final]
        score = (velocity[final] - begins) * weight[len(begins) : 0 : -1]
        k = int(score.argmax())
        if score[k] <= best[0]:
            return best
        first = final - len(begins) + k
        best = (float(score[k]), float(first), float(final))


def _widened(begin: int, end: int, samples: int) -> tuple[int, int]:
    """A range made longer, to a multiple of ``UNIT`` where there is room: few grids to keep."""
    length = min(-(-(end - begin) // UNIT) * UNIT, samples)
    begin = min(begin, samples - length)
    return begin, begin + length


class _Grid(NamedTuple):
    """What the search for windows of up to ``max_lag`` among n samples needs beside the samples.

    Attributes:
        block: samples per block.
        rows: blocks.
        later: the block I + step, shape (rows, steps).
        reach: lag^-0.6 of the shortest lag between samples of I and I + step, shape (steps,).
        hold: lag^0.4 of the longest one, shape (steps,).
        within: lag^-0.6 between each two of their samples, shape (steps, block, block); 0 for lags
            that are none or beyond ``max_lag``.
    """

    block: int
    rows: int
    later: NDArray[np.intp]
    reach: FloatArray
    hold: FloatArray
    within: FloatArray


@lru_cache(maxsize=64)
def _grid(samples: int, max_lag: int) -> _Grid:
    lags = min(max_lag, samples - 1)
    block = 4 + int(0.5 * lags**0.5)  # balances the number of pairs against their size
    rows = -(-samples // block)
    steps = min(rows - 1, lags // block + 1) + 1
    before = block - 1  # lags below 0
    weight = np.zeros(before + (steps + 1) * block + lags)
    weight[before : before + lags + 1] = _weights(max_lag)[: lags + 1]
    lag = block * np.arange(steps)
    stride = weight.strides[0]
    return _Grid(
        block,
        rows,
        later=np.arange(rows)[:, None] + np.arange(steps),
        reach=np.maximum(lag - before, 1) ** -0.6,
        hold=np.minimum(lag + before, max_lag) ** 0.4,
        within=as_strided(
            weight[before:], (steps, block, block), (block * stride, -stride, stride),
            writeable=False,
        ),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _weights(max_lag: int) -> FloatArray:
    """lag^-0.6 for every lag up to ``max_lag``, 0 for lag 0."""
    weight = np.zeros(max_lag + 1)
    weight[1:] = np.arange(1, max_lag + 1, dtype=np.float64) ** -0.6
    weight.flags.writeable = False
    return weight
