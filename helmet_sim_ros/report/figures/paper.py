"""Figures in the layout of Hyncik & Bonkowski's Figs 3-5 and 7-9, from logged impacts.

Figs 3-5: force over compression in drop tests, and their peaks. Figs 7-9: resultant acceleration
of the head in oblique impacts, one figure per normal speed, one panel per tangential speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.mcap_log import LoggedImpact
from helmet_sim_ros.study.identification.drop_tests import ZONES, approach
from helmet_sim_ros.study.scenario.reference import load_reference

#: The panels of Figs 3 and 4.
DROP_FIGURES = {"fig3": ("front", "back"), "fig4": ("side", "top")}
#: Normal speeds [m/s] of Figs 7 to 9.
OBLIQUE_FIGURES = {2.5: "fig7", 5.0: "fig8", 7.5: "fig9"}

Value = TypeVar("Value", float, str)

_COLORS = ("#1b6ca8", "#3a9d5d", "#d98c1f", "#c0392b", "#7d3c98", "#566573")
_STYLES = ("-", "--", ":", "-.")
_MARKERS = {"front": "o", "back": "s", "side": "^", "top": "D"}
_PUBLISHED_COLOR = "#7f8c8d"


@dataclass(frozen=True)
class _Drop:
    zone: str
    speed: float
    source: str
    compression: FloatArray
    force: FloatArray

    @property
    def peak(self) -> tuple[float, float]:
        """Largest compression [m] and force [N]."""
        return float(self.compression.max()), float(self.force.max())


@dataclass(frozen=True)
class _History:
    direction: str
    normal: float
    tangential: float
    source: str
    time: FloatArray
    acceleration_g: FloatArray
    published: dict[str, float]


def paper_figures(impacts: Iterable[LoggedImpact]) -> dict[str, Figure]:
    """Every figure that the impacts give, by name (``fig3``, ``fig5``, ``fig7``, ...).

    Headform drops without tangential speed give Figs 3 to 5, impacts of a rider the others; a
    normal speed that the paper does not have gives ``acceleration_vn3.5``.
    """
    drops: list[_Drop] = []
    histories: list[_History] = []
    for impact in impacts:
        setup = impact.setup
        if setup.get("impact.rig") == "headform" and not setup.get("impact.tangential_velocity"):
            drops.append(_drop(impact))
        elif setup.get("impact.rig") == "rider":
            histories.append(_history(impact))
    figures = {}
    for name, zones in DROP_FIGURES.items():
        own = [drop for drop in drops if drop.zone in zones]
        if own:
            figures[name] = _loops_figure(own, zones)
    if drops:
        figures["fig5"] = _peaks_figure(drops)
    for speed in sorted({history.normal for history in histories}):
        name = OBLIQUE_FIGURES.get(speed, f"acceleration_vn{speed:g}")
        figures[name] = _histories_figure([h for h in histories if h.normal == speed])
    return figures


def source_name(impact: LoggedImpact) -> str:
    """The helmet of an impact, as a legend names it."""
    setup = impact.setup
    name = Path(str(setup.get("helmet.name", "helmet"))).stem
    return f"{name}, {setup.get('helmet.coupling', '')}".rstrip(", ")


def _drop(impact: LoggedImpact) -> _Drop:
    record, setup = impact.record, impact.setup
    force = record.ground_force[:, 2]
    peak = int(force.argmax())
    lifted = np.flatnonzero(force[peak:] <= 0.0)  # what follows is another touch
    end = peak + int(lifted[0]) + 1 if len(lifted) else len(record)
    direction = str(setup.get("impact.direction"))
    return _Drop(
        ZONES.get(direction, direction), float(setup["impact.normal_velocity"]),
        source_name(impact), approach(record)[:end], force[:end].copy(),
    )  # fmt: skip


def _history(impact: LoggedImpact) -> _History:
    record, setup = impact.record, impact.setup
    published = load_reference("table1").row(setup) or {}
    return _History(
        str(setup.get("impact.direction")), float(setup["impact.normal_velocity"]),
        float(setup["impact.tangential_velocity"]), source_name(impact), record.time.copy(),
        magnitude(record.head_acceleration) / STANDARD_GRAVITY, dict(published.get("peak_g", {})),
    )  # fmt: skip


def _panels(count: int, sharey: bool = True) -> tuple[Figure, list[Axes]]:
    columns = min(count, 2)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(5.0 * columns, 3.6 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False)
    axes = list(grid.flat)
    for ax in axes[count:]:
        ax.set_visible(False)
    for ax in axes:
        ax.grid(alpha=0.3)
    return figure, axes


def _loops_figure(drops: Sequence[_Drop], zones: Sequence[str]) -> Figure:
    """Force over compression at every speed; the peaks are marked."""
    figure, axes = _panels(len(zones))
    speeds, sources = _ordered(d.speed for d in drops), _ordered(d.source for d in drops)
    for ax, zone in zip(axes, zones, strict=False):
        for drop in drops:
            if drop.zone == zone:
                color = _COLORS[speeds.index(drop.speed) % len(_COLORS)]
                style = _STYLES[sources.index(drop.source) % len(_STYLES)]
                label = f"{drop.speed:g} m/s" + (f", {drop.source}" if len(sources) > 1 else "")
                x, y = drop.compression * 1e3, drop.force / 1e3
                ax.plot(x, y, style, color=color, lw=1.2, label=label)
                top = int(drop.force.argmax())
                ax.plot(x[top], y[top], "o", color=color, ms=4)
        ax.set_title(zone)
        ax.set_xlabel("compression [mm]")
        if ax.has_data():
            ax.legend(fontsize=7)
    axes[0].set_ylabel("contact force [kN]")
    return figure


def _peaks_figure(drops: Sequence[_Drop]) -> Figure:
    """Peak force over peak compression, the points of a direction joined."""
    figure, (ax,) = _panels(1)
    sources = _ordered(d.source for d in drops)
    for zone, color in zip(_MARKERS, _COLORS, strict=False):
        for source, style in zip(sources, _STYLES * len(sources), strict=False):
            peaks = sorted(d.peak for d in drops if d.zone == zone and d.source == source)
            if peaks:
                x, y = (np.array(column) for column in zip(*peaks, strict=True))
                label = zone + (f", {source}" if len(sources) > 1 else "")
                ax.plot(
                    x * 1e3, y / 1e3, style, marker=_MARKERS[zone], color=color, lw=1.0,
                    ms=5, label=label,
                )  # fmt: skip
    ax.set_xlabel("peak compression [mm]")
    ax.set_ylabel("peak contact force [kN]")
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize=7)
    return figure


def _histories_figure(histories: Sequence[_History]) -> Figure:
    """Resultant acceleration over time, one panel per tangential speed."""
    speeds = sorted({h.tangential for h in histories})
    figure, axes = _panels(len(speeds))
    directions = _ordered(h.direction for h in histories)
    sources = _ordered(h.source for h in histories)
    for ax, speed in zip(axes, speeds, strict=False):
        published: dict[str, float] = {}
        for h in histories:
            if h.tangential == speed:
                named = [h.direction] if len(directions) > 1 else []
                named += [h.source] if len(sources) > 1 or not named else []
                ax.plot(
                    h.time * 1e3, h.acceleration_g, _STYLES[sources.index(h.source) % 4],
                    color=_COLORS[directions.index(h.direction) % len(_COLORS)], lw=1.3,
                    label=", ".join(named),
                )  # fmt: skip
                published |= h.published
        for (model, value), style in zip(published.items(), _STYLES[1:], strict=False):
            ax.axhline(
                value, color=_PUBLISHED_COLOR, lw=0.9, ls=style, label=f"published peak, {model}"
            )
        ax.set_title(f"$v_n$ = {histories[0].normal:g} m/s, $v_t$ = {speed:g} m/s")
        ax.set_xlabel("time [ms]")
        ax.legend(fontsize=7)
    axes[0].set_ylabel("head acceleration [g]")
    axes[0].set_ylim(bottom=0.0)
    return figure


def _ordered(values: Iterable[Value]) -> list[Value]:
    return list(dict.fromkeys(values))
