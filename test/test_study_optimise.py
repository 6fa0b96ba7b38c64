"""Designs weigh what they must, and the search finds known optima, resumes, and tells the truth."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.study.optimisation.design import (
    DesignRules,
    liner_mass,
    make_design,
    shell_area,
)
from helmet_sim_ros.study.optimisation.plan import load_optimisation
from helmet_sim_ros.study.optimisation.search import optimise
from helmet_sim_ros.study.optimisation.trials import best

HELMET = load_helmet("fullface").replaced({"coupling": "foam"})
RULES = DesignRules()
STUDY = {
    "common": {
        "helmet.coupling": "foam",
        "helmet.liner.columns": 150,
        "impact": {"rig": "headform", "normal_velocity": 6.0},
        "sim.duration": 0.008,
    },
    "product": {"impact.direction": ["front", "top"]},
    "variables": {
        "helmet.liner.density": [40.0, 80.0],
        "helmet.liner.thickness": [0.035, 0.045],
    },
    "objectives": [{"minimise": "helmet_mass"}, {"minimise": "worst peak_g"}],
    "constraints": [{"of": "max_thickness", "at_most": 0.044}],
    "trials": 16,
    "batch": 8,
    "best": 4,
    "sensitivity": {"names": ["impact.normal_velocity"]},
}


@pytest.fixture
def plan(tmp_path: Path):
    """An optimisation from its content."""

    def load(**changes):
        path = tmp_path / "mine.yaml"
        path.write_text(yaml.safe_dump(STUDY | changes), encoding="utf-8")
        return load_optimisation(path)

    return load


def test_the_mass_of_a_spherical_liner_is_that_of_a_hollow_sphere():
    sphere = HELMET.replaced(
        {"shell.semi_axes": (0.14, 0.14, 0.14), "liner.density": 50.0, "liner.thickness": 0.04}
    )
    whole = DesignRules(lowest_normal=-1.0)
    expected = 50.0 * 4.0 / 3.0 * np.pi * (0.14**3 - 0.10**3)
    assert liner_mass(sphere, whole) == pytest.approx(expected, rel=2e-3)
    assert shell_area(sphere, whole) == pytest.approx(4.0 * np.pi * 0.14**2, rel=2e-3)
    # A cap above z = -0.3 r has 65 % of the sphere.
    assert liner_mass(sphere, RULES) == pytest.approx(0.65 * expected, rel=4e-3)


def test_the_mass_of_an_ellipsoidal_liner_agrees_with_quadrature():
    axes, t = np.array(HELMET.shell.semi_axes), HELMET.liner.thickness
    # Volume between a surface p(u, v) and p - t n, by the divergence theorem on a fine grid.
    u, v = np.meshgrid(np.linspace(0, np.pi, 1201), np.linspace(0, 2 * np.pi, 1201), indexing="ij")
    unit = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)])
    normal = unit / axes[:, None, None]
    normal /= np.linalg.norm(normal, axis=0)

    def volume(p):
        du, dv = np.gradient(p, axis=1), np.gradient(p, axis=2)
        return np.sum(np.einsum("ijk,ijk->jk", p, np.cross(du, dv, axis=0))) / 3.0

    outer = axes[:, None, None] * unit
    expected = HELMET.liner.density * (volume(outer) - volume(outer - t * normal))
    whole = DesignRules(lowest_normal=-1.0)
    assert liner_mass(HELMET, whole) == pytest.approx(expected, rel=5e-3)


def test_a_design_without_changes_is_the_reference():
    same = make_design(HELMET, {}, RULES)
    assert same.helmet.mass == pytest.approx(HELMET.mass, rel=1e-12)
    assert same.helmet.shell == HELMET.shell
    assert same.helmet.inertia == pytest.approx(HELMET.inertia, rel=1e-12)


def test_a_lighter_foam_takes_its_mass_off_the_helmet():
    half = make_design(HELMET, {"liner.density": HELMET.liner.density / 2.0}, RULES)
    saved = liner_mass(HELMET, RULES) / 2.0
    assert half.helmet.mass == pytest.approx(HELMET.mass - saved, rel=1e-9)
    assert half.quantities["liner_mass"] == pytest.approx(saved, rel=1e-9)
    assert half.helmet.inertia[0] < HELMET.inertia[0]


def test_a_thicker_liner_leaves_the_head_its_room():
    thick = make_design(
        HELMET, {"liner.front.thickness": 0.050, "liner.side.thickness": 0.040}, RULES
    )
    before, after = HELMET.shell, thick.helmet.shell
    old = HELMET.liner.thickness

    def inner(shell, axis, sign, thickness):
        return sign * (shell.center[axis] + sign * shell.semi_axes[axis] - sign * thickness)

    assert inner(after, 0, 1, 0.050) == pytest.approx(inner(before, 0, 1, old), abs=1e-12)
    assert inner(after, 0, -1, old) == pytest.approx(inner(before, 0, -1, old), abs=1e-12)
    assert inner(after, 1, 1, 0.040) == pytest.approx(inner(before, 1, 1, old), abs=1e-12)
    assert after.semi_axes[2] == before.semi_axes[2]


def test_the_inertia_of_a_design_grows_with_its_mass_and_the_square_of_its_size():
    thick = make_design(HELMET, {"liner.thickness": 0.050}, RULES).helmet
    size = np.mean(thick.shell.semi_axes) / np.mean(HELMET.shell.semi_axes)
    assert size > 1.01 and thick.mass > HELMET.mass
    expected = np.array(HELMET.inertia) * thick.mass / HELMET.mass * size**2
    assert thick.inertia == pytest.approx(tuple(expected), rel=1e-9)


def test_what_follows_from_the_design_cannot_be_varied():
    with pytest.raises(SetupError, match="follows from"):
        make_design(HELMET, {"mass": 1.0}, RULES)


def test_limits_that_only_one_corner_of_the_ranges_meets_are_no_error(plan):
    """The points that fill the ranges come near a corner and never into it."""
    file = plan()
    low = {name: bounds[0] for name, bounds in file.file.variables.items()}
    high = {name: bounds[1] for name, bounds in file.file.variables.items()}
    for corner, sense in ((low, "at_most"), (high, "at_least")):
        mass = file.design(corner).quantities["helmet_mass"]
        assert plan(constraints=[{"of": "helmet_mass", sense: mass}])
        beyond = mass * (1.0 - 1e-6) if sense == "at_most" else mass * (1.0 + 1e-6)
        with pytest.raises(SetupError, match="nothing in the ranges of the variables"):
            plan(constraints=[{"of": "helmet_mass", sense: beyond}])


def test_the_search_finds_the_corner_that_is_lightest(plan, tmp_path):
    limits = [{"of": "max_density", "at_least": 50.0}]
    mine = plan(objectives=[{"minimise": "helmet_mass"}], constraints=limits, trials=40)
    result = optimise(mine, tmp_path / "out", workers=0)
    lightest = mine.design({"helmet.liner.density": 50.0, "helmet.liner.thickness": 0.035})
    heaviest = mine.design({"helmet.liner.density": 80.0, "helmet.liner.thickness": 0.045})
    first = result.best[0]
    span = heaviest.quantities["helmet_mass"] - lightest.quantities["helmet_mass"]
    miss = first.responses["helmet_mass"] - lightest.quantities["helmet_mass"]
    assert 0.0 <= miss < 0.12 * span
    assert all(trial.values["helmet.liner.density"] >= 50.0 for trial in result.best)
    masses = [trial.responses["helmet_mass"] for trial in result.best]
    assert masses == sorted(masses)


def test_best_designs_are_the_pareto_front_of_those_that_meet_every_limit(plan, tmp_path):
    mine = plan(best=100)
    result = optimise(mine, tmp_path / "out", workers=0)
    feasible = [t for t in result.trials if t.values["helmet.liner.thickness"] <= 0.044]
    assert 0 < len(feasible) < len(result.trials)
    names = ("helmet_mass", "worst peak_g")
    scores = {t.number: tuple(t.responses[n] for n in names) for t in feasible}
    front = {
        number
        for number, (a, b) in scores.items()
        if not any(c <= a and d <= b and (c, d) != (a, b) for c, d in scores.values())
    }
    assert {trial.number for trial in result.best} == front


def test_best_designs_are_spread_along_a_long_front(plan):
    from helmet_sim_ros.study.optimisation.trials import Trial

    trials = [Trial(i, {}, {"helmet_mass": 1.0 + i, "worst peak_g": 300.0 - i}) for i in range(101)]
    assert [trial.number for trial in best(plan(best=5), trials)] == [0, 25, 50, 75, 100]


def test_worst_mean_and_percentile_are_those_of_the_criterion_over_all_impacts(plan):
    expected = {"worst hic": 900.0, "mean hic": 420.0, "p25 hic": 200.0, "p50 hic": 300.0,
                "p62.5 hic": 450.0}  # fmt: skip
    mine = plan(objectives=[{"minimise": name} for name in expected], constraints=[])
    values = {"hic": [100.0, 900.0, 300.0, 600.0, 200.0]}
    design = mine.design({})
    found = {name: response.value(design, values) for name, response in mine.responses.items()}
    assert found == pytest.approx(expected)


def test_a_limit_is_missed_by_its_share_of_the_bound():
    from helmet_sim_ros.study.optimisation.plan import Constraint

    both = Constraint(of="liner_mass", at_least=0.2, at_most=0.4)
    for mass, excess in ((0.5, 0.25), (0.4, 0.0), (0.3, -0.25), (0.2, 0.0), (0.1, 0.5)):
        assert both.excess(mass) == pytest.approx(excess, abs=1e-12)
    assert Constraint(of="liner_mass", at_least=0.2).excess(9.0) < 0.0


def test_a_design_written_as_helmet_gives_the_same_criteria_bit_for_bit(plan, tmp_path):
    mine = plan()
    result = optimise(mine, tmp_path / "out", workers=0)
    chosen = result.best[0]
    peaks = [
        evaluate(
            simulate(
                ImpactSetup(
                    rig="headform", direction=direction, normal_velocity=6.0, duration=0.008,
                    helmet=str(result.helmet_file(chosen)),
                )
            )
        ).peak_g.value
        for direction in ("front", "top")
    ]  # fmt: skip
    assert max(peaks) == chosen.responses["worst peak_g"]
    written = {path.name for path in (tmp_path / "out" / "designs").iterdir()}
    assert written == {result.helmet_file(trial).name for trial in result.best}


def test_an_interrupted_search_goes_on_as_if_it_had_not_been(plan, tmp_path):
    whole = optimise(plan(), tmp_path / "whole", workers=0)
    out = tmp_path / "out"
    first = optimise(plan(), out, workers=0, trials=8)
    assert first.computed == 8
    # As a kill in the middle of a batch leaves it: five of eight designs are stored.
    optuna = pytest.importorskip("optuna")
    partial = optuna.create_study(
        storage=f"sqlite:///{out / 'optuna.db'}", study_name="mine", load_if_exists=True,
        directions=["minimize", "minimize"],
    )  # fmt: skip
    other = optuna.load_study(storage=f"sqlite:///{tmp_path / 'whole' / 'optuna.db'}",
                              study_name="mine")  # fmt: skip
    partial.add_trials(other.trials[8:13])
    result = optimise(plan(), out, workers=0)
    assert result.computed == 3
    assert result.trials == whole.trials
    assert result.best == whole.best


def test_workers_do_not_change_the_search(plan, tmp_path):
    alone = optimise(plan(), tmp_path / "alone", workers=0)
    two = optimise(plan(), tmp_path / "two", workers=2)
    assert two.trials == alone.trials
    assert two.sensitivity == alone.sensitivity


def test_sensitivity_agrees_with_closed_forms(plan, tmp_path):
    mine = plan(objectives=[{"minimise": "liner_mass"}], trials=8)
    result = optimise(mine, tmp_path / "out", workers=0)
    found = {(e.name, e.response): e.elasticity for e in result.sensitivity}
    assert found["helmet.liner.density", "liner_mass"] == pytest.approx(1.0, abs=1e-9)
    assert found["helmet.liner.thickness", "max_thickness"] == pytest.approx(1.0, abs=1e-9)
    assert found["impact.normal_velocity", "liner_mass"] == 0.0
    with open(tmp_path / "out" / "sensitivity.csv", encoding="utf-8") as stream:
        assert len(list(csv.reader(stream))) == 1 + len(result.sensitivity)


def test_sensitivity_of_a_criterion_is_its_central_difference(plan, tmp_path):
    mine = plan(trials=8)
    result = optimise(mine, tmp_path / "out", workers=0)
    chosen = result.best[0]
    effect = next(
        e for e in result.sensitivity
        if (e.name, e.response) == ("impact.normal_velocity", "worst peak_g")
    )  # fmt: skip

    def worst(speed):
        setups = (
            ImpactSetup(
                rig="headform", direction=d, normal_velocity=speed, duration=0.008,
                helmet=str(result.helmet_file(chosen)),
            )
            for d in ("front", "top")
        )  # fmt: skip
        return max(evaluate(simulate(setup)).peak_g.value for setup in setups)

    assert (effect.low, effect.high) == (worst(6.0 * 0.95), worst(6.0 * 1.05))
    assert effect.elasticity == pytest.approx((effect.high - effect.low) / (0.1 * effect.base))
    assert effect.elasticity > 0.0


def test_results_of_another_search_are_refused(plan, tmp_path):
    optimise(plan(trials=8), tmp_path / "out", workers=0)
    with pytest.raises(SetupError, match="another study: other objectives"):
        optimise(plan(objectives=[{"minimise": "worst hic"}]), tmp_path / "out", workers=0)


def test_trials_and_plot_are_left_for_a_reader(plan, tmp_path):
    result = optimise(plan(trials=8), tmp_path / "out", workers=0)
    with open(tmp_path / "out" / "trials.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["trial"]) for row in rows] == [-1, *range(8)]
    assert float(rows[1]["worst peak_g"]) == result.trials[0].responses["worst peak_g"]
    assert (tmp_path / "out" / "pareto.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(("goal", "expected"), [("minimise", [300.0, 250.0, 240.0]),
                                                ("maximise", [300.0, 310.0, 320.0])])  # fmt: skip
def test_the_plot_of_one_objective_shows_its_best_value_so_far(plan, goal, expected):
    """Of the designs that meet every limit, beside those and the reference."""
    pytest.importorskip("matplotlib", reason="the plot needs the extra 'study'")
    from matplotlib.figure import Figure

    from helmet_sim_ros.study.optimisation.output import _history
    from helmet_sim_ros.study.optimisation.trials import OptimisationResult, Trial

    mine = plan(objectives=[{goal: "worst peak_g"}])
    peaks = {0: 300.0, 1: 310.0, 2: 250.0, 3: 250.0, 4: 320.0, 5: 240.0}
    missed = Trial(6, {}, {"worst peak_g": 100.0 if goal == "minimise" else 900.0}, {"hic": 0.1})
    trials = [Trial(n, {}, {"worst peak_g": g}) for n, g in peaks.items()] + [missed]
    reference = Trial(-1, {}, {"worst peak_g": 280.0})
    result = OptimisationResult(mine, Path(), reference, tuple(trials), (), (), 7)
    axis = Figure().subplots()
    _history(axis, result, "worst peak_g")
    best, known = axis.lines
    assert list(best.get_ydata()) == expected
    assert [peaks[n] for n in best.get_xdata()] == expected
    assert list(known.get_ydata()) == [280.0, 280.0]
    assert axis.collections[0].get_offsets().tolist() == [[n, g] for n, g in peaks.items()]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("trial", "worst peak g [g]")
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        "every limit is met", "best so far", "reference",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"variables": {}}, "at least one"),
        ({"variables": {"helmet.liner.densty": [1.0, 2.0]}}, "helmet.liner.density"),
        ({"variables": {"helmet.liner.density": [80.0, 40.0]}}, "empty range"),
        ({"variables": {"helmet.liner.density": [1.0, 40.0]}}, "from 15 to 120"),
        ({"variables": {"helmet.liner.columns": [100.0, 400.0]}}, "only numbers"),
        ({"variables": {"helmet.mass": [1.0, 2.0]}}, "follows from"),
        ({"variables": {"impact.friction": [0.1, 0.2]}}, "unknown name"),
        ({"objectives": []}, "at least one"),
        ({"objectives": [{"minimise": "peak_g"}]}, "worst CRITERION"),
        ({"objectives": [{"minimise": "worst peek_g"}]}, "peak_g"),
        ({"objectives": [{"minimise": "liner_mass", "maximise": "liner_mass"}]}, "one of"),
        ({"constraints": [{"of": "liner_mass"}]}, "at_most"),
        ({"constraints": [{"of": "liner_mass", "at_least": 2.0, "at_most": 1.0}]}, "nothing"),
        ({"constraints": [{"of": "worst hic", "at_most": 0.0}]}, "above 0"),
        ({"constraints": [{"of": "liner_mass", "at_most": 0.01}]}, "closest of .* 0.1"),
        ({"constraints": [{"of": "max_thickness", "at_most": 0.036},
                          {"of": "max_thickness", "at_least": 0.040}]}, "meets every limit"),
        ({"sensitivity": {"names": ["impact.direction"]}}, "must be a number"),
        ({"product": {"helmet.name": ["fullface", "other"]}}, "other|one helmet"),
        ({"criteria": ["peak_g"]}, "sweeps"),
        ({"trials": 0}, "from 1"),
    ],
)  # fmt: skip
def test_a_malformed_optimisation_is_refused(plan, changes, message):
    with pytest.raises(SetupError, match=message):
        plan(**changes)
