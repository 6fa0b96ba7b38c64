"""Published values to stand beside a scenario's results, from ``config/references/*.csv``."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.resources import find_config

#: Published values of one case: criterion -> model -> value, in the criterion's unit.
Published = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Reference:
    """A table of published results.

    Attributes:
        name: file name without suffix.
        source: where the values are from: the file's first comment line.
        rows: for each row the setup values it holds for (by dotted name), and what was published.
    """

    name: str
    source: str
    rows: tuple[tuple[Mapping[str, float | str], Published], ...]

    def row(self, described: Mapping[str, object]) -> Published | None:
        """What was published for a setup (``ImpactSetup.described()``); None if nothing was."""
        for conditions, published in self.rows:
            if all(_equal(described.get(name), value) for name, value in conditions.items()):
                return published
        return None


def load_reference(name_or_path: str) -> Reference:
    """The table ``config/references/NAME.csv``, or any such CSV file by path.

    The first line that starts with ``#`` is the source, all others are comments. Columns with a
    dotted name are conditions, columns ``CRITERION/MODEL`` published values.

    Raises:
        SetupError: no such table, or a malformed one; names file, row and column.
    """
    path = find_config("references", name_or_path, "reference", ".csv")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        table = csv.DictReader(line for line in lines if line.strip() and not line.startswith("#"))
        entries = list(table)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SetupError.of("reference", str(path), f"cannot be read: {error}") from error
    source = next((line.lstrip("# ") for line in lines if line.startswith("#")), path.name)
    rows = tuple(_parse(path, number, row) for number, row in enumerate(entries, 1))
    if not rows:
        raise SetupError.of("reference", str(path), "must hold at least one row")
    return Reference(path.stem, source, rows)


def _parse(
    path: Path, number: int, row: Mapping[str, str | None]
) -> tuple[Mapping[str, float | str], Published]:
    conditions: dict[str, float | str] = {}
    published: dict[str, dict[str, float]] = {}
    for column, text in row.items():
        where = f"{path}: row {number}"
        if not isinstance(column, str) or text is None:
            raise SetupError.of("(row)", text, "must have as many values as the header", where)
        criterion, slash, model = column.partition("/")
        value = _number(text)
        if slash and isinstance(value, str):
            raise SetupError.of(column, text, "must be a finite number", where)
        if slash:
            published.setdefault(criterion, {})[model] = float(value)
        elif "." in column:
            conditions[column] = value
        else:
            raise SetupError.of(column, text, "a column is a dotted name or CRITERION/MODEL", where)
    return conditions, published


def _number(text: str) -> float | str:
    try:
        value = float(text)
    except ValueError:
        return text.strip()
    return value if math.isfinite(value) else text.strip()


def _equal(a: object, b: float | str) -> bool:
    if isinstance(b, str) or not isinstance(a, (int, float)):
        return a == b
    return math.isclose(a, b, rel_tol=1e-9)
