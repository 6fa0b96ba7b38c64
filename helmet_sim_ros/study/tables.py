"""Tables as laboratories write them: units in the header, semicolons, decimal commas, unit rows."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

from helmet_sim_ros.errors import SetupError

UNIT = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$")


@dataclass(frozen=True)
class Column:
    """A column of a table: its heading without unit, the unit (``""``: none given), its values
    (None: empty), and the row of the file that each stands in."""

    name: str
    unit: str
    values: tuple[float | None, ...]
    rows: tuple[int, ...]


def read_table(path: Path, key: str) -> list[Column]:
    """The columns of a text table with a heading.

    Lines before the heading that start with ``#`` or hold a single field are skipped. Fields are
    parted by semicolons, tabs or commas; where commas do not part them, they are decimal ones.
    Units stand in brackets behind the names, or in a row of their own.

    Args:
        key: what an error calls the file.

    Raises:
        SetupError: unreadable, no heading, a row of another length, or a value that is no finite
            number; names file and row.
    """
    lines = _lines(path, key)
    delimiter = _delimiter([text for _, text in lines])
    parted = [
        (n, [f.strip() for f in next(csv.reader([t], delimiter=delimiter))]) for n, t in lines
    ]
    start = next((i for i, (_, fields) in enumerate(parted) if len(fields) > 1), None)
    if start is None:
        raise SetupError.of(key, str(path), "holds no table: no line has two columns")
    number, heading = parted[start]
    if all(_number(field) is not None for field in heading if field):
        raise SetupError.of(
            key, f"{path} row {number}", "must be a heading with names and units, not numbers"
        )
    body = parted[start + 1 :]
    units = [_unit_of(field) for field in heading]
    if not any(units) and body and all(_number(f) is None for f in body[0][1]):
        units = [_unit_of(field) or field.strip("[]() ") for field in body[0][1]]
        body = body[1:]
    if not body:
        raise SetupError.of(key, str(path), "holds a heading but no rows")
    values: list[list[float | None]] = [[] for _ in heading]
    for number, fields in body:
        fields = fields[: len(heading)] if not any(fields[len(heading) :]) else fields
        if len(fields) != len(heading):
            raise SetupError.of(
                key, f"{path} row {number}",
                f"has {len(fields)} fields, the heading {len(heading)}; a truncated file?",
            )  # fmt: skip
        for column, field, name in zip(values, fields, heading, strict=True):
            column.append(None if not field else _finite(field, f"{path} row {number}", name))
    rows = tuple(number for number, _ in body)
    names = [UNIT.sub("", field).strip().lower() for field in heading]
    return [
        Column(name, unit, tuple(column), rows)
        for name, unit, column in zip(names, units, values, strict=True)
    ]


def _lines(path: Path, key: str) -> list[tuple[int, str]]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SetupError.of(key, str(path), f"cannot be read: {error.strerror}") from error
    if b"\0" in content[:4096] and not content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SetupError.of(key, str(path), "is no text")
    wide = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")  # as measuring machines of Europe write
    numbered = list(enumerate(text.splitlines(), 1))
    return [(n, line) for n, line in numbered if line.strip() and not line.startswith("#")]


def _delimiter(lines: list[str]) -> str:
    """What parts most lines: the semicolon and the tab before the comma."""
    for delimiter in (";", "\t"):
        if sum(delimiter in line for line in lines) > 0.5 * len(lines):
            return delimiter
    return ","


def _unit_of(field: str) -> str:
    found = UNIT.search(field)
    return found[1] if found else ""


def _number(field: str) -> float | None:
    text = field.replace(" ", "")
    if "," in text and "." in text:  # one of them groups thousands
        text = text.replace("," if text.rfind(".") > text.rfind(",") else ".", "")
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def _finite(field: str, where: str, name: str) -> float:
    value = _number(field)
    if value is None or not math.isfinite(value):
        raise SetupError.of(name, field, "must be a finite number", where)
    return value
