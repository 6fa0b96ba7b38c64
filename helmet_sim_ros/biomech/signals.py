"""The signals of a record that criteria are computed from, each made when first asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from helmet_sim_ros.biomech import catalogue, helmet, linear, rotation
from helmet_sim_ros.biomech.filters import filtered, is_too_coarse, sample_rate_warning
from helmet_sim_ros.biomech.hic import Hic, maximum_window
from helmet_sim_ros.biomech.pulse import (
    STANDARD_GRAVITY,
    FloatArray,
    finite_array,
    magnitude,
    uniform_time_step,
)
from helmet_sim_ros.biomech.record import CHANNELS, ImpactRecord
from helmet_sim_ros.errors import PulseError

#: Channels of a record that some criterion is computed from; all are checked, whichever is wanted.
CHECKED = (
    "head_acceleration", "head_velocity", "head_orientation", "head_angular_acceleration",
    "head_angular_velocity", "neck_force", "neck_torque", "ground_force", "ground_friction",
    "coupling_force", "coupling_displacement",
)  # fmt: skip
#: Changes of velocity below this [m/s] are too small to tell a unit from.
SMALL_CHANGE = 0.5


class NotGiven(Exception):
    """A record does not give a criterion; the text is the warning, empty if none is due."""


class Signals(ABC):
    """What exists both raw and filtered: four channels, and what comes from them.

    Attributes:
        step: sampling interval [s].
    """

    step: float

    @property
    @abstractmethod
    def acceleration(self) -> FloatArray:
        """Of the head, shape (n, 3) [m/s^2]."""

    @property
    @abstractmethod
    def angular_acceleration(self) -> FloatArray:
        """Of the head, head axes, shape (n, 3) [rad/s^2]."""

    @property
    @abstractmethod
    def neck_force(self) -> FloatArray:
        """Shape (n, 3) [N]."""

    @property
    @abstractmethod
    def neck_torque(self) -> FloatArray:
        """Shape (n, 3) [N m]."""

    @cached_property
    def resultant(self) -> FloatArray:
        """Amount of the acceleration of the head, shape (n,) [g]."""
        return magnitude(self.acceleration / STANDARD_GRAVITY)

    @cached_property
    def gained(self) -> FloatArray:
        """Velocity of the head since the first sample, shape (n, 3) [m/s]."""
        return linear.velocity(self.acceleration, self.step)

    @cached_property
    def hic(self) -> Hic:
        """HIC, any window."""
        return maximum_window(self.resultant, self.step)

    @cached_property
    def hic36(self) -> Hic:
        """HIC, windows of up to 36 ms."""
        return self._shortened(self.hic, 0.036)

    @cached_property
    def hic15(self) -> Hic:
        """HIC, windows of up to 15 ms."""
        return self._shortened(self.hic36, 0.015)

    def _shortened(self, best: Hic, window: float) -> Hic:
        """The maximum within ``window``, given the one within a longer window."""
        if best.t2 - best.t1 <= window * (1.0 + 1e-12):
            return best  # the best of more windows is the best of these
        return maximum_window(self.resultant, self.step, window)

    @cached_property
    def clip_3ms(self) -> linear.Span:
        """The level kept for 3 ms [g]."""
        lags = linear.CLIP_DURATION / self.step
        if lags > (len(self.resultant) - 1) * (1.0 + 1e-12):
            raise NotGiven("clip_3ms: the record is shorter than 3 ms")
        return linear.kept_level(self.resultant, self.step, lags)

    @cached_property
    def spin(self) -> FloatArray:
        """Amount of the angular acceleration of the head, shape (n,) [rad/s^2]."""
        return magnitude(self.angular_acceleration)


class RawSignals(Signals):
    """The signals of a record as they are.

    Attributes:
        record: the record itself.
    """

    def __init__(self, record: ImpactRecord) -> None:
        """Check the record.

        Raises:
            PulseError: a channel is not finite, the time is not uniform, an orientation is none,
                or the acceleration is in another unit than the velocity says.
        """
        self.record = record
        self.step = uniform_time_step(record.time)
        self._channels = _checked(record)
        rotation.refuse_no_rotation(self._channels["head_orientation"])
        self._refuse_wrong_unit()

    @property
    def acceleration(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._channels["head_acceleration"]

    @cached_property
    def angular_acceleration(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._head_axes("head_angular_acceleration")

    @property
    def neck_force(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._channels["neck_force"]

    @property
    def neck_torque(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._channels["neck_torque"]

    @cached_property
    def angular_velocity(self) -> FloatArray:
        """Of the head, head axes, shape (n, 3) [rad/s]."""
        return self._head_axes("head_angular_velocity")

    @cached_property
    def rate(self) -> FloatArray:
        """Amount of the angular velocity of the head, shape (n,) [rad/s]."""
        return magnitude(self.angular_velocity)

    @cached_property
    def rate_peaks(self) -> rotation.Peaks:
        """The largest angular velocity about each head axis [rad/s]."""
        return rotation.axis_peaks(self.angular_velocity)

    @cached_property
    def ground_parts(self) -> tuple[FloatArray, FloatArray]:
        """The ground's force normal to the surface and along it, each (n, 3) [N]."""
        friction = self._channels["ground_friction"]
        return self._channels["ground_force"] - friction, friction

    @property
    def normal_velocity(self) -> FloatArray:
        """Of the head, away from the surface, shape (n,) [m/s]."""
        away: FloatArray = self._channels["head_velocity"] @ helmet.contact_normal(
            self.ground_parts[0]
        )
        return away

    @cached_property
    def ground_amounts(self) -> tuple[FloatArray, FloatArray]:
        """Normal and tangential force of the ground, each (n,) [N]."""
        return helmet.normal_and_tangential(*self.ground_parts)

    @cached_property
    def compression(self) -> FloatArray:
        """Amount of the displacement of the helmet against the head, shape (n,) [m]."""
        return magnitude(self._channels["coupling_displacement"])

    @cached_property
    def energy(self) -> helmet.Energy:
        """Of the coupling."""
        return helmet.work(
            self._channels["coupling_force"], self._channels["coupling_displacement"]
        )

    def _head_axes(self, channel: str) -> FloatArray:
        channels = self._channels
        return rotation.turned_back(channels[channel], channels["head_orientation"])

    def _refuse_wrong_unit(self) -> None:
        """Refuse an acceleration in g, or too large by 9.80665, which the velocity gives away."""
        change = self._channels["head_velocity"]
        change = change - change[0]
        scale = float(magnitude(change).max())
        if scale < SMALL_CHANGE:
            return

        def misfit(factor: float) -> float:
            return float(magnitude(change - factor * self.gained).max()) / scale

        if misfit(1.0) < 0.1:
            return
        if misfit(STANDARD_GRAVITY) < 0.1:
            raise PulseError(
                "head_acceleration: looks like g where m/s^2 is meant: the change of head_velocity "
                "is 9.81 times its integral"
            )
        if misfit(1.0 / STANDARD_GRAVITY) < 0.1:
            raise PulseError(
                "head_acceleration: larger than m/s^2 by 9.81: its integral is 9.81 times the "
                "change of head_velocity"
            )


