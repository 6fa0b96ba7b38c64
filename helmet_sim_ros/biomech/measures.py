"""Every criterion of a record, before any standard judges it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from helmet_sim_ros.biomech import catalogue, helmet, linear, risk, rotation
from helmet_sim_ros.biomech.filters import CORNER, filtered, sample_rate_warning
from helmet_sim_ros.biomech.hic import Hic, maximum_window
from helmet_sim_ros.biomech.neck import NeckLoads, neck_loads
from helmet_sim_ros.biomech.pulse import (
    STANDARD_GRAVITY,
    FloatArray,
    finite_array,
    magnitude,
    uniform_time_step,
)
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion
from helmet_sim_ros.errors import PulseError

#: The setup value that :func:`bottoming` needs.
THICKNESS = "helmet.liner.thickness"
#: Changes of velocity below this [m/s] are too small to tell a unit from.
SMALL_CHANGE = 0.5


class Measures:
    """The criteria of one record, with what weakens them.

    Attributes:
        criteria: by name, in the catalogue's groups.
        warnings: in words.
    """

    def __init__(self, record: ImpactRecord, wanted: Iterable[str] = ()) -> None:
        """Compute them.

        Args:
            record: the impact.
            wanted: names that must be there if they can be; for dwell times beyond the catalogue.

        Raises:
            PulseError: a channel is not finite, the time is not uniform, or the acceleration is
                in another unit than the velocity says.
        """
        self.criteria: dict[str, Criterion] = {}
        self.warnings: list[str] = []
        self._record = record
        self._step = uniform_time_step(record.time)
        self._start = float(record.time[0])
        names = [*catalogue.CATALOGUE, *wanted]
        self._dwells = sorted({t for t in map(catalogue.dwell_threshold, names) if t is not None})

        acceleration = finite_array("head_acceleration", record.head_acceleration, 3)
        self._refuse_wrong_unit(acceleration)
        alpha = self._head_axes("head_angular_acceleration")
        loads = neck_loads(record.neck_force, record.neck_torque)

        self._linear(acceleration / STANDARD_GRAVITY, "")
        self._rotation(alpha)
        self._helmet()
        self._neck(loads)
        self._risk()
        self._filtered(acceleration / STANDARD_GRAVITY, alpha)

    def _add(
        self, name: str, value: float, window: tuple[float, float] | None = None, note: str = ""
    ) -> None:
        if window is not None:
            window = (self._start + window[0], self._start + window[1])
        unit = catalogue.entry(name).unit
        self.criteria[name] = Criterion(name, float(value), unit, window=window, note=note)

    def _head_axes(self, channel: str) -> FloatArray:
        world = getattr(self._record, channel)
        return rotation.to_head_axes(world, self._record.head_orientation, channel)

    def _peak(self, name: str, signal: FloatArray, note: str = "") -> None:
        i = int(signal.argmax())
        self._at(name, signal[i], i, note)

    def _at(self, name: str, value: float, sample: int, note: str = "") -> None:
        unit = catalogue.entry(name).unit
        time = float(self._record.time[sample])
        self.criteria[name] = Criterion(name, float(value), unit, time=time, note=note)

    def _linear(self, acceleration_g: FloatArray, suffix: str) -> None:
        step = self._step
        resultant = magnitude(acceleration_g)
        self._peak("peak_g" + suffix, resultant)
        unlimited = maximum_window(resultant, step)
        hic36 = _shortened(unlimited, resultant, step, 0.036)
        hic15 = _shortened(hic36, resultant, step, 0.015)
        for name, best in (("hic", unlimited), ("hic15", hic15), ("hic36", hic36)):
            self._add(name + suffix, best.value, best[1:])
        mean = linear.mean_of_window(hic15)
        self._add("sfc" + suffix, mean.value, mean[1:])
        self._add("hic_d" + suffix, linear.hic_d(self.criteria["hic36" + suffix].value))
        self._add("gsi" + suffix, linear.severity(resultant, step))
        lags = linear.CLIP_DURATION / step
        if lags <= (len(resultant) - 1) * (1.0 + 1e-12):
            kept = linear.kept_level(resultant, step, lags)
            self._add("clip_3ms" + suffix, kept.value, kept[1:])
        elif not suffix:
            self.warnings.append("clip_3ms: the record is shorter than 3 ms")
        for level in self._dwells:
            self._add(f"dwell_{level:g}g{suffix}", linear.time_above(resultant, step, level))
        pulse = linear.span_about_peak(resultant, step, linear.DURATION_LEVEL)
        self._add("pulse_duration" + suffix, pulse.value, pulse[1:])
        change = linear.largest_change(acceleration_g, step)
        self._add("velocity_change" + suffix, change.value, change[1:])

    def _rotation(self, alpha: FloatArray) -> None:
        omega = self._head_axes("head_angular_velocity")
        self._peak("peak_angular_velocity", magnitude(omega))
        self._peak("peak_angular_acceleration", magnitude(alpha))
        self._add("bric", rotation.bric(omega))
        self._add("bric_mps", rotation.bric(omega, "mps"))
        self._add("bric_csdm", rotation.bric(omega, "csdm"))
        self._add("ubric", rotation.ubric(omega, alpha))
        self._add("damage", rotation.damage(alpha, self._step))
        best = rotation.ric(alpha, self._step)
        self._add("ric", best.value, best[1:])
        peak = self.criteria["peak_angular_velocity"].value
        self._add("klc", rotation.klc(peak, self.criteria["hic36"].value))

    def _helmet(self) -> None:
        record = self._record
        normal, tangential = helmet.ground_components(record.ground_force)
        self._peak("peak_normal_force", normal)
        self._peak("peak_tangential_force", tangential)
        self._add("force_ratio", helmet.peak_force_ratio(record.ground_force))
        self._at("instant_force_ratio", *helmet.instant_force_ratio(record.ground_force))
        self._add("impulse_ratio", helmet.impulse_ratio(record.ground_force))
        self._peak("peak_compression", helmet.compression(record.coupling_displacement))
        if THICKNESS in record.setup:
            most = self.criteria["peak_compression"].value
            share = helmet.bottoming(most, record.setup[THICKNESS])
            self._add("bottoming", share, note="EPS densifies from about 0.65 on")
        energy = helmet.coupling_energy(record.coupling_force, record.coupling_displacement)
        self._add("energy_peak", energy.peak)
        self._add("energy_absorbed", energy.absorbed)
        finite_array("head_velocity", record.head_velocity, 3)
        rebound = helmet.restitution(record.head_velocity[:, 2])
        if rebound is None:
            self.warnings.append("restitution: the head does not approach and rebound")
        else:
            self._add("restitution", rebound)

    def _neck(self, loads: NeckLoads) -> None:
        pressed = loads.compression.max() >= loads.tension.max()
        axial = loads.compression + loads.tension
        self._peak("peak_neck_axial", axial, note="compression" if pressed else "tension")
        self._peak("peak_neck_compression", loads.compression)
        self._peak("peak_neck_tension", loads.tension)
        self._peak("peak_neck_shear", loads.shear)
        self._peak("peak_neck_bending", loads.bending)
        self._peak("peak_neck_torsion", loads.torsion)

    def _risk(self) -> None:
        hic15, bric = self.criteria["hic15"].value, self.criteria["bric_mps"].value
        lognormal = {"risk_skull_fracture": 2, "risk_head_ais3": 3, "risk_head_ais4": 4}
        for name, ais in lognormal.items():
            self._add(name, risk.risk_lognormal(hic15, ais), note=risk.POPULATION_HIC)
        for ais in risk.PRASAD_MERTZ:
            name = "risk_hic_fatal" if ais == 6 else f"risk_hic_ais{ais}"
            self._add(name, risk.risk_prasad_mertz(hic15, ais), note=risk.POPULATION_HIC)
        for ais in risk.BRIC_SCALE:
            value = risk.risk_bric(bric, ais)
            self._add(f"risk_bric_ais{ais}", value, note=risk.POPULATION_BRIC)

    def _filtered(self, acceleration_g: FloatArray, alpha: FloatArray) -> None:
        """The criteria again after the channel filters of SAE J211."""
        step, record = self._step, self._record
        if 2.0 * CORNER * 1000.0 * step >= 1.0:
            self.warnings.append(
                f"no CFC 1000 values: sampled at {1e-3 / step:.4g} kHz, which is too coarse"
            )
            return
        if problem := sample_rate_warning(1000, step):
            self.warnings.append(problem)
        force, torque = np.asarray(record.neck_force), np.asarray(record.neck_torque)
        channels = np.hstack((acceleration_g, alpha, force))
        channels = filtered(channels, 1000, step)
        self._linear(channels[:, :3], "_cfc1000")
        self._peak("peak_angular_acceleration_cfc1000", magnitude(channels[:, 3:6]))
        moments = filtered(torque, catalogue.MOMENT_CLASS, step)
        loads = neck_loads(channels[:, 6:], moments)
        self._peak("peak_neck_compression_cfc1000", loads.compression)
        self._peak("peak_neck_tension_cfc1000", loads.tension)
        self._peak("peak_neck_shear_cfc1000", loads.shear)
        self._peak("peak_neck_bending_cfc600", loads.bending)

    def _refuse_wrong_unit(self, acceleration: FloatArray) -> None:
        """Refuse an acceleration in g, or too large by 9.80665, which the velocity gives away."""
        change = finite_array("head_velocity", self._record.head_velocity, 3)
        change = change - change[0]
        scale = float(magnitude(change).max())
        if scale < SMALL_CHANGE:
            return
        integral = linear.velocity(acceleration, self._step)

        def misfit(factor: float) -> float:
            return float(magnitude(change - factor * integral).max()) / scale

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


def _shortened(best: Hic, resultant: FloatArray, time_step: float, window: float) -> Hic:
    """The maximum within ``window``, given the one within a longer window."""
    if best.t2 - best.t1 <= window * (1.0 + 1e-12):
        return best  # the best of more windows is the best of these
    return maximum_window(resultant, time_step, window)
