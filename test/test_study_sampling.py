"""Draws: distributions have the moments they claim, and points fill the space."""

from __future__ import annotations

import numpy as np
import pytest

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.study.sweeps.population import NAMES, load_population
from helmet_sim_ros.study.sweeps.sampling import Distribution, unit_points
from helmet_sim_ros.study.sweeps.study import value_leaves

LEAVES = value_leaves()


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random"])
def test_points_are_the_same_for_the_same_seed_and_others_for_another(method):
    points = unit_points(method, 64, 3, 7)
    assert points.shape == (64, 3)
    assert np.all((points >= 0.0) & (points < 1.0))
    assert np.array_equal(points, unit_points(method, 64, 3, 7))
    assert not np.array_equal(points, unit_points(method, 64, 3, 8))


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_space_filling_points_put_one_into_each_stratum(method):
    points = unit_points(method, 64, 3, 7)
    for column in points.T:
        assert sorted((column * 64).astype(int)) == list(range(64))


def test_sobol_refuses_a_count_that_breaks_its_balance():
    with pytest.raises(SetupError, match=r"power of 2.*128"):
        unit_points("sobol", 100, 2, 0)


def test_a_uniform_value_covers_its_range_evenly():
    values = Distribution(uniform=[4.0, 8.0]).values(unit_points("sobol", 256, 1, 0)[:, 0])
    assert np.mean(values) == pytest.approx(6.0, abs=0.01)
    assert min(values) >= 4.0 and max(values) <= 8.0
    assert np.percentile(values, 25) == pytest.approx(5.0, abs=0.02)


def test_a_log_uniform_value_has_its_median_at_the_geometric_mean():
    values = Distribution(log_uniform=[1.0, 100.0]).values(unit_points("sobol", 256, 1, 0)[:, 0])
    assert np.median(values) == pytest.approx(10.0, rel=0.02)


def test_a_normal_value_has_mean_and_deviation_and_keeps_its_bounds():
    unit = unit_points("sobol", 1024, 1, 0)[:, 0]
    free = Distribution(normal=[0.4, 0.05]).values(unit, LEAVES["impact.friction"])
    assert np.mean(free) == pytest.approx(0.4, abs=1e-3)
    assert np.std(free) == pytest.approx(0.05, rel=0.02)
    cut = Distribution(normal=[0.4, 0.05], within=[0.4, 0.45]).values(unit)
    assert min(cut) >= 0.4 and max(cut) <= 0.45
    # Half-normal cut at one deviation: phi(0) - phi(1) over Phi(1) - Phi(0).
    assert np.mean(cut) == pytest.approx(0.4 + 0.05 * (0.39894 - 0.24197) / 0.34134, abs=2e-4)


def test_choices_and_integers_are_equally_likely():
    unit = unit_points("sobol", 256, 1, 0)[:, 0]
    picks = Distribution(choice=["a", "b", "c", "d"]).values(unit)
    assert [picks.count(x) for x in "abcd"] == [64, 64, 64, 64]
    counts = Distribution(uniform=[50, 53]).values(unit, LEAVES["helmet.liner.columns"])
    assert [counts.count(n) for n in (50, 51, 52, 53)] == [64, 64, 64, 64]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "give one of"),
        ({"uniform": [1.0, 2.0], "choice": [1.0]}, "give one of"),
        ({"uniform": [2.0, 1.0]}, "empty range"),
        ({"uniform": [2.0, 2.0]}, "empty range"),
        ({"log_uniform": [0.0, 1.0]}, "above 0"),
        ({"normal": [0.4, 0.0]}, "above 0"),
        ({"choice": []}, "at least one"),
        ({"uniform": [0.0, 1.0], "within": [0.0, 1.0]}, "normal only"),
        ({"uniform": [0.0, float("nan")]}, "uniform"),
    ],
)
def test_a_distribution_that_is_none_is_refused(given, message):
    with pytest.raises(SetupError, match=message):
        Distribution(**given)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("impact.friction", {"uniform": [-0.1, 0.4]}, "from 0 to 2"),
        ("impact.friction", {"uniform": [0.4, 2.1]}, "from 0 to 2"),
        ("impact.normal_velocity", {"uniform": [0.0, 5.0]}, "above 0"),
        ("impact.direction", {"uniform": [0.0, 5.0]}, "one of front"),
        ("impact.friction", {"normal": [9.0, 0.1]}, "hardly any"),
    ],
)
def test_a_distribution_beyond_its_value_is_refused(name, given, message):
    with pytest.raises(SetupError, match=message):
        Distribution(**given).check(LEAVES[name])


def test_riders_have_the_moments_and_correlations_of_the_survey():
    population = load_population("ansur_ii")
    drawn = population.riders(unit_points("sobol", 8192, 4, 0), 0.25)
    sex = np.array(drawn["population.sex"])
    assert drawn["rider.sex"] == drawn["population.sex"]
    assert np.mean(sex == "female") == pytest.approx(0.25, abs=0.002)
    for name, published in (("female", population.female), ("male", population.male)):
        height, mass, head = (np.array(drawn[n])[sex == name] for n in NAMES)
        assert height.mean() == pytest.approx(published.height[0], abs=2e-3)
        assert height.std() == pytest.approx(published.height[1], rel=0.03)
        assert np.log(mass).mean() == pytest.approx(published.log_mass[0], abs=5e-3)
        assert np.log(mass).std() == pytest.approx(published.log_mass[1], rel=0.03)
        correlation = np.corrcoef(height, np.log(mass))[0, 1]
        assert correlation == pytest.approx(published.height_mass, abs=0.03)
        # The regression holds for the means, too.
        law = population.head_mass
        expected = law.intercept + law.per_circumference * published.head_circumference[0]
        assert head.mean() == pytest.approx(expected + law.per_mass * mass.mean(), abs=0.01)


def test_means_of_the_drawn_riders_are_those_published_in_kilograms():
    drawn = load_population("ansur_ii").riders(unit_points("sobol", 4096, 4, 3), 0.0)
    # Gordon et al. 2014: men 175.6 cm, 85.5 kg with a deviation of 14.2 kg.
    assert np.mean(drawn["rider.height"]) == pytest.approx(1.756, abs=0.002)
    assert np.mean(drawn["rider.mass"]) == pytest.approx(85.5, abs=0.3)
    assert np.std(drawn["rider.mass"]) == pytest.approx(14.2, abs=0.3)


def test_a_population_with_impossible_correlations_is_refused():
    population = load_population("ansur_ii")
    with pytest.raises(SetupError, match="no such three correlations"):
        population.male.replaced({"height_mass": 0.9, "height_circumference": -0.9})
