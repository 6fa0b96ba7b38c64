"""Drop-test tables from a laboratory or another solver: CSV in, checked drop tests out.

Peaks, one row per test::

    direction,normal_velocity_m_s,peak_force_N,peak_compression_m

or full loops, one row per sample, tests told apart by direction and speed::

    direction,normal_velocity_m_s,force_N,compression_m
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.study.identification.drop_tests import ZONES, DropTest, loop_energy_loss

PEAKS = ("direction", "normal_velocity_m_s", "peak_force_N", "peak_compression_m")
LOOPS = ("direction", "normal_velocity_m_s", "force_N", "compression_m")
OPTIONAL = ("restitution", "energy_loss", "peak_g")

#: Plausible magnitudes of a helmet drop test; outside, the unit is wrong rather than the helmet.
RANGES = {
    "normal_velocity_m_s": (0.5, 15.0, "m/s", "km/h or mm/ms"),
    "peak_force_N": (200.0, 200e3, "N", "kN"),
    "peak_compression_m": (5e-4, 0.12, "m", "mm"),
}


def read_drop_table(path: Path) -> list[DropTest]:
    """The drop tests of a CSV file.

    Raises:
        SetupError: unreadable file, missing column, a value that is no number or not of the
            stated unit's magnitude; names the row.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            columns = tuple(reader.fieldnames or ())
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SetupError.of("table", str(path), f"cannot be read: {error}") from error
    if set(PEAKS) <= set(columns):
        return [_peaks(row, f"{path} row {n}") for n, row in enumerate(rows, 2)]
    if set(LOOPS) <= set(columns):
        return list(_loops(rows, path))
    raise SetupError.of(
        "columns", ", ".join(columns), f"must hold {', '.join(PEAKS)} or {', '.join(LOOPS)}",
        str(path),
    )  # fmt: skip


def write_drop_table(tests: list[DropTest], path: Path) -> None:
    """The peaks of drop tests as CSV, readable by :func:`read_drop_table`."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*PEAKS, *OPTIONAL])
        for t in tests:
            writer.writerow(
                [t.direction, t.normal_velocity, t.peak_force, t.peak_compression,
                 t.restitution, t.energy_loss, t.peak_g]
            )  # fmt: skip


def _peaks(row: dict[str, str], where: str) -> DropTest:
    direction = _direction(row, where)
    speed, force, compression = (_ranged(row, key, where) for key in PEAKS[1:])
    restitution, energy_loss, peak_g = (_optional(row, key, where) for key in OPTIONAL)
    return DropTest(
        direction, speed, force, compression, peak_g,
        restitution=restitution, energy_loss=energy_loss, source=where,
    )  # fmt: skip


def _loops(rows: list[dict[str, str]], path: Path) -> Iterator[DropTest]:
    groups: dict[tuple[str, float], list[tuple[float, float]]] = {}
    first: dict[tuple[str, float], int] = {}
    for n, row in enumerate(rows, 2):
        where = f"{path} row {n}"
        key = (_direction(row, where), _ranged(row, "normal_velocity_m_s", where))
        sample = (_number(row, "force_N", where), _number(row, "compression_m", where))
        groups.setdefault(key, []).append(sample)
        first.setdefault(key, n)
    for (direction, speed), samples in groups.items():
        where = f"{path} rows from {first[direction, speed]}"
        force, compression = np.array(samples).T
        energy_loss = loop_energy_loss(force, compression)
        if not 0.0 <= energy_loss <= 1.0:
            raise SetupError.of(
                "energy_loss", energy_loss,
                "must be from 0 to 1: the samples of a loop, in order of time, load the helmet and "
                "give back less than they took", where,
            )  # fmt: skip
        peaks = {"peak_force_N": f"{force.max()}", "peak_compression_m": f"{compression.max()}"}
        yield DropTest(
            direction,
            speed,
            _ranged(peaks, "peak_force_N", where),
            _ranged(peaks, "peak_compression_m", where),
            energy_loss=energy_loss,
            source=where,
        )


def _direction(row: dict[str, str], where: str) -> str:
    given = (row["direction"] or "").strip().lower()
    if given not in ZONES:
        raise SetupError.of("direction", given, f"must be one of {', '.join(ZONES)}", where)
    return ZONES[given]


def _number(row: dict[str, str], key: str, where: str) -> float:
    try:
        value = float(row[key])
    except (TypeError, ValueError):
        raise SetupError.of(key, row[key], "must be a number", where) from None
    if not math.isfinite(value):
        raise SetupError.of(key, row[key], "must be finite", where)
    return value


def _ranged(row: dict[str, str], key: str, where: str) -> float:
    value = _number(row, key, where)
    low, high, unit, likely = RANGES[key]
    if not low <= value <= high:
        raise SetupError.of(
            key, value, f"must be from {low:g} to {high:g} {unit}; is it in {likely}?", where
        )
    return value


def _optional(row: dict[str, str], key: str, where: str) -> float:
    return _number(row, key, where) if (row.get(key) or "").strip() not in ("", "nan") else math.nan
