"""The section of docs/validation.md that holds the model against published experiments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from helmet_sim_ros.report.validation.table import table
from helmet_sim_ros.study.validation.experiments import Experiment, Value
from helmet_sim_ros.study.validation.findings import Finding

HEADING = "## Against experiments"

INTRODUCTION = """Published experiments from `config/references/experiments_*.yaml`, run by
`helmet-sim validate` (alone: `helmet-sim validate --experiments`). *Calibration*: a constant of the
model was chosen with the figure in view; *prediction*: none was. Which is which is named in the
files, once. *Read*: the figure stands in a text that was read; *secondary*: quoted by one.
*Accepted* is the bound that was set beforehand; a difference is from the published value, or from
the nearer end of a published range. Values that are not accepted stay here as they are.
"""

#: Columns of the table of findings.
HEADER = ("id", "criterion", "published", "ours", "difference", "accepted", "verdict")
#: What a table calls the kinds of published values.
KINDS = {"exact": "", "mean": "mean ", "at_most": "at most ", "range": "", "factor": "factor "}


def experiments_section(found: Sequence[Finding]) -> str:
    """The whole section, with its heading."""
    parts = [f"{HEADING}\n", INTRODUCTION, table(("set", "values", "accepted",
             "median difference", "cannot be run"), _counts(found))]  # fmt: skip
    for name in ("calibration", "prediction"):
        own = [finding for finding in found if finding.experiment.set == name]
        if own:
            parts += [f"### {name.capitalize()}\n", table(HEADER, map(table_row, own))]
            described = {f.experiment.id: _described(f.experiment) for f in own}
            parts.append("\n".join(described.values()) + "\n")
    return "\n".join(parts)


def replace_section(path: Path, section: str) -> None:
    """Put a section into a Markdown document in place of the one with the same heading, or at its
    end; the document may be missing. The heading, of the second level, is the section's first
    line."""
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    heading = section.partition("\n")[0] + "\n"
    before, found, rest = text.partition(heading)
    after = ""
    if found:
        _, mark, after = rest.partition("\n## ")
        after = f"\n## {after}" if mark else ""
    if before and not before.endswith("\n\n"):
        before += "\n" if before.endswith("\n") else "\n\n"
    path.write_text(before + section + after, encoding="utf-8")


def table_row(finding: Finding) -> tuple[str, ...]:
    """Cells of one finding: id, criterion, published, ours, difference, accepted, verdict."""
    value, difference = finding.value, finding.difference
    name = value.criterion.replace("_", " ")
    if value.kind == "factor":
        name += ", factor"
    elif value.kind == "table":
        name += f", mean error against {value.table.rpartition('/')[2]}"
    elif value.unit != "-":
        name += f" [{value.unit}]"
    percent = value.kind == "table"
    ours = " / ".join(_number(x, percent) for x in finding.compared)
    verdict = "cannot be run" if finding.problem else "yes" if finding.accepted else "**no**"
    return (
        finding.experiment.id,
        name,
        _published(value),
        ours or finding.problem,
        "-" if difference is None or percent else f"{100 * difference:+.0f} %",
        _accepted(value),
        verdict,
    )


def _counts(found: Iterable[Finding]) -> Iterable[tuple[object, ...]]:
    for name in ("calibration", "prediction"):
        own = [f for f in found if f.experiment.set == name]
        sizes = sorted(abs(d) for f in own if (d := f.difference) is not None)
        middle = len(sizes) // 2
        median = 0.5 * (sizes[middle] + sizes[~middle]) if sizes else math.nan
        yield (
            name, len(own), sum(f.accepted for f in own),
            f"{100 * median:.0f} %" if sizes else "-", sum(bool(f.problem) for f in own),
        )  # fmt: skip


def _published(value: Value) -> str:
    if value.words:
        return value.words
    if value.kind == "table":
        return "-"
    if value.value is not None:
        return KINDS[value.kind] + _number(value.value)
    assert value.low is not None and value.high is not None
    return f"{_number(value.low)} to {_number(value.high)}"


def _accepted(value: Value) -> str:
    low, high = value.bounds
    percent = value.kind == "table"
    if percent or math.isinf(low):
        return f"up to {_number(high, percent)}"
    if math.isinf(high):
        return f"from {_number(low)}"
    return f"{_number(low)} to {_number(high)}"


def _number(value: float, percent: bool = False) -> str:
    return (
        f"{100 * value:.1f} %"
        if percent
        else f"{value:.3g}"
        if abs(value) < 1000
        else f"{value:.0f}"
    )


def _described(experiment: Experiment) -> str:
    text = f"- **{experiment.id}**: {experiment.title}. {experiment.source} ({experiment.reading})."
    if experiment.in_view:
        text += f" Chosen with it in view: {'; '.join(experiment.in_view)}."
    return f"{text} {experiment.notes}".rstrip()
