"""The map of residual crush of a foam liner, as inline SVG."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord

_SIZE = 250.0
_RINGS = (45, 90, 135)  # deg from the crown
_REACH = 150.0  # deg from the crown at the edge of the map


def crush_panel(record: ImpactRecord) -> dict[str, object] | None:
    """The map with its title; None for a helmet without foam.

    Azimuthal equidistant: the crown in the middle, the front up, the left side left; the distance
    from the middle is the angle from the crown.
    """
    residual, position = record.extras.get("residual_crush"), record.extras.get("column_position")
    if not isinstance(residual, np.ndarray) or not isinstance(position, np.ndarray):
        return None
    return crush_map(residual, position)


def crush_map(residual: FloatArray, position: FloatArray) -> dict[str, object] | None:
    """:func:`crush_panel` of residual crush (n,) and position of the columns (n, 3) [m]."""
    if residual.ndim != 1 or position.shape != (len(residual), 3):
        return None
    worst = float(residual.max())
    middle = 0.5 * _SIZE
    scale = (middle - 6.0) / _REACH
    parts = [
        f'<svg class="panel" viewBox="0 0 {_SIZE:g} {_SIZE:g}" role="img" '
        f'aria-label="Residual crush of the liner, at most {worst * 1e3:.2f} mm">'
    ]
    for ring in _RINGS:
        r = ring * scale
        parts.append(f'<circle class="ring" cx="{middle:g}" cy="{middle:g}" r="{r:.1f}"/>')
        parts.append(f'<text x="{middle + 3:g}" y="{middle - r + 11:.1f}">{ring}°</text>')
    for text, x, y in (("front", middle - 30, 12.0), ("left", 4.0, middle - 4)):
        parts.append(f'<text x="{x:g}" y="{y:g}">{text}</text>')
    angle = np.degrees(np.arccos(position[:, 2] / np.linalg.norm(position, axis=1)))
    heading = np.arctan2(position[:, 1], position[:, 0])  # 0 is the front, 90 deg the left side
    for i in np.flatnonzero(residual > 0.01 * worst).tolist():
        x = middle - scale * angle[i] * np.sin(heading[i])
        y = middle - scale * angle[i] * np.cos(heading[i])
        parts.append(
            f'<circle class="crush" cx="{x:.1f}" cy="{y:.1f}" r="4" '
            f'fill-opacity="{residual[i] / worst:.2f}"/>'
        )
    parts.append("</svg>")
    title = f"Residual crush of the liner, at most {worst * 1e3:.1f} mm"
    return {"title": title, "svg": Markup("".join(parts))}
