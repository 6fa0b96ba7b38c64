"""Measured drop tests as histories: acceleration over time, from CSV tables or ISO-MME folders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.setup import Direction
from helmet_sim_ros.study.identification.drop_tests import ZONES
from helmet_sim_ros.study.tables import Column, read_table

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
ACCELERATIONS = {"g": 1.0, "m/s^2": 1.0 / STANDARD_GRAVITY, "m/s2": 1.0 / STANDARD_GRAVITY,
                 "m/s²": 1.0 / STANDARD_GRAVITY, "m/(s*s)": 1.0 / STANDARD_GRAVITY}  # fmt: skip
SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6}
#: Plausible peaks of a helmet drop [g]; outside, the unit is wrong.
PEAKS = (15.0, 1000.0)
LONGEST = 1.0  # s
FEWEST = 30  # samples
STRUCK: dict[str, Direction] = {"front": "front", "back": "back", "left": "left", "right": "right",
                                "side": "left", "top": "top"}  # fmt: skip
#: ISO-MME channel codes: resultant acceleration of the head's centre of gravity, and its axes.
RESULTANT, AXES = "ACR", ("ACX", "ACY", "ACZ")


@dataclass(frozen=True)
class MeasuredDrop:
    """A headform's drop test.

    Attributes:
        direction: part of the helmet that strikes: front, back, left, right, top.
        speed: at first touch [m/s].
        time: (n,) [s], rising.
        acceleration: resultant at the headform's centre of gravity, (n,) [g].
        source: file.
    """

    direction: Direction
    speed: float
    time: FloatArray
    acceleration: FloatArray
    source: str


def is_history_table(path: Path) -> bool:
    """Whether a table lists histories (a column ``file``) and not peaks."""
    try:
        return any(column == "file" for column in _heading(path))
    except OSError:
        return False


def read_histories(path: Path) -> list[MeasuredDrop]:
    """The drops that a table lists: columns ``file`` (CSV or ISO-MME folder, beside the table),
    ``direction`` and ``speed [m/s]``.

    Raises:
        SetupError: anything that cannot be used; names file and row.
    """
    names = _heading(path)
    lines = [
        (n, line) for n, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]  # fmt: skip
    delimiter = ";" if ";" in lines[0][1] else ","
    missing = [name for name in ("direction", "speed") if name not in names]
    if missing:
        raise SetupError.of("tests", str(path), f"misses the column {' and '.join(missing)}")
    drops = []
    unit = lines[0][1].split(delimiter)[names.index("speed")].partition("[")[2].strip(" ]\r")
    if unit not in SPEEDS:
        raise SetupError.of("speed", unit or "no unit", f"must be one of {', '.join(SPEEDS)}",
                            f"{path} heading")  # fmt: skip
    for number, line in lines[1:]:
        where = f"{path} row {number}"
        fields = [field.strip() for field in line.split(delimiter)]
        if len(fields) < len(names):
            raise SetupError.of("tests", line, f"must have {len(names)} fields", where)
        row = dict(zip(names, fields, strict=False))
        direction = row["direction"].lower()
        if direction not in ZONES:
            raise SetupError.of("direction", direction, f"must be one of {', '.join(ZONES)}", where)
        try:
            speed = float(row["speed"].replace(",", ".")) * SPEEDS[unit]
        except ValueError:
            raise SetupError.of("speed", row["speed"], "must be a number", where) from None
        if not 0.5 <= speed <= 15.0:
            raise SetupError.of("speed", speed, "m/s must be from 0.5 to 15", where)
        time, acceleration = read_history(path.parent / row["file"])
        struck: Direction = STRUCK[direction]
        drops.append(MeasuredDrop(struck, speed, time, acceleration, row["file"]))
    if not drops:
        raise SetupError.of("tests", str(path), "lists no test")
    return drops


def read_history(path: Path) -> tuple[FloatArray, FloatArray]:
    """Time [s] and resultant acceleration [g] of a CSV table or an ISO-MME folder, (n,) each.

    Raises:
        SetupError: unreadable, no time or acceleration, wrong units by magnitude, or times that do
            not rise; names file and row.
    """
    if path.is_dir() or path.suffix.lower() == ".mme":
        time, acceleration, rows = _isomme(path if path.is_dir() else path.parent)
    elif not path.is_file():
        raise SetupError.of("file", str(path), "no such file")
    else:
        time, acceleration, rows = _csv(path)
    if len(time) < FEWEST:
        raise SetupError.of("file", str(path), f"has {len(time)} samples, needs {FEWEST}")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        raise SetupError.of("time", float(time[back[0] + 1]), "must rise",
                            f"{path} row {rows[back[0] + 1]}")  # fmt: skip
    if time[-1] - time[0] > LONGEST:
        raise SetupError.of("time", float(time[-1] - time[0]), f"s is longer than {LONGEST:g} s; "
                            "is it in ms?", str(path))  # fmt: skip
    peak = float(acceleration.max())
    if not PEAKS[0] <= peak <= PEAKS[1]:
        raise SetupError.of(
            "acceleration", peak, f"g at its peak must be from {PEAKS[0]:g} to {PEAKS[1]:g} g; is "
            "it in m/s^2?",
            f"{path} row {rows[int(acceleration.argmax())]}",
        )  # fmt: skip
    return time, acceleration


def _heading(path: Path) -> list[str]:
    if not path.is_file():
        return []
    for line in path.read_text(encoding="utf-8-sig", errors="replace").splitlines():
        if line.strip() and not line.startswith("#"):
            fields = line.split(";" if ";" in line else ",")
            return [field.partition("[")[0].strip().lower() for field in fields]
    return []


def _csv(path: Path) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    columns = read_table(path, "history")
    times = [c for c in columns if c.name in ("time", "t", "zeit")]
    if len(times) != 1:
        raise SetupError.of("history", str(path), "must have one column named time")
    time = _complete(times[0], path) * _unit(times[0], TIMES, path)
    resultant = [c for c in columns if c.name.startswith(("resultant", "res", "a_res"))]
    axes = [c for c in columns if c.name in ("x", "y", "z", "ax", "ay", "az", "a_x", "a_y", "a_z")]
    other = [c for c in columns if c.name.startswith(("acceleration", "beschleunigung", "a"))]
    chosen = resultant[:1] or (axes if len(axes) == 3 else other[:1])
    if not chosen:
        raise SetupError.of(
            "history", str(path), "must have a column acceleration or resultant, or x, y and z"
        )
    parts = [_complete(c, path) * _unit(c, ACCELERATIONS, path) for c in chosen]
    return time, np.linalg.norm(parts, axis=0), times[0].rows


def _complete(column: Column, path: Path) -> FloatArray:
    for value, row in zip(column.values, column.rows, strict=True):
        if value is None:
            raise SetupError.of(column.name, "", "must be a number", f"{path} row {row}")
    return np.array(column.values, dtype=float)


def _unit(column: Column, units: dict[str, float], path: Path) -> float:
    if column.unit not in units:
        raise SetupError.of(
            column.name, column.unit or "no unit",
            f"must be one of {', '.join(units)}, in brackets in the heading of {path}",
        )  # fmt: skip
    return units[column.unit]


def _isomme(folder: Path) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    """Head acceleration of an ISO/TS 13499 test; the unfiltered channel before a filtered one."""
    channels: dict[str, tuple[Path, dict[str, str], list[str]]] = {}
    places = [folder / "Channel", folder / "CHANNEL", folder]
    place = next((p for p in places if list(p.glob("*.[0-9][0-9][0-9]"))), None)
    if place is None:
        raise SetupError.of("file", str(folder), "holds no ISO-MME channels (*.001, ...)")
    for path in sorted(place.glob("*.[0-9][0-9][0-9]")):
        lines = path.read_text(encoding="latin-1").splitlines()
        fields = {}
        count = 0
        for line in lines:
            name, colon, value = line.partition(":")
            if not colon:
                break
            fields[name.strip().lower()] = value.strip()
            count += 1
        code = fields.get("channel code", "").upper()
        if len(code) == 16 and "HEAD" in code and code[12:15] in (RESULTANT, *AXES):
            kept = channels.get(code[12:15])
            if kept is None or code[15] == "0":
                channels[code[12:15]] = (path, fields, lines[count:])
    wanted = [RESULTANT] if RESULTANT in channels else list(AXES)
    if not set(wanted) <= channels.keys():
        raise SetupError.of("file", str(folder), "has no channel of the head's acceleration")
    parts = []
    time: FloatArray = np.zeros(0)
    for code in wanted:
        path, fields, lines = channels[code]
        unit = fields.get("unit", "")
        if unit not in ACCELERATIONS:
            raise SetupError.of(
                "unit", unit, f"must be one of {', '.join(ACCELERATIONS)}", str(path)
            )
        try:
            values = np.array([float(line) for line in lines if line.strip()])
            step = float(fields["sampling interval"])
            start = float(fields.get("time of first sample", "0"))
        except (KeyError, ValueError) as error:
            raise SetupError.of("file", str(path), f"cannot be read: {error}") from error
        told = fields.get("number of samples", "")
        if told.isdigit() and int(told) != len(values):
            raise SetupError.of(
                "file", str(path), f"is truncated: {len(values)} samples, its header tells {told}"
            )
        if not np.isfinite(values).all():
            raise SetupError.of("file", str(path), "has values that are not finite")
        parts.append((values * ACCELERATIONS[unit]).astype(np.float64))
        time = start + step * np.arange(len(values), dtype=np.float64)
    if len({len(part) for part in parts}) > 1:
        raise SetupError.of("file", str(folder), "has channels of different lengths")
    return time, np.linalg.norm(parts, axis=0), tuple(range(1, len(time) + 1))
