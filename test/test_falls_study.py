"""Studies and scenarios of falls: measures of strikes, summaries, pages, the command line."""

from __future__ import annotations

import csv
import re
from dataclasses import replace

import pytest
import yaml
from click.testing import CliRunner

from helmet_sim_ros import Fall, head_strikes, simulate
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.setup import fall_from_names
from helmet_sim_ros.model.fall.strikes import Location
from helmet_sim_ros.report.falls.map import strike_map
from helmet_sim_ros.report.falls.page import falls_page
from helmet_sim_ros.report.falls.tables import (
    SLOWEST,
    FallResult,
    impacts_of,
    to_csv,
    to_scenario,
)
from helmet_sim_ros.study import load_scenario
from helmet_sim_ros.study.falls.measures import STRIKE_MEASURES, judge_fall
from helmet_sim_ros.study.falls.summary import summarise, zone_of
from helmet_sim_ros.study.sweeps.study import load_study
from helmet_sim_ros.study.sweeps.sweep import sweep
from helmet_sim_ros.study.sweeps.worker import Job, run_chunk

FALL = {"fall.preset": "bicycle", "helmet.name": "none", "sim.duration": 0.7}
NOTHING = FALL | {"sim.duration": 0.1}


@pytest.fixture(scope="module")
def result():
    fall = Fall(preset="bicycle", helmet="none", duration=0.7)
    return FallResult("over the bars", fall, head_strikes(simulate(fall)))


def test_a_worker_gives_the_measures_and_criteria_of_the_worst_strike(result):
    names = (*STRIKE_MEASURES, "peak_g")
    ok, nothing = run_chunk(Job("ece_r22_05", names), [FALL, NOTHING])
    worst = result.strikes.worst
    values = dict(zip(names, ok.values, strict=True))
    assert ok.status == nothing.status == "ok"
    assert values["strikes"] == len(result.strikes)
    assert values["strike_normal_velocity"] == worst.normal_velocity
    assert values["strike_azimuth_deg"] == worst.location.azimuth_deg
    assert values["peak_g"] == worst.evaluation.peak_g.value
    assert ok.verdict in ("pass", "fail")
    assert nothing.values == (0.0, *[None] * (len(names) - 1)) and nothing.verdict is None
    assert judge_fall(simulate(result.fall), "ece_r22_05", ["strikes"])[1] == (len(result.strikes),)


def test_a_study_of_falls_has_columns_for_strikes(tmp_path):
    path = tmp_path / "few.yaml"
    text = {"common": FALL | {"sim.duration": 0.6}, "product": {"fall.speed": [3.0, 6.0]},
            "criteria": ["strikes", "strike_speed", "peak_g"]}  # fmt: skip
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    table = sweep(load_study(str(path)), tmp_path / "out", workers=0).table.to_pydict()
    assert table["status"] == ["ok", "ok"] and table["fall.speed"] == [3.0, 6.0]
    summary = summarise(table)[0]
    assert summary.falls == 2 and summary.struck == sum(n > 0 for n in table["strikes"])


