"""Criteria of the linear head acceleration other than HIC. All accelerations in g."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.hic import Hic, hic
from helmet_sim_ros.biomech.pulse import (
    STANDARD_GRAVITY,
    FloatArray,
    magnitude,
    positive,
    real_number,
    resultant_g,
)
from helmet_sim_ros.errors import PulseError

#: Share of the peak above which a pulse counts as lasting. A half sine of length T lasts
#: (1 - 2/pi asin 0.1) T = 0.936 T by this measure.
DURATION_LEVEL = 0.1


#: The 3 ms clip [s].
CLIP_DURATION = 0.003


class Span(NamedTuple):
    """A value that belongs to an interval; times count from the first sample [s]."""

    value: float
    t1: float
    t2: float


def clip(acceleration_g: ArrayLike, time_step: float, duration: float = CLIP_DURATION) -> Span:
    """The highest level that the resultant keeps without a break for ``duration`` (3 ms clip).

    Exact for a resultant that is linear between samples, whatever the time step.

    Args:
        acceleration_g: components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].
        duration: how long the level is kept [s].

    Returns:
        The level [g] and the interval.

    Raises:
        PulseError: bad signal or argument, or a signal shorter than ``duration``.
    """
    resultant = resultant_g(acceleration_g, time_step)
    lags = positive("duration", duration) / time_step
    last = len(resultant) - 1
    if lags > last * (1.0 + 1e-12):
        raise PulseError(
            f"acceleration_g: lasts {last * time_step * 1e3:.4g} ms, shorter than the duration of "
            f"{duration * 1e3:.4g} ms"
        )
    return kept_level(resultant, float(time_step), lags)


def _window_minima(values: FloatArray, run: int) -> FloatArray:
    """The lowest of each ``run`` neighbours, shape (n - run + 1,)."""
    span, lowest = 1, values
    while 2 * span <= run:  # lowest of 1, 2, 4, ... neighbours
        lowest = np.minimum(lowest[:-span], lowest[span:])
        span *= 2
    rest = run - span
    return np.minimum(lowest[: len(lowest) - rest], lowest[rest:])


def kept_level(resultant: FloatArray, time_step: float, lags: float) -> Span:
    """:func:`clip` of a checked resultant, (n,), for an interval of ``lags`` samples.

    While an interval slides, its minimum is the lowest of the samples inside (constant between
    two events) and of its two ends (linear between two events); so its maximum is at an event or
    where the ends are level.
    """
    n = len(resultant)
    run = max(int(lags + 1e-9), 1)  # samples inside an interval; some hold one more
    lowest = _window_minima(resultant, run)
    # The best interval from sample to sample: a better one lies among samples as high as that.
    more = min(max(math.ceil(lags - 1e-9), 1) + 1, n) - run  # 1 or 2
    count = len(lowest) - more
    least = np.minimum(np.minimum(lowest[:count], lowest[1 : 1 + count]), lowest[more:]).max()
    high = (resultant >= least).nonzero()[0]
    offset, end = max(int(high[0]) - 1, 0), min(int(high[-1]) + 2, n)
    resultant, lowest = resultant[offset:end], lowest[offset : end - run + 1]

    nodes = np.arange(len(resultant), dtype=np.float64)
    latest = max(len(resultant) - 1 - lags, 0.0)
    # The starts with one end on a sample, in order: each whole one, then that with a whole end.
    starts = np.minimum(nodes[: int(latest + 1e-9) + 1], latest)
    cut = math.ceil(lags - 1e-9) - lags  # 0 if both are the same
    if cut > 1e-9:
        starts = np.stack((starts, starts + cut), axis=1).ravel()
        starts = np.minimum(starts[starts < latest + 1e-9], latest)
    difference = np.interp(starts, nodes, resultant) - np.interp(starts + lags, nodes, resultant)
    crosses = (difference[:-1] * difference[1:] < 0.0).nonzero()[0]
    share = difference[crosses] / (difference[crosses] - difference[crosses + 1])
    level = starts[crosses] + share * (starts[crosses + 1] - starts[crosses])
    starts = np.concatenate((starts, level))
    ends = starts + lags
    kept = np.minimum(np.interp(starts, nodes, resultant), np.interp(ends, nodes, resultant))

    # The samples inside, whose number is the run's or one more, as two runs.
    first = np.ceil(starts - 1e-9).astype(int)
    final = np.floor(ends + 1e-9).astype(int)
    inside = first <= final
    for begin in (np.minimum(first, len(lowest) - 1), np.maximum(final - run + 1, 0)):
        np.minimum(kept, lowest[begin], out=kept, where=inside)
    i = int(kept.argmax())
    t1, t2 = float(starts[i]) + offset, float(ends[i]) + offset
    return Span(float(kept[i]), t1 * time_step, t2 * time_step)


def pulse_duration(
    acceleration_g: ArrayLike, time_step: float, level: float = DURATION_LEVEL
) -> Span:
    """How long the resultant stays above a share of its peak, without a break, around the peak.

    Args:
        acceleration_g: components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].
        level: share of the peak, above 0 and below 1.

    Returns:
        The duration [s] and its interval; crossings are interpolated. 0 without any acceleration.

    Raises:
        PulseError: bad signal or argument.
    """
    if not 0.0 < real_number("level", level) < 1.0:
        raise PulseError(f"level = {level!r}: must be above 0 and below 1")
    return span_about_peak(resultant_g(acceleration_g, time_step), float(time_step), level)


def span_about_peak(resultant: FloatArray, time_step: float, level: float) -> Span:
    """:func:`pulse_duration` of a checked resultant, (n,)."""
    top = int(resultant.argmax())
    threshold = level * float(resultant[top])
    if threshold <= 0.0:
        return Span(0.0, 0.0, 0.0)
    below = np.flatnonzero(resultant <= threshold)
    k = int(below.searchsorted(top))  # the peak lies between below[k - 1] and below[k]
    t1, t2 = 0.0, float(len(resultant) - 1)
    if k > 0:
        i = int(below[k - 1])
        t1 = i + (threshold - resultant[i]) / (resultant[i + 1] - resultant[i])
    if k < len(below):
        i = int(below[k])
        t2 = i - (threshold - resultant[i]) / (resultant[i - 1] - resultant[i])
    return Span(float(t2 - t1) * time_step, float(t1) * time_step, float(t2) * time_step)


def gsi(acceleration_g: ArrayLike, time_step: float) -> float:
    """Gadd Severity Index: the integral of a^2.5 dt over the whole pulse [s, a in g].

    C. W. Gadd, "Use of a weighted-impulse criterion for estimating injury hazard", SAE 660793.

    Args:
        acceleration_g: components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step.
    """
    return severity(resultant_g(acceleration_g, time_step), float(time_step))


def severity(resultant: FloatArray, time_step: float) -> float:
    """:func:`gsi` of a checked resultant, (n,)."""
    rate = resultant * resultant * np.sqrt(resultant)
    return float(rate.sum() - 0.5 * (rate[0] + rate[-1])) * time_step


def hic_d(hic36: float) -> float:
    """HIC(d) of the free-motion headform, 0.75446 HIC36 + 166.4 (49 CFR 571.201, S7)."""
    return 0.75446 * hic36 + 166.4


def sfc(acceleration_g: ArrayLike, time_step: float) -> Span:
    """Skull Fracture Correlate: the mean acceleration over the HIC15 window [g].

    M. Vander Vorst et al., "Statistically and biomechanically based criterion for impact-induced
    skull fracture", AAAM 2003: below 120 g for a 15 % probability of fracture.

    Args:
        acceleration_g: components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step.
    """
    return mean_of_window(hic(acceleration_g, time_step, 0.015))


def mean_of_window(best: Hic) -> Span:
    """The mean acceleration behind a HIC value [g] and its window; 0 without a window."""
    length = best.t2 - best.t1
    return Span((best.value / length) ** 0.4 if length > 0.0 else 0.0, best.t1, best.t2)


def dwell(acceleration_g: ArrayLike, time_step: float, threshold: float) -> float:
    """The total time above a threshold [s], crossings interpolated.

    Args:
        acceleration_g: components (n, 3) or resultant (n,) [g].
        time_step: sampling interval [s].
        threshold: in g, above 0.

    Raises:
        PulseError: bad signal or argument.
    """
    level = positive("threshold", threshold, "g")
    return time_above(resultant_g(acceleration_g, time_step), float(time_step), level)


def time_above(resultant: FloatArray, time_step: float, threshold: float) -> float:
    """:func:`dwell` of a checked resultant, (n,)."""
    above = resultant >= threshold
    if not above.any():
        return 0.0
    inside = float(np.count_nonzero(above[1:] & above[:-1]))
    crossing = np.flatnonzero(above[1:] ^ above[:-1])
    one, other = resultant[crossing], resultant[crossing + 1]
    high = np.maximum(one, other)
    return (inside + float(((high - threshold) / np.abs(one - other)).sum())) * time_step


def velocity_change(acceleration_g: ArrayLike, time_step: float) -> Span:
    """The largest change of velocity since the first sample, its value in m/s.

    Args:
        acceleration_g: components (n, 3) or one signed axis (n,) [g].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step.
    """
    resultant_g(acceleration_g, time_step)
    acceleration = np.asarray(acceleration_g, dtype=np.float64, order="F") * STANDARD_GRAVITY
    return largest_change(velocity(acceleration, float(time_step)), float(time_step))


def largest_change(gained: FloatArray, time_step: float) -> Span:
    """:func:`velocity_change` of the velocity since the first sample, (n,) or (n, 3) [m/s]."""
    speed = magnitude(gained)
    i = int(speed.argmax())
    return Span(float(speed[i]), 0.0, i * time_step)


def velocity(acceleration: FloatArray, time_step: float) -> FloatArray:
    """The integral of the acceleration from the first sample on, by the trapezoidal rule."""
    change = np.zeros_like(acceleration)
    steps = acceleration[1:] + acceleration[:-1]
    steps *= 0.5 * time_step
    steps.cumsum(axis=0, out=change[1:])
    return change
