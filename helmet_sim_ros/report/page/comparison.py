"""Impacts of several logs over each other: the same blow, another helmet or rider."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helmet_sim_ros.biomech.catalogue import HEADLINE, entry
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.report.page.blocks import packed
from helmet_sim_ros.report.page.histories import MOST_SAMPLES
from helmet_sim_ros.report.page.quantity import quantity
from helmet_sim_ros.report.review.check import Reviewed
from helmet_sim_ros.report.review.compare import pairing_key
from helmet_sim_ros.report.review.summary import label

#: Change of a criterion that is shown as none: less than its last digit.
_NO_CHANGE = 5e-4


@dataclass(frozen=True)
class Member:
    """An impact of a comparison: its log among all logs, and its number on the page."""

    log: int
    number: int
    row: Reviewed


def comparisons(
    logs: Sequence[ImpactLog], rows: Sequence[tuple[ImpactLog, Reviewed]]
) -> list[dict[str, object]]:
    """Values of the template for every blow that at least two logs have.

    Several impacts of one kind pair in their order.
    """
    names = log_names([log.path for log in logs])
    place = {id(log): index for index, log in enumerate(logs)}
    groups: dict[tuple[object, ...], list[Member]] = {}
    seen: dict[tuple[object, ...], int] = {}
    for number, (log, row) in enumerate(rows, 1):
        key = (place[id(log)], *pairing_key(row.impact))
        seen[key] = turn = seen.get(key, -1) + 1
        groups.setdefault((turn, *key[1:]), []).append(Member(place[id(log)], number, row))
    return [
        _comparison(number, members, names)
        for number, members in enumerate((m for m in groups.values() if len(m) > 1), 1)
    ]


def log_names(paths: Sequence[Path]) -> list[str]:
    """Short names of files that tell them apart."""
    short = [path.stem for path in paths]
    if len(set(short)) < len(short):
        short = [f"{path.resolve().parent.name}/{path.stem}" for path in paths]
    return [n if short.count(n) == 1 else f"{n} ({i})" for i, n in enumerate(short, 1)]


def _comparison(number: int, members: Sequence[Member], names: Sequence[str]) -> dict[str, object]:
    evaluations = [member.row.evaluation for member in members]
    rows = []
    for name in HEADLINE:
        found = [evaluation.criteria.get(name) for evaluation in evaluations]
        if all(criterion is None for criterion in found):
            continue
        first = found[0]
        rows.append(
            {
                "meaning": entry(name).meaning,
                "cells": [
                    {
                        "value": "" if c is None else quantity(c.value, c.unit),
                        "verdict": "" if c is None else c.verdict,
                        "change": ""
                        if c is None or first is None or i == 0
                        else _change(first.value, c.value),
                    }
                    for i, c in enumerate(found)
                ],
            }
        )
    records = [member.row.impact.record for member in members]
    return {
        "number": number,
        "label": label(members[0].row.impact.setup),
        "members": [{"name": names[m.log], "number": m.number} for m in members],
        "rows": rows,
        "data": _overlaid(records, [names[m.log] for m in members]),
    }


def _change(first: float, value: float) -> str:
    if first == 0.0:
        return "" if value == 0.0 else "new"
    share = value / first - 1.0
    return "=" if abs(share) < _NO_CHANGE else f"{100.0 * share:+.1f} %".replace("-", "−")


def _overlaid(records: Sequence[ImpactRecord], names: Sequence[str]) -> str:
    """Histories on common times; of a shorter record as many as it has."""
    start = min(float(record.time[0]) for record in records)
    end = max(float(record.time[-1]) for record in records)
    step = min(record.time_step for record in records)
    step *= max(1, math.ceil((end - start) / step / (MOST_SAMPLES - 1)))
    times = start + step * np.arange(round((end - start) / step) + 1)
    arrays: dict[str, FloatArray] = {}
    for i, record in enumerate(records):
        inside = times[times <= record.time[-1] + 0.5 * step]
        normal = magnitude(record.ground_force - record.ground_friction)
        for name, values in (
            ("a", magnitude(record.head_acceleration) / STANDARD_GRAVITY),
            ("f", normal / 1e3),
            ("s", magnitude(record.head_angular_acceleration) / 1e3),
        ):
            arrays[f"{name}{i}"] = np.interp(inside, record.time, values)
    plain = {"names": list(names), "count": len(times), "start": start * 1e3, "step": step * 1e3}
    return packed(plain, arrays)
