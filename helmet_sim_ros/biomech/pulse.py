"""Signals as every criterion wants them: checked, uniform in time, in the unit they claim."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helmet_sim_ros.errors import PulseError

FloatArray = NDArray[np.float64]

#: Standard gravity [m/s^2] (3rd CGPM, 1901; exact).
STANDARD_GRAVITY = 9.80665

#: Largest deviation of one sampling interval from the mean, as a share of it. Stamps rounded to
#: whole nanoseconds stay far below (2e-4 at 100 kHz); one missing sample is 1.
TIME_JITTER = 1e-3

#: Severity (integral of a^2.5 dt, a in g) above which a signal cannot be a head impact in g: 1e5 is
#: 1000 g held for 3 ms, a change of speed of 31 m/s. The most severe bare-headform drops stay near
#: 1e4. The same signal in m/s^2 reads 301 times higher, so a wrong unit is found for every impact
#: with a true severity above 330; a milder one cannot be told from a severe one.
IMPLAUSIBLE_SEVERITY = 1e5


#: Largest amount of any value of a signal, in SI units or g, and the smallest and largest of an
#: argument: far beyond every impact, and far inside what formulas with squares and powers of 2.84
#: can compute (a choice).
LARGEST_VALUE = 1e15
SMALLEST_ARGUMENT = 1e-12


def finite_array(name: str, values: ArrayLike, *columns: int, minimum: int = 2) -> FloatArray:
    """The values as a float array, checked; a table (n, m) is stored column by column.

    Args:
        name: what to call them in an error.
        values: shape (n,) or, for each of ``columns``, (n, columns).
        columns: allowed numbers of columns; 0 stands for shape (n,). Nothing given: (n,).
        minimum: fewest samples.

    Raises:
        PulseError: not numbers, wrong shape, too few samples, NaN, infinity or beyond
            ``LARGEST_VALUE``.
    """
    allowed = columns or (0,)
    try:
        given = np.asarray(values)
        if given.dtype.kind == "c":
            raise TypeError
        # One order in memory: sums of the same samples have the same bits. That of columns, since
        # every criterion works along the samples.
        array = np.asarray(given, dtype=np.float64, order="F")
    except (TypeError, ValueError, OverflowError):
        raise PulseError(f"{name}: must be an array of real numbers") from None
    width = {1: 0}.get(array.ndim, array.shape[1] if array.ndim == 2 else -1)
    if width not in allowed:
        shapes = " or ".join("(n,)" if c == 0 else f"(n, {c})" for c in allowed)
        raise PulseError(f"{name}: shape {array.shape}, expected {shapes}")
    if len(array) < minimum:
        raise PulseError(f"{name}: {len(array)} samples, at least {minimum} are needed")
    if not (array.max() <= LARGEST_VALUE and array.min() >= -LARGEST_VALUE):
        finite = np.isfinite(array)
        wrong = ~(np.abs(array) <= LARGEST_VALUE) if finite.all() else ~finite
        row = int(np.argwhere(wrong)[0][0])
        what = f"beyond {LARGEST_VALUE:g}" if finite.all() else "not finite"
        raise PulseError(f"{name}: {what} at sample {row} ({array[row]})")
    return array


def same_length(**signals: FloatArray) -> None:
    """Refuse signals of different numbers of samples.

    Raises:
        PulseError: names the first that differs from the one before.
    """
    (first, wanted), *others = signals.items()
    for name, signal in others:
        if len(signal) != len(wanted):
            raise PulseError(f"{name}: {len(signal)} samples, {first} has {len(wanted)}")


def positive(name: str, value: float, unit: str = "s") -> float:
    """A number above 0, from ``SMALLEST_ARGUMENT`` to ``LARGEST_VALUE``.

    Raises:
        PulseError: it is not; names the argument.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise PulseError(f"{name} = {value!r:.80}: must be a number above 0 {unit}") from None
    if not (math.isfinite(number) and number > 0.0):
        raise PulseError(f"{name} = {value!r}: must be a finite number above 0 {unit}")
    if not SMALLEST_ARGUMENT <= number <= LARGEST_VALUE:
        raise PulseError(
            f"{name} = {value!r}: must be from {SMALLEST_ARGUMENT:g} to {LARGEST_VALUE:g} {unit}"
        )
    return number


def real_number(name: str, value: float) -> float:
    """A number that is not NaN; infinity is one.

    Raises:
        PulseError: it is none; names the argument.
    """
    try:
        number = float(value)
    except OverflowError:  # an integer beyond every float
        return math.inf if value > 0 else -math.inf
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise PulseError(f"{name} = {value!r:.80}: must be a number")
    return number


def increasing_time(time: ArrayLike, name: str = "time") -> FloatArray:
    """Time stamps as they are, shape (n,) [s].

    Raises:
        PulseError: fewer than two stamps, not finite, or not increasing.
    """
    stamps = finite_array(name, time)
    steps = stamps[1:] - stamps[:-1]
    if steps.min() <= 0.0:
        row = int(np.argmax(steps <= 0.0)) + 1
        raise PulseError(f"{name}: must increase, but sample {row} is at {stamps[row]:.9g} s "
                         f"after {stamps[row - 1]:.9g} s")  # fmt: skip
    return stamps


def uniform_time_step(time: ArrayLike, name: str = "time") -> float:
    """The sampling interval [s] of time stamps, shape (n,) [s].

    Raises:
        PulseError: fewer than two stamps, not finite, not increasing, or not uniform.
    """
    stamps = finite_array(name, time)
    steps = stamps[1:] - stamps[:-1]
    mean = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    worst = int(np.abs(steps - mean).argmax())
    if mean <= 0.0 or abs(steps[worst] - mean) > TIME_JITTER * mean:
        increasing_time(stamps, name)  # says so first
        raise PulseError(
            f"{name}: must be uniform, but the step after sample {worst} is {steps[worst]:.6g} s "
            f"and the mean is {mean:.6g} s"
        )
    return mean


def magnitude(values: FloatArray) -> FloatArray:
    """Length of each row, shape (n, m) -> (n,); of a single axis, shape (n,), its amount."""
    if values.ndim == 1:
        return np.abs(values)
    squares = values * values
    length: FloatArray = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
    return length


def resultant_g(acceleration_g: ArrayLike, time_step: float) -> FloatArray:
    """The resultant of a head acceleration given in g, shape (n,) [g].

    Args:
        acceleration_g: components, shape (n, 3), or one resultant or axis, shape (n,) [g].
        time_step: sampling interval [s].

    Raises:
        PulseError: bad signal or time step, or values that look like m/s^2.
    """
    step = positive("time_step", time_step)
    resultant = magnitude(finite_array("acceleration_g", acceleration_g, 0, 3))
    refuse_implausible(resultant, step)
    return resultant


def refuse_implausible(resultant: FloatArray, time_step: float) -> None:
    """Refuse a resultant [g] that no head impact reaches (see ``IMPLAUSIBLE_SEVERITY``).

    Raises:
        PulseError: the values look like m/s^2.
    """
    severity = float((resultant * resultant * np.sqrt(resultant)).sum()) * time_step
    if severity > IMPLAUSIBLE_SEVERITY:
        raise PulseError(
            f"acceleration_g: peak {resultant.max():.4g} with a severity (integral of a^2.5) of "
            f"{severity:.3g} is no head impact in g; the values look like m/s^2: divide by 9.80665"
        )
