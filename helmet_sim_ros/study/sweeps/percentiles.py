"""Percentiles of criteria over people and impact conditions, with their uncertainty."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.study.sweeps.study import Percentiles

RESAMPLES = 1000
SEED = 20240229  # of the bootstrap: the same table gives the same interval
#: Fewest draws of which an estimate is formed.
MIN_DRAWS = 8


@dataclass(frozen=True)
class Estimate:
    """A percentile of a criterion.

    Attributes:
        group: names and values that the impacts share; empty: all impacts.
        criterion, percent: what is estimated.
        draws, impacts: how many it is formed of; failed impacts are left out.
        value: the estimate.
        low, high: its bootstrap 95 % interval.
    """

    group: Mapping[str, object]
    criterion: str
    percent: float
    draws: int
    impacts: int
    value: float
    low: float
    high: float


def estimates(table: Any, wanted: Percentiles) -> list[Estimate]:
    """Percentiles of the whole study.

    Args:
        table: results (``pyarrow.Table``).
        wanted: criteria, percentiles and groups.
    """
    return [series[-1] for series in _series(table, wanted, [1.0])]


def convergence(table: Any, wanted: Percentiles) -> list[list[Estimate]]:
    """The same, each for an eighth, a quarter, a half of the draws, and all of them.

    Smaller ones are the first draws of the study: of a Sobol sequence these fill the space
    themselves.
    """
    return list(_series(table, wanted, [0.125, 0.25, 0.5, 1.0]))


def converged(series: Sequence[Estimate]) -> bool:
    """Whether half of the draws give an estimate inside the interval of all draws."""
    return len(series) > 1 and series[-1].low <= series[-2].value <= series[-1].high


def _series(table: Any, wanted: Percentiles, shares: Sequence[float]) -> Iterator[list[Estimate]]:
    draws = np.array(table["draw"].to_pylist())
    keys = [table[name].to_pylist() for name in wanted.by]
    groups: dict[tuple[object, ...], list[int]] = {}
    for i in range(len(draws)):
        groups.setdefault(tuple(column[i] for column in keys), []).append(i)
    total = int(draws.max()) + 1
    for (key, members), criterion in itertools.product(groups.items(), wanted.criteria):
        group = dict(zip(wanted.by, key, strict=True))
        values = np.array(table[criterion].to_pylist(), dtype=float)
        valid = np.array([i for i in members if np.isfinite(values[i])], dtype=int)
        for percent in wanted.at:
            series = []
            for share in shares:
                keep = valid[draws[valid] < share * total]
                used = len(np.unique(draws[keep]))
                if used >= MIN_DRAWS:
                    value = float(np.percentile(values[keep], percent))
                    bounds = interval(values[keep], draws[keep], percent)
                    series.append(
                        Estimate(group, criterion, percent, used, len(keep), value, *bounds)
                    )
            if series:
                yield series


def interval(
    values: FloatArray, draws: Sequence[int] | NDArray[np.int64], percent: float
) -> tuple[float, float]:
    """Bootstrap interval (95 %, percentile method) of a percentile.

    Whole draws are resampled: the impacts of one rider are not independent of each other. Points
    of a Sobol or Latin hypercube sample are more even than independent ones, so the interval is
    on the wide side for them.

    Args:
        values: shape (n,).
        draws: the draw each belongs to, shape (n,).
        percent: above 0 and below 100.
    """
    order = np.argsort(draws, kind="stable")
    _, starts, counts = np.unique(np.asarray(draws)[order], return_index=True, return_counts=True)
    ordered = np.asarray(values)[order]
    ranks = np.argsort(ordered, kind="stable")
    owner = np.repeat(np.arange(len(counts)), counts)[ranks]
    ascending = ordered[ranks]
    random = np.random.default_rng(SEED)
    found = np.empty(RESAMPLES)
    for k in range(RESAMPLES):
        # How often each draw is picked weighs its impacts; the percentile is read off the ranks.
        picked = np.bincount(random.integers(len(starts), size=len(starts)), minlength=len(starts))
        weight = np.cumsum(picked[owner])
        found[k] = ascending[np.searchsorted(weight, percent / 100.0 * weight[-1])]
    low, high = np.percentile(found, [2.5, 97.5])
    return float(low), float(high)
