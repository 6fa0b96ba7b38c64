"""Study files: what they hold, and every way of being malformed is refused before an impact."""

from __future__ import annotations

from pathlib import Path

import pytest

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_study
from helmet_sim_ros.study.optimisation.plan import load_optimisation
from helmet_sim_ros.yaml_file import read_yaml

MATRIX = "common: {impact.rig: headform}\nproduct: {impact.direction: [front, top]}\n"
DRAW = "draw:\n  count: 8\n  values: {impact.friction: {uniform: [0.2, 0.6]}}\n"


@pytest.fixture
def study(tmp_path: Path):
    """Load a study from its YAML text."""

    def load(text: str, **overrides: object):
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return load_study(path, **overrides)

    return load


def test_every_shipped_study_loads():
    for path in (share_directory() / "config" / "studies").glob("*.yaml"):
        if "variables" in read_yaml(path, "study"):
            assert load_optimisation(path.stem).file.objectives
        else:
            assert len(load_study(path.stem)) > 0


def test_draws_multiply_the_matrix_and_the_matrix_varies_fastest(study):
    plan = study(MATRIX + DRAW)
    assert len(plan) == 16
    rows = list(plan.rows())
    assert [row.values["impact.direction"] for row in rows[:4]] == ["front", "top"] * 2
    assert [row.draw for row in rows[:4]] == [0, 0, 1, 1]
    frictions = [row.values["impact.friction"] for row in rows]
    assert frictions[0] == frictions[1] != frictions[2]
    assert len({row.id for row in rows}) == 16


def test_the_same_file_gives_the_same_rows(study):
    first, again = study(MATRIX + DRAW), study(MATRIX + DRAW)
    assert list(first.rows()) == list(again.rows())
    assert first.identity == again.identity


def test_a_study_of_draws_alone_needs_no_matrix(study):
    assert len(study(DRAW)) == 8


def test_an_override_replaces_fixed_and_drawn_values(study):
    plan = study(MATRIX + DRAW, **{"impact.friction": 0.3, "impact.rig": "rider"})
    values = [row.values for row in plan.rows()]
    assert {v["impact.friction"] for v in values} == {0.3}
    assert {v["impact.rig"] for v in values} == {"rider"}


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (("top]", "back]"), "matrix"),
        (("0.6", "0.7"), "drawn values"),
        (("draw:", "standard: snell_m2020\ndraw:"), "standard"),
        (("draw:", "criteria: [peak_g]\ndraw:"), "criteria"),
    ],
)
def test_whatever_changes_the_results_changes_the_identity(study, change, part):
    before = study(MATRIX + DRAW).identity
    after = study((MATRIX + DRAW).replace(*change)).identity
    assert before[part] != after[part]


def test_a_changed_helmet_file_changes_the_identity(study, tmp_path):
    text = (share_directory() / "config" / "helmets" / "fullface.yaml").read_text()
    helmet = tmp_path / "helmet.yaml"
    helmet.write_text(text)
    matrix = f"common: {{helmet: {helmet}}}\n" + DRAW
    before = study(matrix).identity
    helmet.write_text(text.replace("mass: 1.35", "mass: 1.36"))
    after = study(matrix).identity
    assert {key for key in before if before[key] != after[key]} == {"helmets, riders and defaults"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "mapping"),
        ("draw: {count: 8}\n", "nothing to draw"),
        ("product: {impact.direction: []}\n", "at least one value"),
        ("product: {impact.fricton: [0.1]}\n", "unknown.*impact.friction"),
        ("product: {impact.friction: [-1.0]}\n", "from 0 to 2"),
        (MATRIX + "reference: table1\n", "scenarios"),
        (MATRIX + "sandard: ece_r22_05\n", "unknown key; known: standard"),
        (MATRIX + "standard: ece_r99\n", "ece_r22_05"),
        (MATRIX + "criteria: [peek_g]\n", "peak_g"),
        (MATRIX + "criteria: [hic]\npercentiles: {criteria: [peak_g]}\n", "among criteria"),
        (MATRIX + "percentiles: {criteria: [peak_g], at: [0.0]}\n", "above 0"),
        (MATRIX + "percentiles: {criteria: [peak_g], by: [impact.friction]}\n", "must be one of"),
        (MATRIX + "histories: {worst: 0}\n", "from 1"),
        (MATRIX + DRAW.replace("[0.2, 0.6]", "[0.6, 0.2]"), "empty range"),
        (MATRIX + DRAW.replace("[0.2, 0.6]", "[0.2, 6.0]"), "from 0 to 2"),
        (MATRIX + DRAW.replace("friction", "fricton"), "unknown.*fricton|fricton.*unknown"),
        (MATRIX + DRAW.replace("count: 8", "count: 9"), "power of 2"),
        (MATRIX + DRAW.replace("impact.friction: {uniform: [0.2, 0.6]}",
                               "impact.direction: {choice: [left]}"), "given twice"),
        (MATRIX + DRAW.replace("impact.friction: {uniform: [0.2, 0.6]}",
                               "impact.direction: {choice: [under]}"), "given twice|one of front"),
        (DRAW + "  population: {name: martians}\n", "ansur_ii"),
        (DRAW.replace("impact.friction: {uniform: [0.2, 0.6]}", "rider.mass: {uniform: [50, 90]}")
         + "  population: {name: ansur_ii}\n", "given twice"),
        # Valid one by one, impossible together: the struck shell outweighs the helmet.
        ("draw:\n  count: 8\n  values: {helmet.mass: {uniform: [0.01, 0.02]}}\n", "effective_mass"),
    ],
)  # fmt: skip
def test_a_malformed_study_is_refused(study, text, message):
    with pytest.raises(SetupError, match=message):
        study(text)


def test_an_unknown_study_is_named_with_those_there_are():
    with pytest.raises(SetupError, match="population_oblique"):
        load_study("populations")
