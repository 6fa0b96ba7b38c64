"""A pulse that was measured, not simulated: from arrays or a CSV file, for the same criteria."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NoReturn

import numpy as np

from helmet_sim_ros.biomech import rotation
from helmet_sim_ros.biomech.pulse import (
    STANDARD_GRAVITY,
    FloatArray,
    finite_array,
    magnitude,
    positive,
    refuse_implausible,
    uniform_time_step,
)
from helmet_sim_ros.biomech.signals import NotGiven, Signals
from helmet_sim_ros.errors import PulseError


@dataclass(frozen=True)
class MeasuredPulse:
    """What sensors in a head measured. Row ``i`` of every array belongs to ``time[i]``.

    The acceleration is inertial, as a criterion wants it: an accelerometer that reads 1 g at rest
    has its offset removed.

    Attributes:
        time: shape (n,) [s], uniform.
        acceleration: of the head's centre of gravity, shape (n, 3), any fixed axes; or of a single
            axis or the resultant, shape (n,) [m/s^2].
        angular_velocity: head axes (x forward, y left, z up), shape (n, 3) [rad/s]; None: not
            measured.
        angular_acceleration: head axes, shape (n, 3) [rad/s^2]; None: not measured. It is not
            derived from the velocity: how to differentiate a signal is the laboratory's choice.
        normal_velocity: speed of the impact along its drop direction [m/s], which a standard
            prescribes; None: not known.

    Raises:
        PulseError: wrong shape, not finite, time not uniform, or an acceleration that can only be
            in another unit.
    """

    time: FloatArray
    acceleration: FloatArray
    angular_velocity: FloatArray | None = None
    angular_acceleration: FloatArray | None = None
    normal_velocity: float | None = None
    setup: Mapping[str, object] = field(init=False, default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        step = uniform_time_step(self.time)
        for name, widths in (
            ("acceleration", (0, 3)), ("angular_velocity", (3,)), ("angular_acceleration", (3,)),
        ):  # fmt: skip
            values = getattr(self, name)
            if values is None and name != "acceleration":
                continue
            array = finite_array(name, values, *widths)
            if len(array) != len(self.time):
                raise PulseError(f"{name}: {len(array)} samples, but time has {len(self.time)}")
            object.__setattr__(self, name, array)
        refuse_implausible(magnitude(self.acceleration) / STANDARD_GRAVITY, step)
        if self.normal_velocity is not None:
            speed = positive("normal_velocity", self.normal_velocity, "m/s")
            object.__setattr__(self, "setup", {"impact.normal_velocity": speed})

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        measured = [
            n for n in ("angular_velocity", "angular_acceleration") if getattr(self, n) is not None
        ]
        last = float(self.time[-1] - self.time[0]) * 1e3
        return (
            f"<measured pulse: {len(self)} samples in {last:.4g} ms, "
            f"{', '.join(['acceleration', *measured])}>"
        )


class MeasuredSignals(Signals):
    """The signals of a measured pulse; those that were not measured are not given.

    Attributes:
        record: the pulse itself.
    """

    def __init__(self, pulse: MeasuredPulse) -> None:
        self.record = pulse
        self.step = uniform_time_step(pulse.time)
        single = pulse.acceleration.ndim == 1
        self._acceleration = np.zeros((len(pulse), 3), order="F")
        self._acceleration[:, : 1 if single else 3] = pulse.acceleration.reshape(len(pulse), -1)

    @property
    def acceleration(self) -> FloatArray:
        """See :class:`Signals`; a single axis or resultant stands in the first column."""
        return self._acceleration

    @property
    def angular_acceleration(self) -> FloatArray:
        """See :class:`Signals`."""
        return _given(self.record.angular_acceleration, "angular acceleration")

    @property
    def angular_velocity(self) -> FloatArray:
        """Of the head, head axes, shape (n, 3) [rad/s]."""
        return _given(self.record.angular_velocity, "angular velocity")

    @cached_property
    def rate(self) -> FloatArray:
        """Amount of the angular velocity of the head, shape (n,) [rad/s]."""
        return magnitude(self.angular_velocity)

    @cached_property
    def rate_peaks(self) -> rotation.Peaks:
        """The largest angular velocity about each head axis [rad/s]."""
        return rotation.axis_peaks(self.angular_velocity)

    @property
    def neck_force(self) -> FloatArray:
        """Not measured."""
        _beyond_a_head()

    neck_torque = ground_parts = ground_amounts = neck_force
    normal_velocity = compression = energy = neck_force


def _given(values: FloatArray | None, name: str) -> FloatArray:
    if values is None:
        raise NotGiven(f"the {name} was not measured: no criterion that needs it")
    return values


def _beyond_a_head() -> NoReturn:
    raise NotGiven("only the head was measured: no criterion of helmet, ground and neck")
