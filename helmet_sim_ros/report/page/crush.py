"""The map of residual crush of a foam liner, as inline SVG."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.report.page.quantity import quantity

_WIDTH, _HEIGHT, _MARGIN = 320.0, 250.0, 8.0
_RADIUS = 0.5 * _HEIGHT - _MARGIN
_MIDDLE = (_RADIUS + _MARGIN, 0.5 * _HEIGHT)
_RINGS = (45, 90, 135)  # deg from the crown
_REACH = 150.0  # deg from the crown at the edge of the map
#: Scale from no to most crush.
COLORS = ((255, 245, 220), (254, 196, 79), (227, 74, 51), (127, 0, 0))
#: The eye port of a drawn helmet: half widths and middle, azimuth and elevation [deg].
_PORT, _PORT_MIDDLE = (72.0, 21.0), 4.0


def crush_panel(record: ImpactRecord) -> dict[str, object] | None:
    """The map with its title; None for a helmet without foam.

    Azimuthal equidistant: the crown in the middle, the front up, the left side left; the distance
    from the middle is the angle from the crown.
    """
    residual, position = record.extras.get("residual_crush"), record.extras.get("column_position")
    if not isinstance(residual, np.ndarray) or not isinstance(position, np.ndarray):
        return None
    return crush_map(residual, position, port=record.setup.get("helmet.geometry") is None)


def crush_map(
    residual: FloatArray, position: FloatArray, port: bool = True
) -> dict[str, object] | None:
    """:func:`crush_panel` of residual crush (n,) and position of the columns (n, 3) [m].

    Args:
        port: draw where an eye port would be; without, as small dots, where there is a liner.
    """
    if residual.ndim != 1 or position.shape != (len(residual), 3) or not len(residual):
        return None
    worst = float(residual.max())
    title = f"Residual crush of the liner, at most {quantity(worst, 'm', 3)}"
    parts = [
        f'<svg class="panel" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="{title}">',
        f'<circle class="inside" cx="{_MIDDLE[0]:g}" cy="{_MIDDLE[1]:g}" r="{_RADIUS:g}"/>',
    ]
    angle = np.degrees(np.arccos(position[:, 2] / np.linalg.norm(position, axis=1)))
    x, y = _placed(np.arctan2(position[:, 1], position[:, 0]), angle)
    # Columns cover the sphere evenly: each dot is as wide as its share of the map.
    spacing = np.degrees(np.sqrt(4.0 * np.pi / len(residual))) * _RADIUS / _REACH
    if not port:
        covered = "".join(
            f"M{a:.0f},{b:.0f}h1"
            for a, b in zip(x[angle <= _REACH], y[angle <= _REACH], strict=True)
        )
        parts.append(f'<path class="ring" d="{covered}"/>')
    if worst > 0.0:
        for i in np.flatnonzero((residual > 0.01 * worst) & (angle <= _REACH)).tolist():
            parts.append(
                f'<circle cx="{x[i]:.0f}" cy="{y[i]:.0f}" r="{0.75 * spacing:.1f}" '
                f'fill="{color(residual[i] / worst)}"/>'
            )
    parts += _outline(port) + _bar(worst) + ["</svg>"]
    return {"title": title, "svg": Markup("".join(parts))}


def color(share: float) -> str:
    """The colour of a share of the most crush, ``#e34a33``."""
    at = np.linspace(0.0, 1.0, len(COLORS))
    rgb = [np.interp(share, at, [c[i] for c in COLORS]) for i in range(3)]
    return "#" + "".join(f"{round(float(v)):02x}" for v in rgb)


def _placed(heading: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places on the map of headings [rad], 0 the front, and angles from the crown [deg]."""
    scale = _RADIUS / _REACH
    return (_MIDDLE[0] - scale * angle * np.sin(heading),
            _MIDDLE[1] - scale * angle * np.cos(heading))  # fmt: skip


def _outline(port: bool) -> list[str]:
    """Rings of equal angle, the eye port, and where front and sides are."""
    parts = []
    for ring in _RINGS:
        r = ring * _RADIUS / _REACH
        parts.append(f'<circle class="ring" cx="{_MIDDLE[0]:g}" cy="{_MIDDLE[1]:g}" r="{r:.1f}"/>')
        slant = r * math.sqrt(0.5)  # between back and right, where no other text is
        parts.append(f'<text class="soft" text-anchor="middle" x="{_MIDDLE[0] + slant:.1f}" '
                     f'y="{_MIDDLE[1] + slant:.1f}">{ring}°</text>')  # fmt: skip
    if port:
        turn = np.linspace(0.0, 2.0 * np.pi, 73)
        across, up = np.cos(turn), np.sin(turn)
        squared = (across**4 + up**4) ** -0.25
        heading = np.radians(_PORT[0] * squared * across)
        x, y = _placed(heading, 90.0 - _PORT_MIDDLE - _PORT[1] * squared * up)
        points = " ".join(f"{a:.0f},{b:.0f}" for a, b in zip(x, y, strict=True))
        parts.append(f'<polygon class="port" points="{points}"/>')
    half = 0.88 * _RADIUS
    for text, dx, dy in (("front", 0.0, -half), ("back", 0.0, half + 4),
                         ("left", -half, 4.0), ("right", half, 4.0)):  # fmt: skip
        parts.append(f'<text text-anchor="middle" x="{_MIDDLE[0] + dx:.0f}" '
                     f'y="{_MIDDLE[1] + dy:.0f}">{text}</text>')  # fmt: skip
    return parts


def _bar(worst: float) -> list[str]:
    """The scale of colours."""
    left, top, height, steps = _WIDTH - 62.0, 40.0, _HEIGHT - 80.0, 24
    parts = []
    for i in range(steps):
        parts.append(
            f'<rect x="{left:g}" y="{top + height * (1.0 - (i + 1) / steps):.1f}" width="12" '
            f'height="{height / steps + 0.5:.1f}" fill="{color((i + 0.5) / steps)}"/>'
        )
    for share in (0.0, 0.5, 1.0):
        parts.append(f'<text x="{left + 16:g}" y="{top + height * (1.0 - share) + 4:.1f}">'
                     f"{quantity(share * worst, 'm', 2) if share else '0'}</text>")  # fmt: skip
    return parts