def test_a_sweep_calls_falls_falls_and_tells_what_was_suffered_in_them(tmp_path):
    path = tmp_path / "few.yaml"
    hard = {"fall.preset": "motorcycle", "fall.scene": "wall", "sim.duration": 0.12}
    text = {"common": hard, "product": {"fall.speed": [40.0]}, "criteria": ["peak_g"]}
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    words = ["sweep", str(path), "--workers", "0", "--output", str(tmp_path / "out")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "few: 1 falls" in done.output and "1 of 1 falls evaluated" in done.output
    assert "  1: the coupling spring was compressed by … mm" in done.output
    assert "impact" not in done.output


def test_a_sweep_writes_the_strikes_of_falls_at_even_steps_through_the_ranks(tmp_path):
    path, out = tmp_path / "few.yaml", tmp_path / "out"
    speeds = [8.0, 3.0, 5.0, 6.0]
    text = {"common": FALL, "product": {"fall.speed": speeds}, "criteria": ["strikes", "peak_g"]}
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    done = CliRunner().invoke(
        main, ["sweep", str(path), "--output", str(out), "--workers", "0", "--strikes", "2"]
    )
    assert done.exit_code == 0, done.output
    found = sweep(load_study(str(path)), out, workers=0)
    ranked = sorted(range(4), key=lambda i: -found.table["peak_g"][i].as_py())
    rows = [row.index for row in found.spread(2)]
    assert rows == sorted((ranked[1], ranked[3])) and len(found.spread(9)) == 4
    names = {case.name.partition(",")[0] for case in load_scenario(str(out / "strikes.yaml")).cases}
    assert names == {f"few-{i:06d}" for i in rows}
    impacts = tmp_path / "impacts.yaml"
    impacts.write_text("cases: [{impact.direction: top}]", encoding="utf-8")
    refused = CliRunner().invoke(main, ["sweep", str(impacts), "--strikes", "2"])
    assert refused.exit_code == 2 and "goes with a study of falls" in refused.output


def test_a_study_of_falls_keeps_the_worst_head_strike_as_an_impact(tmp_path):
    pytest.importorskip("rclpy")
    from helmet_sim_ros import open_log

    path, out = tmp_path / "few.yaml", tmp_path / "out"
    kept = {"worst": 1, "by": "peak_g"}
    text = {"common": FALL, "product": {"fall.speed": [3.0, 8.0]}, "histories": kept,
            "criteria": ["strikes", "peak_g"]}  # fmt: skip
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    done = CliRunner().invoke(main, ["sweep", str(path), "--output", str(out), "--workers", "0"])
    assert done.exit_code == 0, done.output
    table = sweep(load_study(str(path)), out, workers=0).table.to_pydict()
    worst = table["peak_g"].index(max(table["peak_g"]))
    (logged,) = open_log(out / "histories.mcap")
    fall = fall_from_names(FALL | {"fall.speed": table["fall.speed"][worst]})
    strike = head_strikes(simulate(fall)).worst
    assert strike.peak_acceleration / 9.80665 == pytest.approx(table["peak_g"][worst], rel=1e-3)
    assert same_samples(logged.record, simulate(strike.setup()))


def test_measures_of_strikes_are_refused_for_impacts(tmp_path):
    path = tmp_path / "impacts.yaml"
    text = {"common": {"impact.normal_velocity": 5.0}, "cases": [{"rider.height": 1.7}],
            "criteria": ["strike_speed"]}  # fmt: skip
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    with pytest.raises(SetupError, match=r"strike_speed.*goes with falls"):
        load_study(str(path))


def test_a_summary_counts_falls_without_contact_and_leaves_failed_ones_out():
    columns = {
        "status": ["ok", "ok", "ok", "failed"], "strikes": [1.0, 2.0, 0.0, None],
        "strike_speed": [4.0, 6.0, None, None], "strike_azimuth_deg": [0.0, 80.0, None, None],
        "strike_elevation_deg": [0.0, 10.0, None, None],
    }  # fmt: skip
    (summary,) = summarise(columns)
    assert (summary.falls, summary.struck) == (3, 2)
    (speed,) = summary.measures
    assert (speed.name, speed.mean, speed.median) == ("strike_speed", 5.0, 5.0)
    assert summary.zones["front"] == summary.zones["left"] == 0.5
    assert zone_of(170.0, 10.0) == "back" and zone_of(0.0, 80.0) == "top"


def test_a_summary_tells_mean_deviation_and_percentiles_of_each_group():
    columns = {
        "status": ["ok"] * 5, "strikes": [1.0] * 5, "fall.scene": ["road"] * 3 + ["car"] * 2,
        "peak_angular_acceleration": [1000.0, 2000.0, 6000.0, 4000.0, 4000.0],
    }  # fmt: skip
    road, car = summarise(columns, ["fall.scene"])
    assert [(s.group, s.falls, s.struck) for s in (road, car)] == [("road", 3, 3), ("car", 2, 2)]
    (spread,), (same,) = road.measures, car.measures
    assert (spread.name, spread.unit) == ("peak_angular_acceleration", "krad/s^2")
    assert (spread.mean, spread.median) == pytest.approx((3.0, 2.0))
    assert spread.deviation == pytest.approx(7.0**0.5)  # of a sample: over n - 1
    assert (spread.low, spread.high) == pytest.approx((1.1, 5.6))
    assert (same.mean, same.deviation, same.low, same.high) == pytest.approx((4.0, 0.0, 4.0, 4.0))


@pytest.mark.parametrize("name", ["falls_motorcycle"])
def test_a_scenario_of_falls_is_made_of_falls(name):
    scenario = load_scenario(name, duration=0.5)
    assert scenario.setups == () and len(scenario.falls) == len(scenario.cases) > 3
    assert all(fall.duration == 0.5 for fall in scenario.falls)


def test_strikes_become_a_scenario_of_impacts(result, tmp_path):
    path = tmp_path / "strikes.yaml"
    path.write_text(to_scenario([result]), encoding="utf-8")
    setups = load_scenario(str(path)).setups
    wanted = [s for s in result.strikes if s.normal_velocity >= SLOWEST]
    assert wanted
    assert [s.normal_velocity for s in setups] == [s.normal_velocity for s in wanted]
    assert setups[0].described() == wanted[0].setup().described()


def test_a_strike_too_fast_for_an_impact_is_in_the_table_alone():
    fall = Fall(preset="motorcycle", speed=40.0, scene="wall", pitch_deg=80.0, duration=0.15)
    fast = FallResult("into the wall", fall, head_strikes(simulate(fall)))
    assert fast.strikes[0].normal_velocity > 30.0
    (first, *_) = csv.DictReader(to_csv([fast]).splitlines())
    assert (first["fall"], first["strike"]) == ("into the wall", "1")
    assert first["notes"] == "; ".join(fast.strikes[0].record.notes)
    assert "more than the 44 mm that the liner has" in first["notes"]
    assert all(strike.normal_velocity <= 30.0 for _, _, strike in impacts_of([fast]))
    assert "into the wall, strike 1" not in (to_scenario([fast]) or "")


def test_the_table_has_a_line_per_strike(result):
    rows = list(csv.DictReader(to_csv([result]).splitlines()))
    assert len(rows) == len(result.strikes)
    assert float(rows[0]["normal_velocity [m/s]"]) == pytest.approx(
        result.strikes[0].normal_velocity
    )


def test_the_page_shows_strikes_and_falls_without(result):
    empty = FallResult("<b>upright</b>", Fall(preset="pedestrian"), head_strikes(
        simulate(Fall(preset="pedestrian", duration=0.05))))  # fmt: skip
    page = falls_page([result, empty])
    assert page.count('<td class="number"><a href="#strike-') == len(result.strikes)
    assert "No head contact: &lt;b&gt;upright" in page and "<b>upright" not in page


def test_a_strike_is_drawn_where_the_map_says_that_it_is(result):
    strike = result.strikes[0]
    places = {"front": (0.0, 45.0), "left": (90.0, 0.0), "right": (-90.0, -45.0)}
    strikes = [
        (f"#{name}", replace(strike, location=Location(*place, name)))
        for name, place in places.items()
    ]
    text = strike_map(strikes)
    columns = {name: float(x) for x, name in re.findall(
        r'<text x="([\d.]+)" y="[\d.]+" text-anchor="middle">(\w+)<', text)}  # fmt: skip
    rows = {name: float(y) - 4.0 for y, name in re.findall(
        r'y="([\d.]+)" text-anchor="end">([-\d]+)°<', text)}  # fmt: skip
    dots = re.findall(r'<circle class="mark" cx="([\d.]+)" cy="([\d.]+)"', text)
    for (x, y), (name, (_, elevation)) in zip(dots, places.items(), strict=True):
        assert float(x) == pytest.approx(columns[name], abs=0.06)
        assert float(y) == pytest.approx(rows[f"{elevation:.0f}"], abs=0.06)
    assert columns["left"] < columns["front"] < columns["right"]  # as seen from behind
    assert rows["45"] < rows["0"] < rows["-45"]
    assert f"#left: {strike.struck}, {strike.normal_velocity:.1f} m/s" in text


def test_the_verb_shows_a_fall_and_writes_its_strikes(tmp_path):
    output = tmp_path / "out"
    words = ["fall", "bicycle", "--helmet", "none", "--duration", "0.7", "--output", str(output)]
    done = CliRunner().invoke(main, words, env={"COLUMNS": "120"})
    assert done.exit_code == 0, done.output
    assert "Head strikes" in done.output and "road" in done.output
    assert {"falls.html", "strikes.csv", "strikes.yaml"} <= {p.name for p in output.iterdir()}


def test_the_verb_tells_what_a_strike_did_beyond_what_the_helmet_has(tmp_path):
    words = ["fall", "--speed", "40", "--scene", "wall", "--duration", "0.12"]
    done = CliRunner().invoke(main, [*words, "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    note = "more than the 44 mm that the liner has"
    assert "motorcycle, strike 1: the coupling spring was compressed" in done.output
    assert note in done.output and note in (tmp_path / "falls.html").read_text("utf-8")


def test_the_verb_says_no_head_contact_and_refuses_bad_input():
    done = CliRunner().invoke(main, ["fall", "pedestrian", "--duration", "0.1"])
    assert done.exit_code == 0 and "no head contact" in done.output
    refused = CliRunner().invoke(main, ["fall", "--speed", "500"])
    assert refused.exit_code == 2 and "must be a number from 0 to 40 m/s" in refused.output


def test_the_figure_shows_the_worst_strike_of_each_fall_that_has_one() -> None:
    pytest.importorskip("matplotlib", reason="the figure needs the extra 'report'")
    from helmet_sim_ros.report.figures.falls import falls_figure

    columns = {
        "strikes": [1, 0, 2], "peak_g": [120.0, None, 80.0],
        "strike_tangential_velocity": [4.0, None, 2.0],
        "strike_normal_velocity": [5.0, None, 3.0], "strike_angle_deg": [51.0, None, 56.0],
        "strike_azimuth_deg": [90.0, None, -45.0], "strike_elevation_deg": [10.0, None, 60.0],
    }  # fmt: skip
    figure = falls_figure(columns, "mine")
    speeds, angles, places, bar = figure.axes
    assert figure.get_suptitle() == "mine: worst head strike of 2 falls"
    (shown,) = speeds.collections
    assert shown.get_offsets().tolist() == [[4.0, 5.0], [2.0, 3.0]]
    assert shown.get_array().tolist() == [120.0, 80.0] and bar.get_ylabel() == "peak g"
    bins = {patch.get_x(): patch.get_height() for patch in angles.patches}
    assert bins == {10.0 * i: 2.0 * (i == 5) for i in range(9)}
    assert places.collections[0].get_offsets().tolist() == [[90.0, 10.0], [-45.0, 60.0]]
    # Seen from above the rider's left is to the left.
    ticks = dict(zip(places.get_xticks(), places.get_xticklabels(), strict=True))
    assert {at: text.get_text() for at, text in ticks.items()} == {
        180: "back", 90: "left", 0: "front", -90: "right", -180: "back",
    }  # fmt: skip
    assert places.get_xlim() == (180.0, -180.0) and places.get_ylim() == (-90.0, 90.0)
