"""Optimisation with a protocol, or a scenario, as its impacts."""

from __future__ import annotations

from pathlib import Path

import pytest

from helmet_sim_ros import certify, optimise
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.study import load_optimisation

PROTOCOL = """
title: one drop on flat ground and kerb
source: test
verified: false
headform: en960_j
points:
  crown: {azimuth_deg: 0.0, elevation_deg: 90.0, source: test}
tests:
  - name: drop
    points: [crown]
    anvils: [ground, kerbstone]
    speeds: [{value: 7.5, source: test, verified: false}]
    standard: ece_r22_06_linear_medium
"""
STUDY = """
common: {helmet: {name: fullface, coupling: foam}}
protocol: %s
variables: {helmet.liner.top.density: [45.0, 65.0]}
objectives: [{minimise: helmet_mass}]
constraints: [{of: protocol_margin, at_least: 0.05}]
trials: 2
batch: 2
sampler: random
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    protocol = tmp_path / "protocol.yaml"
    protocol.write_text(PROTOCOL)
    path = tmp_path / "study.yaml"
    path.write_text(STUDY % protocol)
    return path


def test_the_margin_of_a_design_is_that_of_its_certification(study: Path, tmp_path: Path) -> None:
    result = optimise(str(study), tmp_path / "out", workers=0)
    assert len(result.trials) == 2
    for trial in (result.reference, *result.trials):
        design = result.plan.design(trial.values)
        changes = {f"helmet.{name}": value for name, value in design.changes.items()}
        campaign = certify("fullface", study.parent / "protocol.yaml", overrides=changes)
        assert trial.responses["protocol_margin"] == pytest.approx(campaign.worst_margin, rel=1e-9)
        assert trial.feasible == (trial.responses["protocol_margin"] >= 0.05)


def test_the_shipped_study_goes_through_all_of_r22_06() -> None:
    plan = load_optimisation("lighter_ece_22_06")
    assert len(plan.impacts) == 34
    assert {row.values["impact.surface"] for row in plan.impacts.rows()} == {
        "flat_anvil", "kerbstone", "bar_anvil_45",
    }  # fmt: skip
    assert {"peak_g_cfc1000", "hic_cfc1000", "bric"} <= set(plan.criteria)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("protocol: ", "product: {impact.direction: [top]}\nprotocol: ", "beside protocol"),
        ("    points: [crown]", "    hits: 2\n    points: [crown]", "strikes the same spot again"),
        ("    standard: ece_r22_06_linear_medium\n", "", "needs a protocol that sets limits"),
        ("[ground, kerbstone]", "[moon]", "anvils = 'moon': must be one of"),
    ],
)
def test_what_cannot_be_searched_is_refused(study: Path, old: str, new: str, message: str) -> None:
    for path in (study, study.parent / "protocol.yaml"):
        path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SetupError, match=message):
        load_optimisation(study)


def test_a_search_takes_the_impacts_of_a_scenario(study: Path, tmp_path: Path) -> None:
    """The head strikes of falls are such a scenario; ``common`` replaces its values."""
    impacts = tmp_path / "strikes.yaml"
    impacts.write_text(
        "common: {impact.rig: headform, helmet: bicycle, helmet.liner.density: 60.0}\n"
        "cases: [{name: a, impact.normal_velocity: 3.0}, {name: b, impact.normal_velocity: 4.0}]\n"
    )
    text = STUDY.replace("constraints: [{of: protocol_margin, at_least: 0.05}]\n", "")
    text = text.replace("name: fullface, coupling: foam", "liner.density: 70.0")
    study.write_text(text.replace("protocol: %s", f"scenario: {impacts}"))
    plan = load_optimisation(study)
    assert [row.values["impact.normal_velocity"] for row in plan.impacts.rows()] == [3.0, 4.0]
    assert plan.reference.liner.density == 70.0 and plan.reference.mass == 0.28
    for old, new, message in (
        (str(impacts), "falls_motorcycle", "is a fall; a search needs impacts"),
        (str(impacts), "nowhere", "scenario = 'nowhere': must be one of"),
        ("scenario: ", "cases: [{impact.direction: top}]\nscenario: ", "beside scenario"),
        ("scenario: ", "protocol: ece_r22_06\nscenario: ", "beside protocol"),
    ):
        other = tmp_path / "other.yaml"
        other.write_text(study.read_text().replace(old, new))
        with pytest.raises(SetupError, match=message):
            load_optimisation(other)
