"""Measured pulses from CSV files, as data acquisition systems export them."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from helmet_sim_ros.biomech.measured import MeasuredPulse
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray
from helmet_sim_ros.errors import PulseError

_DEGREE = np.pi / 180.0
#: Units that a column may have: quantity -> unit -> factor to SI.
UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "acceleration": {"g": STANDARD_GRAVITY, "m/s^2": 1.0},
    "angular_velocity": {"rad/s": 1.0, "deg/s": _DEGREE},
    "angular_acceleration": {"rad/s^2": 1.0, "krad/s^2": 1e3, "deg/s^2": _DEGREE},
}
_AXES = ("x", "y", "z")
_WITH_UNIT = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")


def read_pulse(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    normal_velocity: float | None = None,
) -> MeasuredPulse:
    """A measured pulse from a CSV file, for :func:`~helmet_sim_ros.evaluate`.

    The file has a row of names and one row per sample; separator comma, semicolon (then the
    decimal sign may be a comma) or tab; lines that begin with ``#`` are skipped. Each name has its
    unit in brackets, ``acceleration_x [g]``; or a row of units stands below the names.

    ============================ ===================================
    column                       unit
    ============================ ===================================
    ``time``                     s, ms, us
    ``acceleration_x``, _y, _z,  g, m/s^2
    or ``acceleration`` (one
    axis or the resultant)
    ``angular_velocity_x`` ...   rad/s, deg/s
    ``angular_acceleration_x``   rad/s^2, krad/s^2, deg/s^2
    ============================ ===================================

    Axes and meaning are those of :class:`~helmet_sim_ros.biomech.MeasuredPulse`. Other columns are
    left alone.

    Args:
        path: the file.
        columns: where the file has other names: ours -> the file's (without unit).
        normal_velocity: speed of the impact [m/s], which a standard prescribes.

    Raises:
        PulseError: no such file, no such column, no known unit, or a cell that is no number, named
            with file, column and line; or the pulse itself is refused.
    """
    source = Path(path)
    try:
        text = source.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise PulseError(f"{source}: cannot be read: {error}") from None
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1)
             if line.strip() and not line.lstrip().startswith("#")]  # fmt: skip
    try:
        table = _Table(lines, dict(columns or {}))
        return MeasuredPulse(
            table.column("time"),
            table.acceleration(),
            table.vector("angular_velocity"),
            table.vector("angular_acceleration"),
            normal_velocity,
        )
    except PulseError as error:
        raise PulseError(f"{source}: {error}") from None


class _Table:
    """Names, units and rows of a file."""

    def __init__(self, lines: Sequence[tuple[int, str]], renamed: Mapping[str, str]) -> None:
        known = {*_names()}
        for name in renamed:
            if name not in known:
                raise PulseError(f"columns: unknown name {name!r}; known: {', '.join(_names())}")
        if not lines:
            raise PulseError("the file is empty")
        header = lines[0][1]
        self._separator = max(";\t,", key=header.count)
        cells = [_split(cell) for cell in self._cells(header)]
        rows = lines[1:]
        self._renamed = renamed
        self._names = [name for name, _ in cells]
        self._units = [unit for _, unit in cells]
        if rows and not any(_is_number(cell) for cell in self._cells(rows[0][1])):
            below = [cell.strip().strip("[]()") for cell in self._cells(rows[0][1])]
            below += [""] * (len(cells) - len(below))
            self._units = [above or unit for above, unit in zip(self._units, below, strict=False)]
            rows = rows[1:]
        self._rows = [(number, self._cells(line)) for number, line in rows]

    def column(self, name: str) -> FloatArray:
        """A column in SI units, shape (n,)."""
        place = self._place(name)
        if place is None:
            there = ", ".join(filter(None, self._names)) or "none"
            raise PulseError(f"no column {self._renamed.get(name, name)!r}; there are: {there}")
        quantity = name.removesuffix("_x").removesuffix("_y").removesuffix("_z")
        unit = self._units[place].replace("²", "^2").replace("µ", "u").replace("°", "deg")
        factor = UNITS[quantity].get(unit)
        if factor is None:
            said = f"unit {unit!r}" if unit else "no unit"
            allowed = ", ".join(UNITS[quantity])
            raise PulseError(f"column {self._names[place]!r}: {said}; must be one of {allowed}, "
                             f"as in '{name} [{next(iter(UNITS[quantity]))}]'")  # fmt: skip
        values = [self._number(number, row, place) for number, row in self._rows]
        return factor * np.array(values, dtype=float)

    def vector(self, quantity: str) -> FloatArray | None:
        """Three columns, shape (n, 3); None where the file has none of them."""
        names = [f"{quantity}_{axis}" for axis in _AXES]
        if all(self._place(name) is None for name in names):
            return None
        return np.column_stack([self.column(name) for name in names])

    def acceleration(self) -> FloatArray:
        """Components (n, 3), or the one column that stands for them (n,)."""
        vector = self.vector("acceleration")
        return self.column("acceleration") if vector is None else vector

    def _place(self, name: str) -> int | None:
        wanted = self._renamed.get(name, name)
        found = [i for i, have in enumerate(self._names) if have.casefold() == wanted.casefold()]
        if len(found) > 1:
            raise PulseError(f"column {wanted!r} is there {len(found)} times")
        return found[0] if found else None

    def _number(self, line: int, row: Sequence[str], place: int) -> float:
        cell = row[place] if place < len(row) else ""
        if self._separator == ";":
            cell = cell.replace(",", ".")
        try:
            return float(cell)
        except ValueError:
            name = self._names[place]
            raise PulseError(f"line {line}, column {name!r}: {cell!r} is no number") from None

    def _cells(self, line: str) -> list[str]:
        return next(iter(csv.reader([line], delimiter=self._separator)))


def _names() -> Iterable[str]:
    yield "time"
    yield "acceleration"
    for quantity in ("acceleration", "angular_velocity", "angular_acceleration"):
        yield from (f"{quantity}_{axis}" for axis in _AXES)


def _split(cell: str) -> tuple[str, str]:
    """Name and unit of a header cell."""
    match = _WITH_UNIT.fullmatch(cell)
    return (match[1].strip(), match[2]) if match else (cell.strip(), "")


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
