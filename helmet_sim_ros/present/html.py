"""Setups, records and evaluations as HTML for notebooks. Every text is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from helmet_sim_ros.biomech.catalogue import HEADLINE, entry
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.present.words import impact_label, quantity_text, unit_text, value_text

_COLORS = {"pass": "#2b8a3e", "fail": "#c92a2a", "info": "inherit"}
_WIDTH, _HEIGHT = 420.0, 110.0  # of the drawn pulse
_POINTS = 300


def setup_html(
    described: Mapping[str, Any], units: Mapping[str, str], changed: Iterable[str]
) -> str:
    """A setup: what differs from the defaults, and all values to unfold.

    Args:
        described: every value by its dotted name.
        units: by dotted name.
        changed: names of the values that differ from the defaults.
    """
    rows = [
        (name, value_text(value), unit_text(units.get(name, "")))
        for name, value in described.items()
    ]
    kept = set(changed)
    own = [row for row in rows if row[0] in kept]
    head = ("value", "", "unit")
    parts = [f"<b>Impact setup</b>: {escape(impact_label(described))}"]
    if own:
        parts.append(table(head, own))
    return "".join([*parts, _folded(f"all {len(rows)} values", table(head, rows))])


def record_html(record: ImpactRecord) -> str:
    """A record: which impact, how many samples, and the pulse of the head."""
    g = magnitude(record.head_acceleration) / STANDARD_GRAVITY
    step, duration = record.time_step * 1e3, float(record.time[-1] - record.time[0]) * 1e3
    return (
        f"<b>Impact record</b>: {escape(impact_label(record.setup))}<br>"
        f"{len(record)} samples in {duration:g} ms, every {step:g} ms; "
        f"peak of the head {float(g.max()):.1f} g<br>{_pulse(record.time * 1e3, g)}"
    )


def evaluation_html(evaluation: Evaluation) -> str:
    """An evaluation: verdict, what the standard limits, the headline, all others to unfold."""
    criteria = list(evaluation.criteria.values())
    limited = [c for c in criteria if c.limit is not None]
    headline = [c for c in criteria if c.name in HEADLINE and c not in limited]
    others = [c for c in criteria if c not in limited and c not in headline]
    head = ("criterion", "value", "limit", "meaning")
    verdict = evaluation.verdict
    parts = [
        f'<b>Evaluation</b>: <b style="color:{_COLORS[verdict]}">{verdict}</b>, '
        f"{escape(evaluation.title)}",
        table(head, map(_criterion_row, [*limited, *headline])),
        *(f"<div>{escape(text)}</div>" for text in evaluation.warnings),
    ]
    if others:
        parts.append(_folded(f"{len(others)} others", table(head, map(_criterion_row, others))))
    return "".join(parts)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; the first column is left, a text that begins with ``<`` is markup of ours."""
    lines = ["<tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>"]
    for row in rows:
        cells = (text if text.startswith("<b ") else escape(text) for text in row)
        lines.append(
            "<tr>" + "".join(f'<td style="text-align:left">{cell}</td>' for cell in cells) + "</tr>"
        )
    return f"<table>{''.join(lines)}</table>"


def _criterion_row(criterion: Criterion) -> tuple[str, str, str, str]:
    value = escape(quantity_text(criterion.value, criterion.unit))
    limit = "" if criterion.limit is None else quantity_text(criterion.limit, criterion.unit)
    if criterion.limit is not None:
        value = f'<b style="color:{_COLORS[criterion.verdict]}">{value}</b>'
    try:
        meaning = entry(criterion.name).meaning
    except PulseError:  # of a later version
        meaning = ""
    return criterion.name, value, limit, meaning


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def _pulse(time: FloatArray, g: FloatArray) -> str:
    """The pulse as a small picture; its highest point is in it."""
    even = np.linspace(0, len(g) - 1, min(_POINTS, len(g))).astype(int)
    keep = np.unique(np.append(even, int(np.argmax(g))))
    top = max(float(g.max()), 1e-9)
    x = (time[keep] - time[0]) / (time[-1] - time[0]) * (_WIDTH - 2.0) + 1.0
    y = _HEIGHT - 1.0 - g[keep] / top * (_HEIGHT - 4.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" width="{_WIDTH:g}" height="{_HEIGHT:g}" '
        f'role="img" aria-label="acceleration of the head over time, at most {top:.1f} g">'
        f'<polyline points="{points}" fill="none" stroke="#1f62b8" stroke-width="1.5"/></svg>'
    )