class FilteredSignals(Signals):
    """The signals of a record after the channel filters, each filtered when first asked for.

    Attributes:
        warning: what weakens them; empty before any was asked for.
    """

    def __init__(self, raw: Signals) -> None:
        self.step = raw.step
        self.warning = ""
        self._raw = raw

    def _filtered(self, channel: FloatArray, channel_class: float) -> FloatArray:
        if is_too_coarse(1000.0, self.step):
            raise NotGiven(
                f"no CFC 1000 values: sampled at {1e-3 / self.step:.4g} kHz, which is too coarse"
            )
        self.warning = sample_rate_warning(1000, self.step)
        return filtered(channel, channel_class, self.step)

    @cached_property
    def acceleration(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._filtered(self._raw.acceleration, 1000)

    @cached_property
    def angular_acceleration(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._filtered(self._raw.angular_acceleration, 1000)

    @cached_property
    def neck_force(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._filtered(self._raw.neck_force, 1000)

    @cached_property
    def neck_torque(self) -> FloatArray:
        """See :class:`Signals`."""
        return self._filtered(self._raw.neck_torque, catalogue.MOMENT_CLASS)


def _checked(record: ImpactRecord) -> dict[str, FloatArray]:
    """The channels in ``CHECKED``, each (n, 3) or (n, 4), stored column by column in one table."""
    table = np.empty((sum(len(CHANNELS[name][0]) for name in CHECKED), len(record)))
    channels, row = {}, 0
    for name in CHECKED:
        width = len(CHANNELS[name][0])
        channels[name] = table[row : row + width].T
        row += width
    try:
        for name, columns in channels.items():
            np.copyto(columns, getattr(record, name), casting="same_kind")
        sound = bool(np.isfinite(table).all())
    except TypeError:  # other numbers than real ones
        sound = False
    if not sound:
        for name, columns in channels.items():
            columns[:] = finite_array(name, getattr(record, name), columns.shape[1])
    return channels
