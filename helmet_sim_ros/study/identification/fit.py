"""Identification: from drop tests to the coupling spring of a helmet.

Per side of the helmet, F = A (exp(B d) - 1) is laid through the (force, compression) peaks by
least squares of the relative force error (Hyncik & Bonkowski, section 2.2, connect the peaks of
four speeds by an exponential). The compression of a drop test holds the shell's own bending on the
ground, F / k of the helmet's contact stiffness k, and the head's approach to the liner through the
padding. The model adds both again: they are taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml
from scipy.stats import t as student

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.identified import SIDES, exponential, exponential_through
from helmet_sim_ros.study.helmets.files import values_beside
from helmet_sim_ros.study.identification.drop_tests import DropTest, padding_stroke

MINIMUM_TESTS = 3  # two constants and one degree of freedom for their confidence
CONFIDENCE = 0.95


@dataclass(frozen=True)
class SideFit:
    """The identified law of one side.

    Attributes:
        side: front, back, side or top.
        A: [N].
        B: [1/m]; ``B_interval`` its 95 % confidence interval.
        stiffness: initial stiffness A B [N/m]; ``stiffness_interval`` its 95 % interval. A alone
            has no useful interval: for a nearly straight law A and B trade against each other.
        compression: of the spring at the peaks, shell bending and padding taken off, (n,) [m].
        force: measured peaks, (n,) [N].
        speed: (n,) [m/s].
        residual: fitted over measured force - 1, (n,) [-].
    """

    side: str
    A: float
    B: float
    stiffness: float
    stiffness_interval: tuple[float, float]
    B_interval: tuple[float, float]
    compression: FloatArray
    force: FloatArray
    speed: FloatArray
    residual: FloatArray


@dataclass(frozen=True)
class Identification:
    """The identified springs of a helmet, and the helmet that carries them."""

    fits: tuple[SideFit, ...]
    energy_loss: float
    helmet: Helmet
    notes: tuple[str, ...]


def identify(tests: Sequence[DropTest], base: Helmet) -> Identification:
    """Identify the coupling spring.

    Args:
        tests: at least three speeds for each of front, back, side and top.
        base: helmet whose shell, mass and liner the result keeps.

    Raises:
        SetupError: too few tests of a side, peaks that do not grow with the speed, or a
            compression that the shell's bending alone exceeds; names the tests.
    """
    fits = tuple(_fit(side, _checked(side, tests), base) for side in SIDES)
    losses = np.array([t.energy_loss for t in tests])
    rebounds = np.array([t.restitution for t in tests])
    notes: tuple[str, ...] = ()
    if np.isfinite(losses).any():
        energy_loss = float(np.nanmean(losses))
    elif np.isfinite(rebounds).any():
        energy_loss = float(1.0 - np.nanmean(rebounds**2))
    else:
        energy_loss = base.spring.energy_loss
        notes = ("energy_loss is the base helmet's: the table holds neither loops nor restitution",)
    energy_loss = min(max(energy_loss, 0.0), 0.98)
    laws = {fit.side: {"A": fit.A, "B": fit.B} for fit in fits}
    laws["strap"] = laws["top"]  # not part of drop tests; see the helmet's description
    spring = {**laws, "energy_loss": energy_loss}
    helmet = Helmet(**{**base.model_dump(), "coupling": "spring", "spring": spring})
    return Identification(fits, energy_loss, helmet, notes)


def write_helmet(helmet: Helmet, path: Path, description: str) -> None:
    """Write an identified helmet as a YAML file for ``helmet=PATH``."""
    data = values_beside(helmet, path.parent) | {"description": description}
    path.write_text(yaml.safe_dump(data, sort_keys=False, allow_unicode=True), encoding="utf-8")


def _checked(side: str, tests: Sequence[DropTest]) -> list[DropTest]:
    """The tests of one side by speed; same speed averaged."""
    own = [t for t in tests if t.direction == side]
    merged = []
    for speed in sorted({t.normal_velocity for t in own}):
        same = [t for t in own if t.normal_velocity == speed]
        force = float(np.mean([t.peak_force for t in same]))
        depth = float(np.mean([t.peak_compression for t in same]))
        merged.append(replace(same[0], peak_force=force, peak_compression=depth))
    if len(merged) < MINIMUM_TESTS:
        raise SetupError.of(
            side, f"{len(merged)} speeds", f"needs drop tests at {MINIMUM_TESTS} or more speeds"
        )
    problems = [
        Problem(
            f"{side} at {after.normal_velocity:g} m/s",
            f"{after.peak_force:g} N, {after.peak_compression:g} m",
            f"must exceed the peaks at {before.normal_velocity:g} m/s ({before.peak_force:g} N, "
            f"{before.peak_compression:g} m); {after.source}",
        )
        for before, after in pairwise(merged)
        if after.peak_force <= before.peak_force
        or after.peak_compression <= before.peak_compression
    ]
    if problems:
        raise SetupError(problems)
    return merged


def _fit(side: str, tests: list[DropTest], base: Helmet) -> SideFit:
    force = np.array([t.peak_force for t in tests])
    bending, padding = force / base.shell.contact_stiffness, padding_stroke(base, side, force)
    compression = np.array([t.peak_compression for t in tests]) - bending - padding
    for i, test in enumerate(tests):
        if compression[i] <= 0.1 * test.peak_compression:
            raise SetupError.of(
                f"{side} at {test.normal_velocity:g} m/s", test.peak_compression,
                "must be well above the shell's own bending, force / shell.contact_stiffness = "
                f"{bending[i]:.4g} m, and what the padding gives way, {padding[i]:.4g} m; "
                f"{test.source}",
            )  # fmt: skip
    stiffness, exponent, covariance = exponential_through(compression, force)
    reach = float(student.ppf(0.5 + 0.5 * CONFIDENCE, len(force) - 2))
    errors = reach * np.sqrt(np.diag(covariance))
    return SideFit(
        side=side,
        A=float(stiffness / exponent),
        B=float(exponent),
        stiffness=float(stiffness),
        stiffness_interval=(float(stiffness - errors[0]), float(stiffness + errors[0])),
        B_interval=(float(exponent - errors[1]), float(exponent + errors[1])),
        compression=compression,
        force=force,
        speed=np.array([t.normal_velocity for t in tests]),
        residual=exponential(compression, stiffness, exponent) / force - 1.0,
    )
