"""The histories of one impact as a matplotlib figure."""

from __future__ import annotations

import io

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.helmet import compression, ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.present.words import impact_label

_SIZE = (10.0, 6.2)  # inches


class ShownFigure(Figure):
    """A figure that a notebook shows by itself, once, without pyplot's memory of it."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=110)
        return stream.getvalue()


def record_figure(record: ImpactRecord) -> Figure:
    """Acceleration, forces and rotation over time, and the loop of the coupling."""
    figure = ShownFigure(figsize=_SIZE, layout="constrained")
    figure.suptitle(impact_label(record.setup))
    (top_left, top_right), (left, right) = figure.subplots(2, 2)
    time = record.time * 1e3
    normal, tangential = ground_components(record.ground_force, record.ground_friction)
    _draw(top_left, time, "head acceleration [g]",
          {"": magnitude(record.head_acceleration) / STANDARD_GRAVITY})  # fmt: skip
    _draw(top_right, time, "force on the helmet [kN]",
          {"normal": normal / 1e3, "tangential": tangential / 1e3})  # fmt: skip
    _draw(left, time, "angular acceleration [krad/s²]",
          {"acceleration": magnitude(record.head_angular_acceleration) / 1e3})  # fmt: skip
    speed = left.twinx()
    speed.plot(time, magnitude(record.head_angular_velocity), color="C1", lw=1.3)
    speed.set_ylabel("angular velocity [rad/s]", color="C1")
    depth = compression(record.coupling_displacement) * 1e3
    right.plot(depth, magnitude(record.coupling_force) / 1e3, lw=1.3)
    right.set(xlabel="compression [mm]", ylabel="force on the head [kN]")
    right.grid(alpha=0.3)
    return figure


def _draw(axes: Axes, time: FloatArray, label: str, curves: dict[str, FloatArray]) -> None:
    for name, curve in curves.items():
        axes.plot(time, curve, lw=1.3, label=name)
    axes.set(xlabel="time [ms]", ylabel=label)
    axes.grid(alpha=0.3)
    if len(curves) > 1:
        axes.legend(frameon=False)
