"""Results of a scenario as a table for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import JustifyMethod
from rich.table import Table
from rich.text import Text

#: Criteria of the short table: name, header, format, factor from the criterion's unit.
SHORT = (
    ("peak_g", "peak g", ".0f", 1.0),
    ("hic", "HIC", ".0f", 1.0),
    ("clip_3ms", "3 ms [g]", ".0f", 1.0),
    ("force_ratio", "Ft/Fn", ".2f", 1.0),
    ("peak_compression", "crush [mm]", ".1f", 1e3),
)
VERDICT_STYLE = {"pass": "green", "fail": "bold red"}

Row = Mapping[str, Any]


def result_table(rows: Sequence[Row], title: str) -> Table:
    """One line per case; published values stand beside ours where the scenario has a reference.

    Args:
        rows: the ``cases`` of the scenario node's result.
        title: stands above the table.
    """
    models = _published_models(rows)
    table = Table(
        title=title, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False, padding=(0, 1, 0, 0)
    )
    table.add_column("case", no_wrap=True)
    shown = [entry for entry in SHORT if not models or entry[0] in models or entry[0] == "hic"]
    for name, header, _, _ in shown:
        style = "bold" if name in models else ""
        table.add_column(Text(header), justify="right", style=style, no_wrap=True)
        for model in models.get(name, ()):
            table.add_column(model, justify="right", style="dim", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for row in rows:
        cells: list[str | Text] = [str(row["name"])]
        for name, _, style, factor in shown:
            cells.append(_value(row, name, style, factor))
            published = (row.get("reference") or {}).get(name, {})
            for model in models.get(name, ()):
                cells.append(format(published[model] * factor, style) if model in published else "")
        table.add_row(*cells, _verdict(row))
    return table


def criteria_table(row: Row) -> Table:
    """Every criterion of one case with unit, window and limit."""
    table = Table(title=str(row["name"]), box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
    for header in ("criterion", "value", "unit", "window or time [ms]", "limit", "verdict"):
        align: JustifyMethod = "right" if header in ("value", "limit") else "left"
        table.add_column(Text(header), justify=align)
    for name, entry in _criteria(row).items():
        window, at = entry.get("window"), entry.get("time")
        when = f"{window[0] * 1e3:.2f} to {window[1] * 1e3:.2f}" if window else ""
        when = when or (f"{at * 1e3:.2f}" if at is not None else "")
        limit = entry.get("limit")
        table.add_row(
            name, f"{entry['value']:.5g}", entry["unit"], when,
            "" if limit is None else f"{limit:g}", _styled(entry["verdict"]),
        )  # fmt: skip
    return table


def _published_models(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Criterion -> models with published values, over all rows, in their order."""
    models: dict[str, dict[str, None]] = {}
    for row in rows:
        for criterion, values in (row.get("reference") or {}).items():
            models.setdefault(criterion, {}).update(dict.fromkeys(values))
    return {criterion: list(names) for criterion, names in models.items()}


def _criteria(row: Row) -> Mapping[str, Any]:
    criteria: Mapping[str, Any] = (row.get("evaluation") or {}).get("criteria", {})
    return criteria


def _value(row: Row, name: str, style: str, factor: float) -> str:
    entry = _criteria(row).get(name)
    return "" if entry is None else format(entry["value"] * factor, style)


def _verdict(row: Row) -> Text:
    if row["status"] != "evaluated":
        return Text(str(row["status"]).upper(), style="bold red")
    return _styled(row["evaluation"]["verdict"])


def _styled(verdict: str) -> Text:
    return Text(verdict, style=VERDICT_STYLE.get(verdict, ""))
