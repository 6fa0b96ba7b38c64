"""Scenario files: the shipped matrices, names, products, and every way of being malformed."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.study import load_reference, load_scenario
from helmet_sim_ros.study.scenario.overrides import parse_override, parse_overrides


@pytest.fixture
def scenario(tmp_path: Path):
    """Load a scenario from its YAML text."""

    def load(text: str, **common: object):
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scenario(path, **common)

    return load


def test_oblique_table1_is_the_six_side_impacts_of_the_paper():
    cases = load_scenario("oblique_table1").cases
    speeds = [(c.setup.normal_velocity, c.setup.tangential_velocity) for c in cases]
    assert speeds == [(vn, vt) for vn in (2.5, 5.0, 7.5) for vt in (5.0, 10.0)]
    for case in cases:
        assert (case.setup.rig, case.setup.direction) == ("rider", "left")
        assert (case.setup.tangential_heading_deg, case.setup.body_angle_deg) == (90.0, 30.0)
        assert (case.setup.rider.height, case.setup.rider.mass) == (1.75, 77.0)
    published = [case.reference["peak_g"]["MB"] for case in cases]
    assert published == [56.0, 57.0, 113.0, 116.0, 190.0, 174.0]
    assert cases[4].reference["force_ratio"] == {"MB": 0.24, "FE": 0.32, "THUMS": 0.18}


@pytest.mark.parametrize(
    ("name", "count", "rig"),
    [("drop_tests", 16, "headform"), ("oblique_matrix", 24, "rider"), ("ece_22_05", 5, "headform")],
)
def test_shipped_matrices_are_complete(name: str, count: int, rig: str):
    scenario = load_scenario(name)
    assert len(scenario.cases) == count
    assert {setup.rig for setup in scenario.setups} == {rig}
    assert len({case.name for case in scenario.cases}) == count
    assert len({str(setup) for setup in scenario.setups}) == count


def test_published_values_belong_to_the_side_impacts_only():
    cases = load_scenario("oblique_matrix").cases
    found = {case.setup.direction for case in cases if case.reference is not None}
    assert found == {"left"}
    assert sum(case.reference is not None for case in cases) == 6


def test_groups_dotted_names_and_the_helmet_shorthand_mean_the_same(scenario):
    nested = scenario(
        "common: {helmet: fullface, impact: {friction: 0.3},\n"
        " rider: {neck: {tension_plateau: 900}}}\n"
        "cases: [{impact: {direction: side}}]"
    )
    dotted = scenario(
        "common: {helmet.name: fullface, impact.friction: 0.3, rider.neck.tension_plateau: 900}\n"
        "cases: [{impact.direction: left}]"
    )
    assert nested.setups == dotted.setups
    assert nested.setups[0].rider.neck.tension_plateau == 900.0


def test_each_case_is_combined_with_the_whole_product(scenario):
    loaded = scenario(
        "cases:\n"
        "  - {name: low, impact.body_angle_deg: 10}\n"
        "  - {name: steep, impact.body_angle_deg: 60}\n"
        "product: {impact.normal_velocity: [5, 7.5], impact.friction: 0.2}"
    )
    assert [case.name for case in loaded.cases] == [
        "low vn5 friction=0.2", "low vn7.5 friction=0.2",
        "steep vn5 friction=0.2", "steep vn7.5 friction=0.2",
    ]  # fmt: skip
    assert [s.body_angle_deg for s in loaded.setups] == [10, 10, 60, 60]
    assert {s.friction for s in loaded.setups} == {0.2}


def test_equal_names_are_numbered(scenario):
    loaded = scenario("cases: [{name: a}, {name: a}, {name: b}]")
    assert [case.name for case in loaded.cases] == ["a", "a #2", "b"]


def test_an_exponent_without_a_point_is_a_number(scenario):
    assert scenario("cases: [{sim.time_step: 2e-5}]").setups[0].time_step == 2e-5


def test_arguments_replace_the_values_of_every_case(scenario):
    text = "common: {impact.friction: 0.5}\ncases: [{impact.body_angle_deg: 5}, {}]"
    loaded = scenario(
        text,
        body_angle_deg=20.0,
        rider=Rider(mass=90.0),
        overrides={"helmet.liner.density": 60.0, "impact.friction": 0.3},
    )
    for setup in loaded.setups:
        assert (setup.body_angle_deg, setup.friction, setup.rider.mass) == (20.0, 0.3, 90.0)
        assert setup.helmet_config.liner.density == 60.0


def test_a_relative_path_without_folder_is_a_path(tmp_path, monkeypatch):
    (tmp_path / "here.yaml").write_text("cases: [{}]")
    monkeypatch.chdir(tmp_path)
    assert load_scenario("here.yaml").name == "here"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["(document)", "mapping"]),
        ("[1, 2]", ["mapping"]),
        ("cases: []", ["cases", "empty"]),
        ("common: {impact.friction: 0.3}", ["cases", "empty"]),
        (
            f"product: {{impact.friction: {[0.1] * 9000}, impact.gravity: {[9.0] * 9000}}}",
            ["cases = 81000000", "at most 20000 cases"],
        ),
        ("product: {impact.friction: []}", ["product", "impact.friction", "at least one"]),
        ("cases: 3", ["cases = 3", "must be a list"]),
        ("cases: [3]", ["cases = 3"]),
        ("case: [{}]", ["case", "unknown key", "cases"]),
        ("cases: [{impact.frition: 0.3}]", ["case 1", "impact.frition", "unknown"]),
        ("cases: [{}, {impact: {friction: abc}}]", ["case 2", "friction = 'abc'", "0 to 2"]),
        ("cases: [{impact.friction: .nan}]", ["impact.friction = nan", "0 to 2"]),
        ("cases: [{impact.normal_velocity: -1}]", ["-1", "above 0 to 30 m/s"]),
        ("cases: [{impact.normal_velocity: 1e9}]", ["above 0 to 30 m/s"]),
        ("cases: [{impact.body_angle_deg: 95}]", ["body_angle_deg = 95", "0 to 90 deg"]),
        ("cases: [{rider.mass: 0}]", ["rider.mass = 0", "30 to 180 kg"]),
        ("cases: [{helmet: sombrero}]", ["sombrero", "fullface"]),
        ("common: {helmet: sombrero}\ncases: [{}]", ["common", "sombrero", "fullface"]),
        ("cases: [{helmet.liner.density: 1}]", ["helmet.liner.density = 1", "15 to 120"]),
        ("cases: [{helmet.lining: 1}]", ["helmet.lining", "unknown key"]),
        ("cases: [{impact.direction: below}]", ["below", "front, back, left, right, top"]),
        ("cases: [{impact.rig: [1]}]", ["impact.rig"]),
        ("cases: [{name: 3}]", ["name = 3", "text"]),
        ("cases: [{1: 2}]", ["1", "key must be text"]),
        ("cases: [{impact.friction: 0.3, impact: {friction: 0.2}}]", ["friction", "given twice"]),
        ("cases: [{}]\ncases: [{}]", ["'cases' is given twice"]),
        ("cases: [{impact.friction: 1}]\nproduct: {impact.friction: [1]}", ["product too"]),
        ("cases: [{}]\nreference: table9", ["reference = 'table9'", "table1"]),
        ("cases: [{", ["cannot be read"]),
    ],
)
def test_a_malformed_file_is_refused_by_file_case_key_and_value(scenario, text, words):
    with pytest.raises(SetupError) as refused:
        scenario(text)
    message = str(refused.value)
    assert "mine.yaml" in message
    for word in words:
        assert word in message
    assert "\n" not in message


def test_a_missing_file_and_an_unknown_name_are_refused():
    with pytest.raises(SetupError, match=r"missing\.yaml.*no such file"):
        load_scenario("missing.yaml")
    with pytest.raises(SetupError, match="drop_tests, ece_22_05"):
        load_scenario("missing")


def test_bad_arguments_name_the_argument():
    with pytest.raises(SetupError, match=r"body_angle = 3: unknown argument.*body_angle_deg"):
        load_scenario("drop_tests", body_angle=3)
    with pytest.raises(SetupError, match=r"impact\.body_angle_deg = 95.*0 to 90 deg"):
        load_scenario("drop_tests", body_angle_deg=95.0)
    with pytest.raises(SetupError, match="must be a mapping"):
        load_scenario("drop_tests", overrides=["a"])


def test_a_bad_helmet_file_is_named_with_its_own_key(tmp_path, scenario):
    bad = tmp_path / "bad.yaml"
    bad.write_text(yaml.safe_dump({"mass": -1.0}))
    with pytest.raises(SetupError, match=r"mine\.yaml: case 1.*bad\.yaml.*mass = -1"):
        scenario(f"cases: [{{helmet: {bad}}}]")


def test_the_paper_table_is_complete_and_states_its_source():
    table = load_reference("table1")
    assert len(table.rows) == 6
    assert "Hyncik" in table.source
    assert all(set(row) == {"force_ratio", "peak_g"} for _, row in table.rows)
    assert table.row({"impact.direction": "left", "impact.normal_velocity": 3.0}) is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("impact.friction,peak_g/A\n", ["at least one row"]),
        ("impact.friction,peak_g/A\n0.3\n", ["row 1", "as many values"]),
        ("impact.friction,peak_g/A\n0.3,1,2\n", ["row 1", "as many values"]),
        ("impact.friction,peak_g/A\n0.3,high\n", ["row 1", "peak_g/A = 'high'", "finite"]),
        ("impact.friction,peak_g/A\n0.3,nan\n", ["row 1", "finite"]),
        ("speed,peak_g/A\n0.3,1\n", ["speed", "dotted name"]),
    ],
)
def test_a_malformed_reference_is_refused_by_row_and_column(tmp_path, text, words):
    path = tmp_path / "published.csv"
    path.write_text(text)
    with pytest.raises(SetupError) as refused:
        load_reference(str(path))
    for word in ["published.csv", *words]:
        assert word in str(refused.value)


def test_overrides_are_yaml_values_by_name():
    texts = ["impact.friction=0.3", "", "sim.time_step=2e-5", "helmet=fullface", "a=[1, 2]"]
    assert parse_overrides(texts) == {
        "impact.friction": 0.3, "sim.time_step": 2e-5, "helmet": "fullface", "a": [1, 2],
    }  # fmt: skip
    for bad in ("impact.friction", "=3", "a={"):
        with pytest.raises(SetupError):
            parse_override(bad)
