"""Small plots of one quantity over another as inline SVG, coloured by the page's style sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from helmet_sim_ros.biomech.record import FloatArray

_WIDTH, _HEIGHT = 320.0, 250.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 58.0, 10.0, 10.0, 40.0
_LETTER = 7.0  # width of a letter, and gap between two texts
#: Narrowest range of an axis, in its unit; less is rounding.
_LEAST = 1e-3
#: Points drawn per curve; more cannot be told apart at this size.
MOST_POINTS = 240


@dataclass(frozen=True)
class Curve:
    """A curve of a panel.

    Attributes:
        x, y: shape (n,).
        style: CSS class: ``curve``, ``law`` (a law or limit) or ``mark`` (single points).
        label: in the legend; empty for none.
    """

    x: FloatArray
    y: FloatArray
    style: str = "curve"
    label: str = ""


def panel(title: str, x_label: str, y_label: str, curves: Sequence[Curve]) -> Markup:
    """An SVG of some curves with axes, ticks and a legend."""
    x_range = _range([c.x for c in curves])
    y_range = _range([c.y for c in curves])
    parts = [
        f'<svg class="panel" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" '
        f'aria-label="{escape(f"{title}: {y_label} over {x_label}")}">'
    ]
    parts += _axes(x_range, y_range, x_label, y_label)
    for curve in curves:
        parts.append(_drawn(curve, x_range, y_range))
    named = [curve for curve in curves if curve.label]
    for row, curve in enumerate(named):
        y = _TOP + 12.0 + 14.0 * row
        parts.append(
            f'<line class="{curve.style}" x1="{_LEFT + 8:g}" x2="{_LEFT + 26:g}" '
            f'y1="{y - 4:g}" y2="{y - 4:g}"/>'
            f'<text x="{_LEFT + 31:g}" y="{y:g}">{escape(curve.label)}</text>'
        )
    parts.append("</svg>")
    return Markup("".join(parts))


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Round numbers from ``low`` to ``high``, about ``count`` of them."""
    raw = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda f: abs(f * power - raw))
    first = math.ceil(low / step - 1e-9)
    return [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]


def _that_fit(limits: tuple[float, float], width: float) -> list[float]:
    """Ticks whose texts do not touch in a row of this width."""
    for count in (5, 3):
        found = ticks(*limits, count)
        if sum(_LETTER * (len(f"{value:g}") + 1) for value in found) <= width:
            break
    return found


def _range(values: Sequence[FloatArray]) -> tuple[float, float]:
    low = min(0.0, *(float(v.min()) for v in values))
    high = max(0.0, *(float(v.max()) for v in values))
    high = max(high, low + _LEAST)
    span = high - low
    return low - 0.04 * span * (low < 0.0), high + 0.06 * span


def _axes(
    x_range: tuple[float, float], y_range: tuple[float, float], x_label: str, y_label: str
) -> list[str]:
    bottom, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    parts = []
    for value in _that_fit(x_range, right - _LEFT):
        x = _x(value, x_range)
        parts.append(
            f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP:g}" y2="{bottom:g}"/>'
        )
        parts.append(f'<text x="{x:.1f}" y="{bottom + 14:g}" text-anchor="middle">{value:g}</text>')
    for value in ticks(*y_range):
        y = _y(value, y_range)
        parts.append(
            f'<line class="grid" x1="{_LEFT:g}" x2="{right:g}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        parts.append(f'<text x="{_LEFT - 5:g}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    middle_x, middle_y = 0.5 * (_LEFT + right), 0.5 * (_TOP + bottom)
    parts.append(
        f'<text x="{middle_x:g}" y="{_HEIGHT - 8:g}" text-anchor="middle">{escape(x_label)}</text>'
        f'<text transform="translate(13 {middle_y:g}) rotate(-90)" text-anchor="middle">'
        f"{escape(y_label)}</text>"
    )
    return parts


def _drawn(curve: Curve, x_range: tuple[float, float], y_range: tuple[float, float]) -> str:
    keep = np.unique(np.linspace(0, len(curve.x) - 1, MOST_POINTS).astype(int))
    points = [(_x(x, x_range), _y(y, y_range)) for x, y in zip(
        curve.x[keep].tolist(), curve.y[keep].tolist(), strict=True)]  # fmt: skip
    if curve.style == "mark":
        return "".join(f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="3"/>' for x, y in points)
    text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline class="{curve.style}" points="{text}"/>'


def _x(value: float, limits: tuple[float, float]) -> float:
    return _LEFT + (value - limits[0]) / (limits[1] - limits[0]) * (_WIDTH - _LEFT - _RIGHT)


def _y(value: float, limits: tuple[float, float]) -> float:
    share = (value - limits[0]) / (limits[1] - limits[0])
    return _HEIGHT - _BOTTOM - share * (_HEIGHT - _TOP - _BOTTOM)
