"""Compression tests of a foam: stress over strain at one or several strain rates, checked."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.study.tables import Column, read_table

#: Names as laboratories write them, English and German.
STRAIN = ("strain", "compression", "dehnung", "stauchung", "epsilon")
STRESS = ("stress", "spannung", "sigma", "druck")
RATE = ("rate", "strain rate", "strain_rate", "dehnrate", "stauchrate")
STRAIN_UNITS = {"%": 1e-2, "-": 1.0, "1": 1.0, "m/m": 1.0, "mm/mm": 1.0}
STRESS_UNITS = {
    "pa": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6, "n/mm^2": 1e6, "n/mm²": 1e6, "bar": 1e5,
    "psi": 6894.757,
}  # fmt: skip
RATE_UNITS = {"1/s": 1.0, "s-1": 1.0, "s^-1": 1.0, "/s": 1.0, "1/min": 1.0 / 60.0, "1/ms": 1e3}
PLATEAU = (0.15, 0.35)  # strains between which every crushable foam is on its plateau
#: Plausible stress there [Pa]: soft comfort foam to the densest liners, with room to both sides.
STRESSES = (1e3, 8e6)
FALL = 0.05  # share of the highest stress so far by which a curve may fall: yield drop and noise
LEAST = 0.5  # strain that a test must reach: from there on foams densify
FEWEST = 8  # points
RATE_IN_NAME = re.compile(r"([\d.,]+(?:e[-+]?\d+)?)\s*(1/s|s-1|s\^-1|/s|1/min|1/ms)", re.I)


@dataclass(frozen=True)
class Curve:
    """One test: ``strain`` rising, (n,) [-]; ``stress`` never falling, (n,) [Pa]; ``rate`` [1/s],
    None where not told; ``raised``: largest share by which a stress was raised to keep it from
    falling."""

    strain: FloatArray
    stress: FloatArray
    rate: float | None
    raised: float

    @property
    def plateau(self) -> float:
        """Stress in the middle of the plateau [Pa]."""
        return float(np.interp(0.5 * sum(PLATEAU), self.strain, self.stress))


def read_curves(path: Path) -> list[Curve]:
    """The tests in a table: columns strain and stress, and of several rates either a column with
    the rate or a stress column for each (``stress 100 1/s [MPa]``); sorted by rate.

    Raises:
        SetupError: a missing column, an unknown unit, a value outside what foams show in it, a
            strain or stress that falls, or too few points; names file and row.
    """
    columns = read_table(path, "foam")
    strain = _only(columns, STRAIN, "strain", path)
    stresses = [c for c in columns if _is(c, STRESS)]
    rates = [c for c in columns if _is(c, RATE) and not _is(c, STRESS)]
    if not stresses:
        raise SetupError.of("foam", str(path), f"has no column named {' or '.join(STRESS)}")
    if rates and len(stresses) > 1:
        raise SetupError.of("foam", str(path), "has rates and several stresses; give one of both")
    by_strain = _scale(strain, STRAIN_UNITS, path)
    curves = []
    for stress in stresses:
        by_stress = _scale(stress, STRESS_UNITS, path)
        groups: dict[float | None, list[tuple[int, float, float]]] = {}
        for i, row in enumerate(stress.rows):
            e, s = strain.values[i], stress.values[i]
            if e is None or s is None:
                continue
            rate = _rate_of_row(rates[0], i, path) if rates else _rate_in(stress.name, path)
            groups.setdefault(rate, []).append((row, e * by_strain, s * by_stress))
        curves += [_checked(points, rate, path) for rate, points in groups.items()]
    if not curves:
        raise SetupError.of("foam", str(path), "has no row with both strain and stress")
    if len(curves) > 1 and any(c.rate is None or c.rate <= 0.0 for c in curves):
        raise SetupError.of("foam", str(path), "several tests need a rate above 0 each")
    return sorted(curves, key=lambda curve: curve.rate or 0.0)


def _checked(points: list[tuple[int, float, float]], rate: float | None, path: Path) -> Curve:
    rows, strain, stress = (np.array(column) for column in zip(*points, strict=True))
    at = f"{path} row"
    if len(rows) < FEWEST:
        raise SetupError.of("foam", f"{len(rows)} points", f"needs {FEWEST} or more", str(path))
    if strain.max() > 1.0:
        i = int(np.flatnonzero(strain > 1.0)[0])
        raise SetupError.of(
            "strain", float(strain[i]), "must be below 1 (100 %); is the column in % ?",
            f"{at} {rows[i]}",
        )  # fmt: skip
    falls = np.flatnonzero(np.diff(strain) < 0.0)
    if len(falls):
        i = int(falls[0]) + 1
        raise SetupError.of(
            "strain", float(strain[i]), f"falls below the {strain[i - 1]:g} before it; give the "
            "loading only",
            f"{at} {rows[i]}",
        )  # fmt: skip
    if strain[0] < -1e-3 or strain[0] > 0.05:
        raise SetupError.of("strain", float(strain[0]), "must start near 0", f"{at} {rows[0]}")
    if strain[-1] < LEAST:
        hint = "; is the column in % ?" if strain[-1] < 0.01 else ""
        raise SetupError.of(
            "strain", float(strain[-1]), f"ends before {LEAST:g}: no densification is seen{hint}",
            f"{at} {rows[-1]}",
        )  # fmt: skip
    plateau = float(np.interp(0.5 * sum(PLATEAU), strain, stress))
    if not STRESSES[0] <= plateau <= STRESSES[1]:
        i = int(np.searchsorted(strain, 0.5 * sum(PLATEAU)))
        raise SetupError.of(
            "stress", plateau, f"Pa at {100 * strain[i]:.0f} % strain must be from {STRESSES[0]:g} "
            f"to {STRESSES[1]:g} Pa; wrong unit?",
            f"{at} {rows[i]}",
        )  # fmt: skip
    highest = np.maximum.accumulate(stress)
    fallen = np.flatnonzero(stress < (1.0 - FALL) * highest - 1e-3 * plateau)
    if len(fallen):
        i = int(fallen[0])
        raise SetupError.of(
            "stress", float(stress[i]), f"falls below {100 * (1 - FALL):g} % of the "
            f"{highest[i]:g} Pa before it; give the loading only",
            f"{at} {rows[i]}",
        )  # fmt: skip
    if stress[-1] < 1.2 * plateau:
        raise SetupError.of(
            "stress", float(stress[-1]), f"ends below 1.2 times the plateau's {plateau:g} Pa: no "
            "densification is seen",
            f"{at} {rows[-1]}",
        )  # fmt: skip
    return _smoothed(np.maximum(strain, 0.0), np.maximum(stress, 0.0), rate, plateau)


def _smoothed(strain: FloatArray, stress: FloatArray, rate: float | None, plateau: float) -> Curve:
    """Strains once each, and the nearest stresses that never fall (isotonic regression)."""
    unique, which = np.unique(strain, return_inverse=True)
    mean = np.bincount(which, stress) / np.bincount(which)
    rising = np.asarray(isotonic_regression(mean).x)
    raised = float(np.abs(rising - mean).max() / plateau)
    return Curve(unique, rising, rate, raised)


def _is(column: Column, names: tuple[str, ...]) -> bool:
    words = column.name.replace("_", " ")
    if names is RATE:
        return any(name in words for name in names)
    return any(words.startswith(name) for name in names) and not words.startswith(
        ("strain rate", "stauchrate", "dehnrate")
    )


def _only(columns: list[Column], names: tuple[str, ...], what: str, path: Path) -> Column:
    found = [column for column in columns if _is(column, names)]
    if len(found) != 1:
        raise SetupError.of(
            "foam", str(path), f"has {len(found)} columns of {what}; one must be named "
            f"{' or '.join(names)}",
        )  # fmt: skip
    return found[0]


def _scale(column: Column, units: dict[str, float], path: Path) -> float:
    unit = column.unit.lower().replace(" ", "")
    if unit not in units:
        raise SetupError.of(
            column.name, column.unit or "no unit",
            f"must be one of {', '.join(units)}, in brackets in the heading of {path}",
        )  # fmt: skip
    return units[unit]


def _rate_of_row(column: Column, i: int, path: Path) -> float:
    value = column.values[i]
    if value is None:
        raise SetupError.of(column.name, "", "must be a number", f"{path} row {column.rows[i]}")
    return value * _scale(column, RATE_UNITS, path)


def _rate_in(name: str, path: Path) -> float | None:
    found = RATE_IN_NAME.search(name)
    if not found:
        return None
    return float(found[1].replace(",", ".")) * RATE_UNITS[found[2].lower()]
