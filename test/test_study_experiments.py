"""Published experiments as data, and the model against them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.report.validation.experiments import (
    HEADING,
    experiments_section,
    replace_section,
)
from helmet_sim_ros.study.validation.experiments import Experiment, Value, load_experiments
from helmet_sim_ros.study.validation.findings import Finding, findings

SHIPPED = load_experiments()
DROPS: dict[str, Any] = {
    "id": "D",
    "title": "drops",
    "source": "somebody 2020",
    "reading": "read",
    "set": "prediction",
    "common": {"impact.rig": "headform", "helmet.coupling": "foam", "sim.duration": 0.02},
    "product": {"impact.direction": ["front", "left"], "impact.normal_velocity": [4.0]},
    "values": [{"criterion": "peak_g", "kind": "mean", "value": 100.0, "unit": "g", "within": 0.1}],
}


def experiment(**changes: Any) -> Experiment:
    made: Experiment = Experiment.from_mapping(DROPS | changes)
    return made


def value(**changes: Any) -> dict[str, Any]:
    return DROPS["values"][0] | changes


def peaks(**setup: Any) -> list[float]:
    made = [
        ImpactSetup(rig="headform", direction=side, normal_velocity=4.0, duration=0.02,
                    overrides={"helmet.coupling": "foam", **setup})
        for side in ("front", "left")
    ]  # fmt: skip
    return [float(evaluate(simulate(one)).peak_g) for one in made]


class TestWhatIsShipped:
    def test_holds_the_rows_that_can_be_run(self) -> None:
        ids = {e.id for e in SHIPPED}
        assert {"O1", "O2", "O3", "O5", "O6", "L1", "L3", "L7", "T1"} <= ids
        assert len(ids) == len(SHIPPED)

    def test_names_calibration_and_prediction_once(self) -> None:
        for one in SHIPPED:
            assert bool(one.in_view) == (one.set == "calibration")
        assert {e.id for e in SHIPPED if e.set == "calibration"} == {"O1", "O1-turn", "L7", "T1"}

    @pytest.mark.parametrize("one", SHIPPED, ids=lambda e: e.id)
    def test_can_be_run(self, one: Experiment) -> None:
        cases = one.setups()
        assert cases and len(one.source) > 5 and one.reading in ("read", "secondary", "general")
        if one.against:
            others = one.setups(reference=True)
            assert [c.name for c in others] == [c.name for c in cases]
            assert all(a.setup != b.setup for a, b in zip(cases, others, strict=True))


class TestBounds:
    def bounds(self, **changes: Any) -> tuple[float, float]:
        return Value.from_mapping(value(**changes)).bounds  # type: ignore[no-any-return]

    def test_follow_what_was_published(self) -> None:
        assert self.bounds() == pytest.approx((90.0, 110.0))
        assert self.bounds(kind="at_most") == pytest.approx((-math.inf, 110.0))
        span = {"kind": "range", "value": None, "low": 80.0, "high": 100.0}
        assert self.bounds(**span) == pytest.approx((72.0, 110.0))
        assert self.bounds(within=None, accepted=[50.0, None]) == (50.0, math.inf)
        table = {"kind": "table", "value": None, "table": "table1/FE"}
        assert self.bounds(**table) == (0.0, 0.1)

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"unit": "m/s^2"}, "must be g"),
            ({"criterion": "peak_k"}, "peak_g"),
            ({"within": None}, "either within or accepted"),
            ({"accepted": [1.0, 2.0]}, "either within or accepted"),
            ({"low": 1.0, "high": 2.0}, "takes value"),
            ({"kind": "range"}, "takes low and high"),
            ({"kind": "factor"}, "must be -"),
            ({"kind": "table"}, "takes table"),
            ({"kind": "range", "value": None, "low": 3.0, "high": 2.0}, "must not exceed"),
            ({"value": None}, "takes value"),
        ],
    )
    def test_of_what_does_not_fit_are_refused(self, changes: dict[str, Any], words: str) -> None:
        with pytest.raises(SetupError, match=words):
            Value.from_mapping(value(**changes))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"set": "calibration"}, "in_view"),
        ({"in_view": ["density"]}, "in_view"),
        ({"set": "both"}, "set"),
        ({"values": []}, "at least one published value"),
        ({"product": {}}, "give a scenario"),
        ({"scenario": "drop_tests"}, "give a scenario"),
        ({"against": {"impact.friction": 0.1}}, "kind factor"),
        ({"reading": "seen"}, "reading"),
    ],
)
def test_an_experiment_that_does_not_fit_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SetupError, match=words):
        experiment(**changes)


def test_a_bad_file_names_file_and_experiment(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({"experiments": [DROPS, DROPS]}))
    with pytest.raises(SetupError, match=r"mine.yaml: id = 'D': is given twice"):
        load_experiments(path)
    path.write_text(yaml.safe_dump({"experiments": [DROPS | {"set": "calibration"}]}))
    with pytest.raises(SetupError, match=r"mine.yaml: experiment D: in_view"):
        load_experiments(path)


class TestFindings:
    def test_compare_each_the_mean_or_the_largest(self) -> None:
        ours = peaks()
        for over, expected in (
            ("each", ours), ("mean", [sum(ours) / 2]), ("largest", [max(ours)]),
        ):  # fmt: skip
            (found,) = findings([experiment(values=[value(over=over)])])
            assert found.ours == pytest.approx(ours, rel=1e-12)
            assert found.compared == pytest.approx(expected, rel=1e-12)

    def test_accept_what_lies_within_the_bound_and_nothing_else(self) -> None:
        mean = sum(peaks()) / 2
        for published, accepted in ((mean * 1.11, True), (mean * 1.12, False)):
            (found,) = findings([experiment(values=[value(value=published)])])
            assert found.accepted == accepted
            assert found.difference == pytest.approx(mean / published - 1.0)

    def test_each_must_be_accepted(self) -> None:
        low, high = sorted(peaks())
        both = value(over="each", within=None, accepted=[low * 0.99, high * 1.01])
        one = value(over="each", within=None, accepted=[low * 0.99, high * 0.99])
        found = findings([experiment(values=[both, one])])
        assert [f.accepted for f in found] == [True, False]

    def test_factors_are_between_two_setups(self) -> None:
        against = {"helmet.liner.density": 80.0}
        factor = value(kind="factor", unit="-", over="each")
        (found,) = findings([experiment(against=against, values=[factor])])
        expected = [a / b for a, b in zip(peaks(), peaks(**against), strict=True)]
        assert found.ours == pytest.approx(expected, rel=1e-12) and max(expected) < 1.0

    def test_an_upper_bound_is_only_missed_from_above(self) -> None:
        mean = sum(peaks()) / 2
        limits = [value(kind="at_most", value=v, within=0.01) for v in (2 * mean, 0.5 * mean)]
        below, above = findings([experiment(values=limits)])
        assert below.accepted and below.difference == 0.0
        assert not above.accepted and above.difference == pytest.approx(1.0)

    def test_a_table_is_compared_case_by_case(self) -> None:
        table = value(kind="table", value=None, table="table1/FE", within=0.5)
        given = {"product": {}, "scenario": "oblique_table1", "values": [table]}
        (found,) = findings([experiment(**given, common={"sim.time_step": 1e-4})])
        assert len(found.ours) == 6 and found.compared[0] == pytest.approx(sum(found.ours) / 6)
        (found,) = findings([experiment(**given, common={"impact.normal_velocity": 4.0})])
        assert "no peak_g/FE" in found.problem and not found.accepted

    def test_the_crush_of_a_liner_is_its_largest_strain_times_its_thickness(self) -> None:
        crush = value(criterion="liner_crush", unit="m", over="each")
        (found,) = findings([experiment(values=[crush])])
        assert all(0.005 < ours < 0.044 for ours in found.ours)
        spring = DROPS["common"] | {"helmet.coupling": "spring"}
        (found,) = findings([experiment(values=[crush], common=spring)])
        assert "not of a foam helmet" in found.problem

    def test_what_cannot_be_run_is_told_and_the_others_go_on(self) -> None:
        unknown = experiment(common={"helmet.nonsense": 1.0})
        bad, good = findings([unknown, experiment()])
        assert "helmet.nonsense" in bad.problem and not bad.accepted and bad.difference is None
        assert good.compared


class TestTheSection:
    FOUND = (
        Finding(experiment(), Value.from_mapping(value()), ("front",), (150.0,), (150.0,)),
        Finding(experiment(id="E", set="calibration", in_view=["density"]),
                Value.from_mapping(value()), ("front",), (101.0,), (101.0,)),
        Finding(experiment(id="X"), Value.from_mapping(value()), problem="no such helmet"),
    )  # fmt: skip

    def test_shows_published_ours_difference_and_verdict(self) -> None:
        text = experiments_section(self.FOUND)
        assert "| D | peak g [g] | mean 100 | 150 | +50 % | 90 to 110 | **no** |" in text
        assert "| E | peak g [g] | mean 100 | 101 | +1 % | 90 to 110 | yes |" in text
        assert (
            "| X | peak g [g] | mean 100 | no such helmet | - | 90 to 110 | cannot be run |" in text
        )
        assert "| prediction | 2 | 0 | 50 % | 1 |" in text
        assert "| calibration | 1 | 1 | 1 % | 0 |" in text
        assert "Chosen with it in view: density." in text

    def test_takes_the_place_of_the_one_before(self, tmp_path: Path) -> None:
        path = tmp_path / "validation.md"
        path.write_text("# Validation\n\nwords\n\n## Next\n\nmore\n")
        replace_section(path, experiments_section(self.FOUND[:1]))
        replace_section(path, experiments_section(self.FOUND))
        text = path.read_text()
        assert text.count(HEADING) == 1 and "| E |" in text
        assert text.startswith("# Validation\n\nwords\n") and "## Next\n\nmore\n" in text
        path.write_text(f"# V\n\n{HEADING}\n\nold\n\n## Next\n\nmore\n")
        replace_section(path, experiments_section(self.FOUND))
        text = path.read_text()
        assert "old" not in text and text.endswith("\n## Next\n\nmore\n")


def test_the_command_shows_a_file_of_mine_and_writes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({"experiments": [DROPS]}))
    options = ["validate", "--experiments", "--references", str(path), "--output", str(tmp_path)]
    answer = CliRunner().invoke(main, options)
    assert answer.exit_code == 0, answer.output
    assert "of 1 published values" in answer.output and "mean 100" in answer.output
    assert [p.name for p in tmp_path.iterdir()] == ["mine.yaml"]
    answer = CliRunner().invoke(main, ["validate", "--references", str(path)])
    assert answer.exit_code == 2 and "--experiments" in answer.output


def test_the_command_writes_its_sections_into_a_folder_that_it_makes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = TestTheSection.FOUND
    monkeypatch.setattr("helmet_sim_ros.study.validation.findings.findings", lambda *_: found)
    folder = tmp_path / "new" / "deeper"
    answer = CliRunner().invoke(main, ["validate", "--experiments", "--output", str(folder)])
    assert answer.exit_code == 0, answer.output
    accepted = sum(finding.accepted for finding in found)
    assert f"{accepted} of {len(found)} published values within" in answer.output
    text = (folder / "validation.md").read_text()
    assert HEADING in text and text.count("\n## ") + text.startswith("## ") == 2
