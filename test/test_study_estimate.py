"""Percentiles of a study and the honesty of their intervals."""

from __future__ import annotations

import numpy as np
import pyarrow
import pytest

from helmet_sim_ros.study.sweeps.percentiles import converged, convergence, estimates, interval
from helmet_sim_ros.study.sweeps.study import Percentiles

WANTED = Percentiles(criteria=["peak_g"], at=[50.0, 95.0])


def table(values, draws=None, **columns):
    draws = range(len(values)) if draws is None else draws
    return pyarrow.table({"draw": list(draws), "peak_g": list(values), **columns})


def test_percentiles_are_those_of_the_sample():
    values = np.random.default_rng(1).permutation(np.arange(1001.0))
    median, high = estimates(table(values), WANTED)
    assert (median.value, high.value) == (500.0, 950.0)
    assert (median.draws, median.impacts) == (1001, 1001)
    assert median.low < 500.0 < median.high
    assert high.low < 950.0 < high.high


def test_the_interval_covers_the_truth_as_often_as_it_says():
    random = np.random.default_rng(2)
    truth = 1.6448536  # 95th percentile of the standard normal
    hits = 0
    for _ in range(100):
        low, high = interval(random.standard_normal(400), np.arange(400), 95.0)
        hits += low <= truth <= high
    assert 88 <= hits <= 100


def test_impacts_of_one_rider_do_not_count_as_independent():
    random = np.random.default_rng(3)
    riders = random.standard_normal(60)
    values, draws = np.repeat(riders, 20), np.repeat(np.arange(60), 20)
    low, high = interval(values, draws, 50.0)
    naive = interval(values, np.arange(1200), 50.0)
    alone = interval(riders, np.arange(60), 50.0)
    assert (low, high) == pytest.approx(alone, abs=0.1)
    assert high - low > 2.0 * (naive[1] - naive[0])


def test_groups_are_estimated_apart():
    values = [*range(100), *range(1000, 1100)]
    sides = ["front"] * 100 + ["back"] * 100
    wanted = Percentiles(criteria=["peak_g"], at=[50.0], by=["impact.direction"])
    found = estimates(table(values, [*range(100)] * 2, **{"impact.direction": sides}), wanted)
    assert {e.group["impact.direction"]: e.value for e in found} == {"front": 49.5, "back": 1049.5}


def test_failed_impacts_are_left_out_and_counted_out():
    values = [None if i % 4 == 0 else float(i) for i in range(400)]
    (median, _) = estimates(table(values), WANTED)
    assert median.impacts == 300
    assert median.value == np.median([v for v in values if v is not None])


def test_convergence_is_reported_over_growing_numbers_of_draws():
    values = np.random.default_rng(4).standard_normal(800)
    median, _ = convergence(table(values), WANTED)
    assert [e.draws for e in median] == [100, 200, 400, 800]
    assert [e.value for e in median] == [np.median(values[:n]) for n in (100, 200, 400, 800)]
    widths = [e.high - e.low for e in median]
    assert widths[-1] < 0.6 * widths[0]
    assert converged(median)
    assert not converged(median[:1])


def test_a_sample_that_drifts_has_not_converged():
    (median, _) = convergence(table(np.arange(800.0)), WANTED)
    assert not converged(median)


def test_too_few_draws_give_no_estimate():
    assert estimates(table([1.0, 2.0, 3.0]), WANTED) == []


@pytest.mark.parametrize(("draws", "estimated"), [(7, 0), (8, 2)])
def test_an_estimate_is_formed_of_eight_draws_at_least(draws, estimated):
    riders = np.repeat(np.arange(draws), 3)  # three impacts of a rider are one draw
    assert len(estimates(table(np.arange(3.0 * draws), riders), WANTED)) == estimated
