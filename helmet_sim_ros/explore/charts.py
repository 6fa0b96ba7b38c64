"""The charts of the page."""

from __future__ import annotations

from collections.abc import Mapping

import viser
from viser import uplot

from helmet_sim_ros.biomech.helmet import compression
from helmet_sim_ros.biomech.pulse import FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.explore.colors import SIDE_COLORS, SIDE_TINTS, css
from helmet_sim_ros.explore.curves import CHARTS, Chart, chart_data, limit_line, limit_of
from helmet_sim_ros.explore.markup import STYLE
from helmet_sim_ros.explore.session import Shown, Side
from helmet_sim_ros.report.page.crush import crush_panel
from helmet_sim_ros.report.page.svg import Curve, panel

_HEIGHT = 170  # px
_LIMIT_COLOR = "#c92a2a"


class Charts:
    """Histories over time, the loop of the coupling, and the map of crush.

    Attributes:
        handles: viser's, one for each of ``CHARTS``.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._gui = server.gui
        self._drawn: tuple[tuple[Side, ...], list[float | None]] = ((), [])
        self._folder = self._gui.add_folder("Histories over time [ms]")
        self.handles: list[viser.GuiUplotHandle] = []
        self._maps = self._gui.add_html("")

    def show(self, impacts: Mapping[Side, Shown]) -> None:
        """Draw one impact, or two over each other."""
        sides = tuple(impacts)
        records = {side: impact.record for side, impact in impacts.items()}
        evaluations = [impact.evaluation for impact in impacts.values()]
        every: list[tuple[FloatArray, ...]] = []
        limits = [limit_of(chart, evaluations) for chart in CHARTS]
        for chart, limit in zip(CHARTS, limits, strict=True):
            data = chart_data(chart, list(records.values()))
            every.append((*data, *([] if limit is None else [limit_line(limit, data)])))
        if (sides, limits) != self._drawn:
            self._rebuild(sides, limits, every)
        else:
            for handle, arrays in zip(self.handles, every, strict=True):
                handle.data = arrays
        self._maps.content = _maps(records)

    def _rebuild(
        self,
        sides: tuple[Side, ...],
        limits: list[float | None],
        every: list[tuple[FloatArray, ...]],
    ) -> None:
        for handle in self.handles:
            handle.remove()
        self._drawn = sides, limits
        with self._folder:
            self.handles = [
                self._gui.add_uplot(
                    data, _series(chart, sides, limit), title=chart.title, height=_HEIGHT,
                    scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
                    axes=(uplot.Axis(size=36), uplot.Axis(size=44)), padding=(6, 10, 0, 0),
                ) for chart, limit, data in zip(CHARTS, limits, every, strict=True)
            ]  # fmt: skip


def _series(chart: Chart, sides: tuple[Side, ...], limit: float | None) -> tuple[uplot.Series, ...]:
    series = [uplot.Series(label="t [ms]")]
    for side in sides:
        for number, label in enumerate(chart.labels):
            color = (SIDE_TINTS if number else SIDE_COLORS)[side]
            words: list[str] = [side] * (len(sides) > 1)
            words += [label] * (len(sides) == 1 or len(chart.labels) > 1)
            dash = (6.0, 4.0) if side == "B" else ()
            series.append(_curve(" ".join(words), css(color), 2.0, dash))
    if limit is not None:
        series.append(_curve(f"limit {limit:g}", _LIMIT_COLOR, 1.0, ()))
    return tuple(series)


def _curve(label: str, color: str, width: float, dash: tuple[float, ...]) -> uplot.Series:
    return uplot.Series(
        label=label, stroke=color, width=width, dash=dash, points={"show": False}
    )  # fmt: skip


def _maps(records: Mapping[Side, ImpactRecord | None]) -> str:
    curves = []
    for side, record in records.items():
        if record is not None:
            style = "curve" if side == "A" else "law"
            depth = compression(record.coupling_displacement) * 1e3
            force = magnitude(record.coupling_force) / 1e3
            curves.append(Curve(depth, force, style, side if len(records) > 1 else ""))
    parts = [STYLE, '<div class="hs hs-two">']
    if curves:
        svg = panel("Loop of the coupling", "compression [mm]", "force [kN]", curves)
        parts.append(f"<div><h4>Force-compression loop</h4>{svg}</div>")
    for side, record in records.items():
        found = None if record is None else crush_panel(record)
        if found is not None:
            title = f"{side}: {found['title']}" if len(records) > 1 else found["title"]
            parts.append(f"<div><h4>{title}</h4>{found['svg']}</div>")
    return "".join([*parts, "</div>"])
