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
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import FloatArray, positive, resultant_g

#: Windows looked at in one go.
BATCH = 12_000


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
    velocity = np.empty(len(values))  # in units of one time step
    velocity[0] = 0.0
    np.cumsum(0.5 * (values[1:] + values[:-1]), out=velocity[1:])
    last = len(values) - 1
    best = (0.0, 0.0, 0.0)  # score, first and last sample of the window
    max_lag = last
    if velocity[-1] <= 0.0:
        return Hic(0.0, 0.0, 0.0)
    if window is not None and window < last * time_step:
        lags = window / time_step
        max_lag = int(lags * (1.0 + 1e-12))
        best = _limit_windows(velocity, lags)
    if max_lag >= 1:
        best = _sample_windows(velocity, max_lag, float(values.max()), best)
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
    velocity: FloatArray, max_lag: int, peak: float, best: tuple[float, float, float]
) -> tuple[float, float, float]:
    """The best window between samples, if it beats ``best``: branch and bound over block pairs.

    No window from block I to block J scores more than the velocity gained from the start of I to
    the end of J over the shortest time between them, nor more than the peak held for the longest.
    """
    n = len(velocity)
    block = 4 + int(0.5 * max_lag**0.5)  # balances the number of pairs against their size
    weight = _weights(n, max_lag)
    begins = np.arange(0, n, block)
    low = velocity[begins]
    high = velocity[np.minimum(begins + block - 1, n - 1)]
    steps = np.arange(min(len(begins) - 1, max_lag // block + 1) + 1)  # from block I to block J
    lag = steps * block
    later = np.minimum(np.arange(len(begins))[:, None] + steps, len(begins) - 1)
    coarse = (low[later] - low[:, None]) * weight[np.minimum(lag, n - 1)]
    row, step = divmod(int(coarse.argmax()), len(steps))
    if coarse[row, step] > best[0]:
        best = (float(coarse[row, step]), float(begins[row]), float(begins[later[row, step]]))

    shortest = np.maximum(lag - (block - 1), 1)
    longest = np.minimum(lag + block - 1, max_lag)
    bound = np.minimum((high[later] - low[:, None]) * shortest**-0.6, peak * longest**0.4)
    # A hair of slack: rounding of a bound must not drop the optimum.
    pairs = np.flatnonzero(bound > best[0] * (1.0 - 1e-12))
    pairs = pairs[np.argsort(-bound.flat[pairs], kind="stable")]
    inside = np.arange(block)
    batch_size = max(1, BATCH // block**2)
    for k in range(0, len(pairs), batch_size):
        batch = pairs[k : k + batch_size]
        if bound.flat[batch[0]] <= best[0]:
            break
        rows, columns = batch // len(steps), later.flat[batch]
        starts = np.minimum(begins[rows][:, None] + inside, n - 1)
        ends = np.minimum(begins[columns][:, None] + inside, n - 1)
        lags = np.maximum(ends[:, None, :] - starts[:, :, None], 0)
        score = (velocity[ends][:, None, :] - velocity[starts][:, :, None]) * weight[lags]
        top = int(score.argmax())
        if score.flat[top] > best[0]:
            pair, a, b = np.unravel_index(top, score.shape)
            best = (float(score.flat[top]), float(starts[pair, a]), float(ends[pair, b]))
    return best


@lru_cache(maxsize=32)
def _weights(samples: int, max_lag: int) -> FloatArray:
    """lag^-0.6 for every lag up to ``max_lag``, 0 for lag 0 and beyond."""
    weight = np.zeros(samples)
    lags = np.arange(1, min(max_lag, samples - 1) + 1, dtype=np.float64)
    weight[1 : len(lags) + 1] = lags**-0.6
    weight.flags.writeable = False
    return weight
