"""Impacts and results as tables for other programs: CSV with a row of units, and Parquet."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from helmet_sim_ros.biomech.catalogue import entry
from helmet_sim_ros.biomech.record import to_block
from helmet_sim_ros.mcap_log import LoggedImpact

#: Every finite double reads back bit for bit from so many digits.
EXACT = "%.17g"


def write_samples_csv(impact: LoggedImpact, path: Path) -> None:
    """All samples: a row of names, a row of units, then one row per sample."""
    record = impact.record
    labels, units = record.labels, record.units
    with open(path, "w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([labels, units])
        np.savetxt(stream, to_block(record), fmt=EXACT, delimiter=",", newline="\r\n")


def write_samples_parquet(impact: LoggedImpact, path: Path) -> None:
    """All samples, one column per component.

    The unit of a column is in its field metadata (``unit``); the file's metadata holds
    ``impact_id``, ``setup`` and ``evaluation`` as JSON.
    """
    import pyarrow
    from pyarrow import parquet

    record = impact.record
    columns = zip(record.labels, record.units, strict=True)
    fields = [pyarrow.field(name, pyarrow.float64(), metadata={"unit": u}) for name, u in columns]
    about = {
        "impact_id": impact.impact_id,
        "start_time": repr(impact.start_time),
        "setup": json.dumps(dict(impact.setup)),
        "evaluation": impact.evaluation.to_json(),
    }
    schema = pyarrow.schema(fields, metadata=about)
    arrays = [np.ascontiguousarray(column) for column in to_block(record).T]
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=schema), path)


def write_results_csv(impacts: Sequence[LoggedImpact], path: Path) -> None:
    """One row per impact: setup and criteria, below a row of names and a row of units."""
    names, units, rows = _results(impacts)
    with open(path, "w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerows([names, units])
        writer.writerows([[_cell(row.get(name)) for name in names] for row in rows])


def write_results_parquet(impacts: Sequence[LoggedImpact], path: Path) -> None:
    """One row per impact; the unit of a column is in its field metadata."""
    import pyarrow
    from pyarrow import parquet

    names, units, rows = _results(impacts)
    arrays, fields = [], []
    for name, unit in zip(names, units, strict=True):
        values = [row.get(name) for row in rows]
        kinds = {type(value) for value in values if value is not None}
        if kinds == {int, float}:
            values = [float(v) if isinstance(v, int | float) else None for v in values]
        elif len(kinds) > 1 or kinds == {list}:
            values = [None if value is None else _cell(value) for value in values]
        arrays.append(pyarrow.array(values))
        fields.append(pyarrow.field(name, arrays[-1].type, metadata={"unit": unit}))
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), path)


def _results(
    impacts: Sequence[LoggedImpact],
) -> tuple[list[str], list[str], list[dict[str, object]]]:
    rows = []
    names: dict[str, str] = {}
    for impact in impacts:
        evaluation = impact.evaluation
        row: dict[str, object] = {"impact_id": impact.impact_id, "start_time": impact.start_time}
        names |= {"impact_id": "", "start_time": "s"}
        row |= impact.setup
        names |= {name: names.get(name, setup_unit(name)) for name in impact.setup}
        row |= {name: criterion.value for name, criterion in evaluation.criteria.items()}
        names |= {name: criterion.unit for name, criterion in evaluation.criteria.items()}
        rows.append(row | {"standard": evaluation.standard, "verdict": evaluation.verdict})
    names |= {"standard": "", "verdict": ""}
    return list(names), list(names.values()), rows


def setup_unit(name: str) -> str:
    """The unit of a setup value by its dotted name, empty where it has none or is unknown."""
    return _setup_units().get(name, "")


@lru_cache(maxsize=1)
def _setup_units() -> dict[str, str]:
    from helmet_sim_ros.model.fall.setup import fall_leaves
    from helmet_sim_ros.model.helmet import Helmet
    from helmet_sim_ros.model.setup import setup_leaves
    from helmet_sim_ros.schema import leaves

    return {
        leaf.name: leaf.unit
        for leaf in [*setup_leaves(), *fall_leaves(), *leaves(Helmet, "helmet.")]
    }


def criterion_label(name: str, unit: str) -> str:
    """``peak head acceleration [g]``."""
    try:
        meaning = entry(name).meaning
    except ValueError:  # of a later version
        meaning = name
    return meaning if unit in ("", "-") else f"{meaning} [{unit}]"


def _cell(value: object) -> object:
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value) if isinstance(value, list | tuple | dict | bool) else value
