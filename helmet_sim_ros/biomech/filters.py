"""Channel frequency class filters of SAE J211-1 and ISO 6487.

A two-pole Butterworth low-pass, run forward and backward (four poles, no phase shift). Its
coefficients are those of SAE J211-1 (March 1995), appendix C, for a corner at 2.0775 CFC of each
pass, which gives the two passes together -3 dB at CFC / 0.6.
"""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from helmet_sim_ros.biomech.pulse import FloatArray, finite_array, positive
from helmet_sim_ros.biomech.recursion import recursion
from helmet_sim_ros.errors import PulseError

#: Corner frequency of one pass over the class (SAE J211-1).
CORNER = 2.0775
#: Fewest samples per second over the class (SAE J211-1: ten times the class, 10 kHz for CFC 1000).
SAMPLES_PER_CLASS = 10.0
#: Most samples for which the filter settles behind the signal: CFC 60 at 20 MHz (a choice, so that
#: a time step in the wrong unit does not fill the memory).
LONGEST_TAIL = 1_000_000
#: What a transient of the first pass has decayed to where the second starts.
SETTLED = 1e-12
#: Samples on either side of one that the numerators of both passes together reach.
BEFORE = 2


class SampleRateWarning(UserWarning):
    """The sampling rate is below what the filter class needs."""


def cfc_coefficients(channel_class: float, time_step: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator of one pass, three each, the denominator's first being 1.

    Args:
        channel_class: 60, 180, 600, 1000 or any other [Hz].
        time_step: sampling interval [s].

    Raises:
        PulseError: not a number above 0, the corner is beyond the Nyquist frequency, or so low that
            the filter would take more than ``LONGEST_TAIL`` samples to settle.
    """
    corner = 2.0 * math.pi * CORNER * positive("channel_class", channel_class, "Hz")
    half_turn = 0.5 * corner * positive("time_step", time_step)
    if is_too_coarse(channel_class, time_step):
        raise PulseError(
            f"time_step = {time_step:g} s: too coarse for CFC {channel_class:g}, whose corner is "
            "beyond half the sampling rate"
        )
    if _settling(corner, time_step) > LONGEST_TAIL:
        raise PulseError(
            f"time_step = {time_step:g} s: too fine for CFC {channel_class:g}, which would take "
            f"more than {LONGEST_TAIL} samples to settle"
        )
    w = math.tan(half_turn)
    scale = 1.0 + math.sqrt(2.0) * w + w * w
    gain = w * w / scale
    feedback = [1.0, 2.0 * (w * w - 1.0) / scale, (1.0 - math.sqrt(2.0) * w + w * w) / scale]
    return np.array([gain, 2.0 * gain, gain]), np.array(feedback)


def is_too_coarse(channel_class: float, time_step: float) -> bool:
    """Whether the corner of one pass is at or beyond half the sampling rate: no such filter."""
    return 2.0 * CORNER * channel_class * time_step >= 1.0


def sample_rate_warning(channel_class: float, time_step: float) -> str:
    """What is wrong with the sampling rate for this class; empty if nothing is."""
    if SAMPLES_PER_CLASS * channel_class * time_step <= 1.0 + 1e-9:
        return ""
    return (
        f"sampled at {1e-3 / time_step:.4g} kHz, but CFC {channel_class:g} needs at least "
        f"{1e-3 * SAMPLES_PER_CLASS * channel_class:.4g} kHz (SAE J211)"
    )


def cfc(values: ArrayLike, channel_class: float, time_step: float) -> FloatArray:
    """A signal after the channel frequency class filter.

    Before its first and after its last sample the signal is taken to rest at that sample's value,
    so a pulse that starts with the record is not distorted; nothing is mirrored into it.

    Args:
        values: shape (n,) or (n, 3), any unit.
        channel_class: 60, 180, 600, 1000 or any other [Hz].
        time_step: sampling interval [s].

    Returns:
        The filtered signal, same shape and unit.

    Warns:
        SampleRateWarning: fewer than ten samples per second and hertz of the class.

    Raises:
        PulseError: bad signal or argument, or a time step that the class cannot work with.
    """
    signal = finite_array("values", values, 0, 3)
    cfc_coefficients(channel_class, time_step)  # refuse bad arguments before warning about them
    if problem := sample_rate_warning(channel_class, time_step):
        warnings.warn(problem, SampleRateWarning, stacklevel=2)
    return filtered(signal, channel_class, time_step)


def filtered(signal: FloatArray, channel_class: float, time_step: float) -> FloatArray:
    """:func:`cfc` of a checked signal, without the warning; stored column by column."""
    if not signal.any():  # the neck of a headform
        return np.zeros_like(signal)
    design, n = _design(channel_class, time_step), len(signal)
    rows = signal.T  # the samples along the last axis
    first = rows[..., :1]  # a constant passes unchanged, so it is left out of the recursions
    rest = np.empty((*rows.shape[:-1], n + design.tail))
    rest[..., :BEFORE] = 0.0
    np.subtract(rows, first, out=rest[..., BEFORE : BEFORE + n])
    rest[..., BEFORE + n :] = rest[..., BEFORE + n - 1 : BEFORE + n]
    forward = recursion(design.a, rest)
    settled = forward[..., -1:].copy()
    forward -= settled
    backward = recursion(design.a, forward, backward=True)
    answer = _spread(backward[..., : n + 2 * BEFORE])
    answer *= design.gain**2
    answer += first + settled * (4.0 * design.gain)
    return answer.T


def _spread(rows: FloatArray) -> FloatArray:
    """The numerators of both passes but for their gain, 1, 2, 1 each, about every inner sample."""
    for _ in range(2 * BEFORE):
        rows = rows[..., 1:] + rows[..., :-1]
    return rows


class _Design(NamedTuple):
    """One pass: gain of its numerator 1, 2, 1; denominator; settling samples."""

    gain: float
    a: FloatArray
    tail: int


@lru_cache(maxsize=32)
def _design(channel_class: float, time_step: float) -> _Design:
    b, a = cfc_coefficients(channel_class, time_step)
    tail = math.ceil(_settling(2.0 * math.pi * CORNER * channel_class, time_step))
    return _Design(float(b[0]), a, tail)


def _settling(corner: float, time_step: float) -> float:
    """Samples until a transient has decayed, with the real part of the poles, corner / sqrt(2)."""
    return -math.log(SETTLED) * math.sqrt(2.0) / (corner * time_step)
