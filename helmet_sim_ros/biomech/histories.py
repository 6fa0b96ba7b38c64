"""How alike two histories are: the objective rating of ISO/TS 18571, and chatter.

The rating of ISO/TS 18571:2014 (2nd ed. 2024), *Road vehicles - Objective rating metric for
non-ambiguous signals*, is a weighted sum of four ratings from 0 to 1: corridor 0.4, phase 0.2,
magnitude 0.2 and slope 0.2. Its constants below are those of the specification as open programs
for it state them; the specification itself was not read.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from helmet_sim_ros.biomech.filters import cfc
from helmet_sim_ros.biomech.pulse import FloatArray, finite_array, magnitude, positive, resultant_g
from helmet_sim_ros.biomech.record import CHANNELS, ImpactRecord
from helmet_sim_ros.errors import PulseError

#: Sampling interval that the rating is defined for, 10 kHz [s] (ISO/TS 18571).
RATED_STEP = 1e-4
#: Weights of corridor, phase, magnitude and slope (ISO/TS 18571).
WEIGHTS = (0.4, 0.2, 0.2, 0.2)
#: Half-widths of the inner and the outer corridor over the reference's peak, and the power of the
#: rating between them (ISO/TS 18571).
CORRIDOR = (0.05, 0.5, 2.0)
#: Largest shift in time, and half-width of the warping window, over the interval (ISO/TS 18571).
LARGEST_SHIFT, WARPING = 0.2, 0.1
#: Errors of magnitude and of slope from which on their ratings are 0 (ISO/TS 18571).
MAGNITUDE_ERROR, SLOPE_ERROR = 0.5, 2.0
#: Samples over which slopes are averaged (ISO/TS 18571); fewer at the ends.
SLOPE_SAMPLES = 9
#: Shortest interval [samples] that can be rated: two spans of the averaged slope (choice).
SHORTEST = 2 * SLOPE_SAMPLES
#: Longest [samples], 1 s: the warping takes time and memory with the square of it (choice).
LONGEST = 10_000
#: Grades of the rating, from the best on: above 0.94, 0.80, 0.58 (ISO/TS 18571).
GRADES = ((0.94, "excellent"), (0.80, "good"), (0.58, "fair"), (-math.inf, "poor"))

#: What is chatter in a head acceleration: spikes narrower [s] and higher [g] than this (choices: a
#: head in a helmet is never loaded and released within 0.3 ms; CFC 1000 lets such a spike pass).
SPIKE_WIDTH, SPIKE_HEIGHT = 3e-4, 5.0


class Rating(NamedTuple):
    """Objective rating of one history against a reference, each from 0 (unlike) to 1 (alike).

    Attributes:
        total: weighted sum of the others.
        corridor: share of the time within a corridor about the reference.
        phase: by the shift in time that makes the curves most alike.
        magnitude: by the difference that is left after that shift and after warping.
        slope: by the difference of the slopes after that shift.
    """

    total: float
    corridor: float
    phase: float
    magnitude: float
    slope: float

    @property
    def grade(self) -> str:
        """``excellent``, ``good``, ``fair`` or ``poor``."""
        return next(grade for above, grade in GRADES if self.total > above)


class Chatter(NamedTuple):
    """Spikes narrower than a width.

    Attributes:
        height: of the highest [g].
        time: when it is, from the first sample [s].
        spikes: how many are higher than the threshold.
    """

    height: float
    time: float
    spikes: int


def rating(reference: ArrayLike, history: ArrayLike) -> Rating:
    """The objective rating of a history against a reference (ISO/TS 18571).

    Both are one component or one resultant over the same interval at 10 kHz
    (:func:`channel_rating` brings records into that form). The interval decides: much rest before
    or after the pulse raises the rating. Not symmetric: corridor and errors are measured by the
    reference. Meant for non-ambiguous signals of one event; where the reference is nearly nothing
    but noise, the rating says nothing.

    Args:
        reference: shape (n,), any unit.
        history: shape (n,), the same unit, n from 18 to 10 000.

    Raises:
        PulseError: bad signals, of different or unfit length, or a reference that is constant.
    """
    target = finite_array("reference", reference, minimum=SHORTEST)
    ours = finite_array("history", history, minimum=SHORTEST)
    if len(target) != len(ours):
        raise PulseError(f"history: {len(ours)} samples, the reference has {len(target)}")
    if len(target) > LONGEST:
        raise PulseError(f"reference: {len(target)} samples, at most {LONGEST} can be rated")
    if np.ptp(target) == 0.0:
        raise PulseError("reference: is constant, nothing can be rated against it")
    shift = best_shift(target, ours)
    late, kept = max(shift, 0), len(ours) - abs(shift)
    moved, rest = ours[late : late + kept], target[late - shift : late - shift + kept]
    parts = (
        _corridor(target, ours),
        _linear(abs(shift), LARGEST_SHIFT * len(target)),
        _linear(_warped_error(rest, moved), MAGNITUDE_ERROR),
        _linear(_relative(_slopes(rest), _slopes(moved)), SLOPE_ERROR),
    )
    return Rating(sum(w * part for w, part in zip(WEIGHTS, parts, strict=True)), *parts)


def channel_rating(
    reference: ImpactRecord,
    record: ImpactRecord,
    channel: str = "head_acceleration",
    duration: float = math.inf,
) -> Rating:
    """The rating of one channel of a record against that of another.

    The resultants (CFC 1000 of each component) are compared at 10 kHz, from the first touch on.

    Args:
        reference: what the rating is against.
        record: what is rated.
        channel: a vector of the record.
        duration: interval that is compared, at most the shorter record [s].

    Raises:
        PulseError: unknown channel, or the channels cannot be rated (see :func:`rating`).
    """
    if channel not in CHANNELS:
        raise PulseError(f"channel = {channel!r}: must be one of {', '.join(CHANNELS)}")
    end = min(duration, *(float(r.time[-1] - r.time[0]) for r in (reference, record)))
    grid = np.arange(math.floor(end / RATED_STEP + 1e-6) + 1) * RATED_STEP
    curves = []
    for one in (reference, record):
        values = cfc(getattr(one, channel)[:, :3], 1000.0, one.time_step)
        curves.append(np.interp(grid, one.time - one.time[0], magnitude(values)))
    return rating(*curves)


def chatter(
    acceleration_g: ArrayLike,
    time_step: float,
    width: float = SPIKE_WIDTH,
    threshold: float = SPIKE_HEIGHT,
) -> Chatter:
    """Spikes of a head acceleration that are narrower than a width.

    A spike is what the morphological opening of the resultant with a flat element of that width
    takes away (the white top-hat of Serra, Image Analysis and Mathematical Morphology, 1982): a
    flank however steep and a pulse however high are left alone as long as they are wider.

    Args:
        acceleration_g: unfiltered, shape (n, 3), or one resultant, shape (n,) [g].
        time_step: sampling interval, at most half the width [s].
        width: [s]. A spike narrower than this counts.
        threshold: height from which on a spike is counted [g].

    Raises:
        PulseError: bad signal or argument, a record shorter than the width, or sampling too coarse
            to tell a spike.
    """
    values = resultant_g(acceleration_g, time_step)
    across = math.ceil(positive("width", width) / time_step - 1e-9)
    least = positive("threshold", threshold, "g")
    if 2.0 * time_step > width * (1.0 + 1e-9):
        raise PulseError(
            f"time_step = {time_step:g} s: must be at most half the width of a spike, {width:g} s"
        )
    if len(values) <= across:
        raise PulseError(f"acceleration_g: {len(values)} samples last no longer than {width:g} s")
    # Beyond the record its first and last values go on, as for the filters.
    padded = np.pad(values, across, mode="edge")
    eroded = sliding_window_view(padded, across + 1).min(axis=1)
    opened = sliding_window_view(eroded, across + 1).max(axis=1)
    spikes = values - opened
    i = int(spikes.argmax())
    above = spikes > least
    count = int(above[0]) + int(np.count_nonzero(above[1:] & ~above[:-1]))
    return Chatter(float(spikes[i]), i * time_step, count)


def best_shift(reference: FloatArray, history: FloatArray) -> int:
    """By how many samples a history is late: the shift with the largest correlation coefficient.

    Of equal ones the smallest, at most a fifth of the interval. Shape (n,) each.
    """
    n = len(reference)
    best, found = 0, -math.inf
    for size in range(math.floor(LARGEST_SHIFT * n) + 1):
        for shift in dict.fromkeys((size, -size)):
            ours, target = (
                (history[shift:], reference[: n - shift])
                if shift > 0
                else (history[: n + shift], reference[-shift:])
            )
            a, b = ours - ours.mean(), target - target.mean()
            norm = math.sqrt(float(a @ a) * float(b @ b))
            if norm > 0.0 and float(a @ b) / norm > found + 1e-12:
                best, found = shift, float(a @ b) / norm
    return best


def _corridor(reference: FloatArray, history: FloatArray) -> float:
    inner, outer, power = CORRIDOR
    peak = float(np.abs(reference).max())
    share = (outer * peak - np.abs(history - reference)) / ((outer - inner) * peak)
    return float((np.clip(share, 0.0, 1.0) ** power).mean())


def _linear(error: float, limit: float) -> float:
    """1 without an error, 0 from the limit on."""
    return max(0.0, 1.0 - error / limit)


def _relative(reference: FloatArray, values: FloatArray) -> float:
    """Sum of the amounts of the differences over that of the reference."""
    difference, scale = (float(np.abs(x).sum()) for x in (values - reference, reference))
    if scale == 0.0:
        return 0.0 if difference == 0.0 else math.inf
    return difference / scale


def _slopes(values: FloatArray) -> FloatArray:
    """Central differences, averaged over nine samples, over 1, 3, 5 and 7 at the ends."""
    slope = np.gradient(values)
    half = SLOPE_SAMPLES // 2
    total = np.concatenate([[0.0], np.cumsum(slope)])
    i = np.arange(len(slope))
    reach = np.minimum(half, np.minimum(i, i[::-1]))
    mean: FloatArray = (total[i + reach + 1] - total[i - reach]) / (2 * reach + 1)
    return mean


def _warped_error(reference: FloatArray, values: FloatArray) -> float:
    """Relative difference along the path that dynamic time warping finds."""
    i, j = warping_path(reference, values, math.ceil(WARPING * len(values)) - 1)
    return _relative(reference[i], values[j])


def warping_path(
    reference: FloatArray, values: FloatArray, window: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Dynamic time warping: the pairs of samples whose squared differences have the least sum.

    Steps go on by one sample in either curve or in both (of equal sums: in both), and pairs lie
    within ``window`` samples (Sakoe & Chiba 1978). Shape (n,) each; returns indices into either.
    """
    n = len(reference)
    before = np.full(n + 1, math.inf)  # sums up to the last diagonal i + j, by i + 1
    earlier = np.full(n + 1, math.inf)  # and up to the one before
    steps: list[tuple[int, NDArray[np.int8]]] = []
    for diagonal in range(2 * n - 1):
        first = max(0, diagonal - n + 1, (diagonal - window + 1) // 2)
        last = min(n - 1, diagonal, (diagonal + window) // 2)
        i = np.arange(first, last + 1)
        choices = np.stack([earlier[i], before[i], before[i + 1]])  # both, reference, values
        step = choices.argmin(axis=0)
        sums = choices[step, np.arange(len(i))] if diagonal else np.zeros(1)
        steps.append((first, step.astype(np.int8)))
        current = np.full(n + 1, math.inf)
        current[i + 1] = sums + (reference[i] - values[diagonal - i]) ** 2
        earlier, before = before, current
    i_now = j_now = n - 1
    path = [(i_now, j_now)]
    while i_now or j_now:
        first, step = steps[i_now + j_now]
        taken = int(step[i_now - first])
        i_now -= taken != 2
        j_now -= taken != 1
        path.append((i_now, j_now))
    pairs = np.array(path[::-1], dtype=np.int64)
    return pairs[:, 0], pairs[:, 1]
