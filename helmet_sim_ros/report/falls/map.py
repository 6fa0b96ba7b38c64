"""Where helmets were struck: the helmet unrolled, front in the middle, as inline SVG."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup, escape

from helmet_sim_ros.model.fall.strikes import Strike

_WIDTH, _HEIGHT, _MARGIN = 560.0, 300.0, 34.0
_LARGEST, _LARGEST_G = 16.0, 300.0  # radius of a dot, and the peak acceleration that it stands for


def strike_map(strikes: Sequence[tuple[str, Strike]]) -> Markup:
    """A dot per strike, its area as its peak acceleration; ``strikes``: name and strike."""
    parts = [
        f'<svg class="panel" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" '
        'aria-label="Where the helmet is struck: elevation over azimuth">'
    ]
    for azimuth, name in (
        (180, "back"),
        (90, "left"),
        (0, "front"),
        (-90, "right"),
        (-180, "back"),
    ):
        x, y = _place(azimuth, -90.0)
        parts.append(f'<line class="grid" x1="{x:g}" x2="{x:g}" y1="{_MARGIN:g}" y2="{y:g}"/>')
        parts.append(f'<text x="{x:g}" y="{y + 16:g}" text-anchor="middle">{name}</text>')
    for elevation, name in ((90, "crown"), (45, "45°"), (0, "0°"), (-45, "-45°"), (-90, "-90°")):
        x, y = _place(180.0, elevation)
        parts.append(f'<line class="grid" x1="{x:g}" x2="{_WIDTH - _MARGIN:g}" y1="{y:g}" '
                     f'y2="{y:g}"/>')  # fmt: skip
        parts.append(f'<text x="{x - 4:g}" y="{y + 4:g}" text-anchor="end">{name}</text>')
    for label, strike in strikes:
        x, y = _place(strike.location.azimuth_deg, strike.location.elevation_deg)
        peak = strike.evaluation.peak_g.value
        radius = max(2.0, _LARGEST * min(1.0, peak / _LARGEST_G) ** 0.5)
        told = f"{label}: {strike.struck}, {strike.normal_velocity:.1f} m/s, {peak:.0f} g"
        parts.append(
            f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill-opacity="0.6">'
            f"<title>{escape(told)}</title></circle>"
        )
    parts.append("</svg>")
    return Markup("".join(parts))


def _place(azimuth: float, elevation: float) -> tuple[float, float]:
    """Left of the rider on the left: as seen from behind, unrolled."""
    wide, high = _WIDTH - 2.0 * _MARGIN, _HEIGHT - 2.0 * _MARGIN
    return _MARGIN + wide * (180.0 - azimuth) / 360.0, _MARGIN + high * (90.0 - elevation) / 180.0
