"""The HTML of the results: head line, cards, criteria, differences. Every text is escaped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from helmet_sim_ros.biomech.catalogue import CATALOGUE, HEADLINE, entry
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.explore.colors import SIDE_COLORS, css
from helmet_sim_ros.explore.session import Session, Shown, Side
from helmet_sim_ros.present.words import number_text, spoken_unit, value_text
from helmet_sim_ros.report.review.summary import label

#: What the cards show.
CARDS = ("peak_g", "hic", "bric", "peak_angular_acceleration", "force_ratio", "peak_compression")
_SHORT = {
    "peak_g": "peak acceleration", "hic": "HIC", "bric": "BrIC", "force_ratio": "Ft / Fn",
    "peak_angular_acceleration": "peak angular acc.", "peak_compression": "compression",
}  # fmt: skip

STYLE = f"""<style>
.hs {{ font-size: 13px; line-height: 1.35; padding: 2px 10px 4px; }}
.hs-side {{ border-left: 4px solid; padding: 2px 0 2px 8px; margin: 6px 0; }}
.hs-side.A {{ border-color: {css(SIDE_COLORS["A"])}; }}
.hs-side.B {{ border-color: {css(SIDE_COLORS["B"])}; }}
.hs-line {{ display: flex; gap: 8px; align-items: baseline; flex-wrap: wrap; }}
.hs-dim {{ opacity: .62; font-size: 11.5px; }}
.hs code {{ font-size: 11.5px; opacity: .8; }}
.hs-badge {{ border-radius: 3px; padding: 0 6px; color: #fff; font-size: 11px; font-weight: 600; }}
.hs-badge.pass {{ background: #2b8a3e; }} .hs-badge.fail {{ background: #c92a2a; }}
.hs-cards {{ display: grid; grid-template-columns: repeat(3, 1fr); gap: 6px; margin: 6px 0 2px; }}
.hs-card {{ border: 1px solid rgba(128,128,128,.28); border-radius: 5px; padding: 4px 7px; }}
.hs-card.fail {{ border-color: #c92a2a; background: rgba(201,42,42,.08); }}
.hs-card b {{ font-size: 17px; font-weight: 600; white-space: nowrap; }}
.hs-cards.two b {{ font-size: 14px; }}
.hs-card small {{ font-size: 11px; opacity: .65; display: block; white-space: nowrap; }}
.hs table {{ border-collapse: collapse; width: 100%; font-size: 12px; }}
.hs td, .hs th {{ padding: 2px 4px; border-bottom: 1px solid rgba(128,128,128,.2);
  text-align: right; white-space: nowrap; }}
.hs td:first-child, .hs th:first-child {{ text-align: left; white-space: normal; }}
.hs tr.head th {{ padding-top: 9px; }}
.hs td.pass {{ color: #2b8a3e; }} .hs td.fail {{ color: #c92a2a; font-weight: 600; }}
.hs-problem {{ color: #c92a2a; border: 1px solid #c92a2a; border-radius: 5px; padding: 5px 8px;
  margin: 4px 0; background: rgba(201,42,42,.07); overflow-wrap: anywhere; }}
.hs-note {{ border-left: 3px solid #e8a33d; padding: 1px 7px; margin: 4px 0; font-size: 12px; }}
.hs .panel {{ width: 100%; height: auto; font-size: 11px; }}
.hs .panel text {{ fill: currentColor; }}
.hs .panel .grid, .hs .panel .ring {{ stroke: rgba(128,128,128,.35); fill: none; }}
.hs .panel .curve {{ stroke: {css(SIDE_COLORS["A"])}; fill: none; stroke-width: 1.6; }}
.hs .panel .law {{ stroke: {css(SIDE_COLORS["B"])}; fill: none; stroke-width: 1.6;
  stroke-dasharray: 5 4; }}
.hs .panel .crush {{ fill: #c92a2a; }}
.hs-two {{ display: grid; grid-template-columns: 1fr 1fr; gap: 8px; }}
.hs-two h4 {{ margin: 4px 0 0; font-size: 12px; font-weight: 600; }}
.hs pre {{ white-space: pre-wrap; overflow-wrap: anywhere; font-size: 11.5px; margin: 4px 0 10px;
  padding: 6px 8px; border: 1px solid rgba(128,128,128,.28); border-radius: 5px; }}
.hs button {{ float: right; font: inherit; font-size: 11.5px; padding: 1px 9px; cursor: pointer;
  border: 1px solid rgba(128,128,128,.45); border-radius: 4px; background: transparent;
  color: inherit; }}
</style>"""


def escaped(text: str) -> str:
    """A text that is no markup."""
    return escape(text)


def problem(text: str) -> str:
    """A problem in red; nothing for an empty text."""
    if not text:
        return ""
    return f'<div class="hs"><div class="hs-problem" data-problem>{escape(text)}</div></div>'


def headline(session: Session, impacts: Mapping[Side, Shown]) -> str:
    """Which impact is shown for each side, its verdict, and the cards."""
    parts = [STYLE, '<div class="hs">']
    for side, impact in impacts.items():
        parts.append(_side(side, impact, session.pending(side)))
    if not impacts:
        parts.append('<div class="hs-dim">computing the first impact…</div>')
    parts.append(_cards(impacts))
    for side, impact in impacts.items():
        for text in _notes(impact):
            parts.append(f'<div class="hs-note">{escape(f"{side}: " if len(impacts) > 1 else "")}'
                         f"{escape(text)}</div>")  # fmt: skip
    parts.append("</div>")
    return "".join(parts)


def criteria(impacts: Mapping[Side, Shown], differences: Sequence[tuple[str, Any, Any]]) -> str:
    """Every criterion of both sides with its limit, the difference, and how the setups differ."""
    evaluations = {side: i.evaluation for side, i in impacts.items() if i.evaluation is not None}
    parts = [STYLE, '<div class="hs">']
    if differences:
        rows = "".join(
            f"<tr><td><code>{escape(name)}</code></td><td>{escape(value_text(a))}</td>"
            f"<td>{escape(value_text(b))}</td></tr>"
            for name, a, b in differences
        )
        parts.append(f"<table><tr><th>B differs in</th><th>A</th><th>B</th></tr>{rows}</table><br>")
    names = dict.fromkeys(n for e in evaluations.values() for n in e.criteria)
    limited = [n for n in names if any(_limit(e, n) is not None for e in evaluations.values())]
    groups = (
        ("Limited by the standard", limited),
        ("Headline", [n for n in HEADLINE if n in names and n not in limited]),
        ("All others", [n for n in names if n not in limited and n not in HEADLINE]),
    )
    both = len(evaluations) > 1
    heads = "".join(f"<th>{side}</th>" for side in evaluations) + ("<th>B − A</th>" * both)
    parts.append("<table>")
    for title, group in groups:
        if group:
            parts.append(
                f'<tr class="head"><th>{title}</th>{heads}<th>limit</th><th>unit</th></tr>'
            )
            parts += [_row(name, evaluations) for name in group]
    parts.append("</table>")
    for evaluation in list(evaluations.values())[:1]:
        parts.append(f'<p class="hs-dim">{escape(evaluation.title)}</p>')
    parts.append("</div>")
    return "".join(parts)


def copies(texts: Mapping[str, str]) -> str:
    """Texts to take away, each with a button that copies it."""
    copy = "navigator.clipboard.writeText(this.parentElement.querySelector('pre').textContent)"
    done = "this.textContent = 'copied'"
    parts = [
        f'<div data-copy="{escape(title)}"><button onclick="{copy}; {done}">copy</button>'
        f"<b>{escape(title)}</b><pre>{escape(text)}</pre></div>"
        for title, text in texts.items()
    ]
    return STYLE + '<div class="hs">' + "".join(parts) + "</div>"


def _side(side: Side, impact: Shown, pending: bool) -> str:
    described = impact.record.setup if impact.record is not None else {}
    if not described and impact.setup is not None:
        described = impact.setup.described()
    badge = ""
    if impact.evaluation is not None:
        verdict = impact.evaluation.verdict
        badge = f'<span class="hs-badge {verdict}">{verdict}</span>'
    state = impact.origin or f"{impact.seconds * 1e3:.0f} ms"
    if pending:
        state = "computing the next…"
    error = problem(impact.error)
    return (
        f'<div class="hs-side {side}" data-side="{side}" data-digest="{impact.digest}" '
        f'data-pending="{str(pending).lower()}">'
        f'<div class="hs-line"><b>{side}</b><span>{escape(label(described))}</span>{badge}</div>'
        f'<div class="hs-dim">{escape(str(described.get("helmet.name", "")))}, impact '
        f"<code>{impact.digest}</code>, {escape(state)}</div>{error}</div>"
    )


def _cards(impacts: Mapping[Side, Shown]) -> str:
    evaluations = {side: i.evaluation for side, i in impacts.items() if i.evaluation is not None}
    cards = []
    for name in CARDS:
        found = {side: e.criteria[name] for side, e in evaluations.items() if name in e.criteria}
        if not found:
            continue
        first = next(iter(found.values()))
        failed = any(c.verdict == "fail" for c in found.values())
        values = "".join(
            f'<b style="color:{css(SIDE_COLORS[side])}" data-criterion="{name}" '
            f'data-side="{side}" data-value="{c.value!r}">{number_text(c.value, c.unit)}</b> '
            for side, c in found.items()
        )
        limit = "" if first.limit is None else f", limit {number_text(first.limit, first.unit)}"
        cards.append(
            f'<div class="hs-card{" fail" * failed}"><small>{_SHORT[name]}{limit}</small>'
            f'{values}<span class="hs-dim">{escape(spoken_unit(first.unit))}</span></div>'
        )
    two = " two" * (len(evaluations) > 1)
    return f'<div class="hs-cards{two}">{"".join(cards)}</div>'


def _notes(impact: Shown) -> list[str]:
    if impact.evaluation is not None:
        return list(impact.evaluation.warnings)
    return [] if impact.record is None else list(impact.record.notes)


def _row(name: str, evaluations: Mapping[Side, Evaluation]) -> str:
    cells, limit, unit = [], "", ""
    values: list[float] = []
    for evaluation in evaluations.values():
        criterion = evaluation.criteria.get(name)
        if criterion is None:
            cells.append("<td>–</td>")
            continue
        values.append(criterion.value)
        kind = criterion.verdict if criterion.limit is not None else ""
        cells.append(f'<td class="{kind}">{number_text(criterion.value, criterion.unit)}</td>')
        unit = spoken_unit(criterion.unit)
        if criterion.limit is not None:
            limit = number_text(criterion.limit, criterion.unit)
    if len(evaluations) > 1:
        cells.append(f"<td>{_difference(values)}</td>")
    title = escape(_meaning(name))
    return (
        f'<tr data-row="{escape(name)}"><td title="{escape(name)}">{title}</td>{"".join(cells)}'
        f"<td>{limit}</td><td>{escape(unit)}</td></tr>"
    )


def _difference(values: Sequence[float]) -> str:
    if len(values) < 2:
        return ""
    a, b = values
    scale = max(abs(a), abs(b))
    return f"{100.0 * (b - a) / abs(a):+.1f} %" if scale > 0.0 and a != 0.0 else "0"


def _limit(evaluation: Evaluation, name: str) -> float | None:
    return evaluation.criteria[name].limit if name in evaluation.criteria else None


def _meaning(name: str) -> str:
    if name in CATALOGUE:
        return CATALOGUE[name].meaning
    try:
        return entry(name).meaning
    except PulseError:  # of a later version
        return name
