"""The verb review: table, comparison with what was logged, exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
import zlib

import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from click.testing import CliRunner
from logs import add_impact, blocks, session, simulated, write_bag, write_log
from mcap.reader import make_reader
from rclpy.serialization import serialize_message

from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.cli import main
from helmet_sim_ros.mcap_log.blocks import Assembled
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.diagnostics import from_evaluation, from_problem
from helmet_sim_ros.report.review.check import evaluation_differences, review
from helmet_sim_ros.report.review.summary import common, label, labels, varying

SETUPS = [
    ImpactSetup(duration=0.015, normal_velocity=5.0, tangential_velocity=5.0),
    ImpactSetup(duration=0.015, normal_velocity=9.5, direction="front"),
]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "two.mcap"
    write_log(path, SETUPS)
    return path


def test_a_sound_log_is_shown_with_setup_versions_and_model(path):
    answer = run("review", path)
    assert answer.exit_code == 0, answer.output
    log = open_log(path)
    peaks = [f"{impact.evaluate().peak_g.value:.0f}" for impact in log]
    for words in ("2 complete impacts", "mujoco ", "impact.friction = 0.4", "fullface", *peaks,
                  *(impact.model_hash for impact in log)):  # fmt: skip
        assert words in answer.output
    assert answer.output.count("same") == 2
    assert "DIFFERS" not in answer.output


def test_a_note_says_of_which_impact_it_is(tmp_path):
    write_log(tmp_path / "a.mcap", [ImpactSetup(rig="headform", duration=d) for d in (0.02, 0.001)])
    lines = run("review", tmp_path / "a.mcap").output.splitlines()
    (note,) = [line for line in lines if "ends while" in line]
    assert note.startswith("note: ") and note.endswith(" (#2)")


@pytest.mark.parametrize("width", ["40", "80"])
def test_a_narrow_terminal_leaves_no_digit_out(path, width):
    for words in (["review", "--all-criteria"], ["compare", str(path)]):
        answer = CliRunner().invoke(main, [*words, str(path)], env={"COLUMNS": width})
        assert answer.exit_code == 0 and "\N{HORIZONTAL ELLIPSIS}" not in answer.output
        for impact in open_log(path):
            assert f"{impact.evaluate().hic.value:.5g}" in answer.output


def test_json_and_all_criteria_and_setup(path):
    answer = run("review", path, "--json")
    data = json.loads(answer.output)
    log = open_log(path)
    for shown, impact in zip(data["impacts"], log, strict=True):
        assert shown["evaluation"] == impact.logged.as_dict()
        assert shown["setup"] == impact.setup
        assert shown["differences"] == [] and shown["criteria_logged"]
    answer = run("review", path, "--all-criteria", "--setup")
    assert "ubric" in answer.output and "helmet.liner.density = " in answer.output


def test_a_criterion_that_was_logged_otherwise_is_an_error(tmp_path):
    impact, record = simulated(SETUPS[0])
    log = session(tmp_path / "a.mcap")
    for block in blocks(impact, "one", 1.1):
        log.add(block, serialize_message(samples.to_message(block)))
    log.end_impact(Assembled("one", 1.1, impact.total, record))
    message = from_evaluation(evaluate(record), "one", log.end_ns)
    status = next(s for s in message.status if s.name == "peak_g")
    value = next(pair for pair in status.values if pair.key == "value")
    value.value = json.dumps(json.loads(value.value) * (1.0 + 1e-6))
    log.add_criteria(message)
    answer = run("review", log.close())
    assert answer.exit_code == 1
    assert "DIFFERS" in answer.output and "peak_g: logged" in answer.output


def test_not_evaluated_and_not_logged_are_told_apart(tmp_path):
    impact, record = simulated(SETUPS[0])
    log = session(tmp_path / "a.mcap")
    add_impact(log, impact, "silent", 1.1, judged=False)
    add_impact(log, impact, "broken", 1.2, judged=False)
    log.add_criteria(from_problem("the evaluator was too late", "broken", log.end_ns))
    answer = run("review", log.close())
    assert answer.exit_code == 1
    assert "not logged" in answer.output
    assert "the evaluator was too late" in answer.output
    first = review(open_log(tmp_path / "a.mcap")["silent"])
    assert first.check == "not logged" and first.evaluation == evaluate(record)


def test_a_changed_model_is_an_error(path, tmp_path):
    changed = tmp_path / "changed.mcap"  # attachments are not compressed
    changed.write_bytes(path.read_bytes().replace(b"<mujoco", b"<Mujoco"))
    answer = run("review", changed)
    assert answer.exit_code == 1
    assert "checksum of the attachment" in answer.output
    assert all(i.model == j.model for i, j in zip(open_log(changed), open_log(path), strict=True))


def test_another_model_under_the_same_name_is_an_error(path, tmp_path):
    """Changed on purpose: the checksum is right, the hash in the name is not."""
    changed = tmp_path / "changed.mcap"
    data = path.read_bytes()
    with open(path, "rb") as stream:
        index, *_ = make_reader(stream).get_summary().attachment_indexes
    begin, end = index.offset + 9, index.offset + index.length - 4
    content = data[begin:end].replace(b"<mujoco", b"<Mujoco")
    crc = zlib.crc32(content).to_bytes(4, "little")
    changed.write_bytes(data[:begin] + content + crc + data[end + 4 :])
    answer = run("review", changed)
    assert answer.exit_code == 1
    assert "was changed" in answer.output


def test_differences_name_value_window_limit_and_verdict():
    _, record = simulated(SETUPS[0])
    good = evaluate(record)
    data = good.as_dict()
    data["criteria"]["hic"] |= {"window": [0.0, 0.1], "limit": 1.0, "verdict": "fail"}
    data["criteria"]["no_such"] = dict(data["criteria"]["gsi"], name="no_such")
    found = list(evaluation_differences(type(good).from_dict(data), good))
    assert {(d.criterion, d.field) for d in found} == {
        ("hic", "window"), ("hic", "limit"), ("hic", "verdict"), ("no_such", "value"),
        ("evaluation", "verdict"),
    }  # fmt: skip
    assert not list(evaluation_differences(good, evaluate(record)))


def test_what_another_processor_rounds_otherwise_is_no_difference():
    _, record = simulated(SETUPS[0])
    good = evaluate(record)
    for change, found in ((0.95e-9, []), (1.05e-9, ["peak_g"])):
        data = good.as_dict()
        data["criteria"]["peak_g"]["value"] *= 1.0 + change
        rounded = type(good).from_dict(data)
        assert [d.criterion for d in evaluation_differences(rounded, good)] == found


@pytest.mark.parametrize(
    ("setup", "words"),
    [
        ({"impact.direction": "left", "impact.normal_velocity": 5.0}, "left, 5 m/s"),
        ({"impact.direction": "left", "impact.normal_velocity": 5.0,
          "impact.tangential_velocity": 10.0}, "left, 5 m/s, 10 m/s along the ground"),
        ({"impact.direction": "top", "impact.normal_velocity": 5.5, "impact.surface": "kerb",
          "impact.tangential_velocity": 0.5}, "top, 5.5 m/s, 0.5 m/s along the surface"),
        ({"impact.direction": "top", "impact.normal_velocity": 5,
          "impact.tangential_velocity": 0.0}, "top, 5 m/s"),
        ({"fall.preset": "motorcycle", "fall.speed": 10.0, "fall.scene": "road"},
         "motorcycle, 10 m/s, road"),
        ({}, "impact"),
    ],
)  # fmt: skip
def test_an_impact_is_called_by_direction_and_speeds(setup, words):
    assert label(setup) == words


def test_impacts_are_told_apart_by_up_to_four_values_that_differ():
    one = {"impact.direction": "left", "impact.normal_velocity": 5.0, "helmet.mass": 1.25,
           "helmet.description": "mine", "rider.mass": 70.0, "impact.friction": 0.4,
           "rider.height": 1.7, "sim.duration": 0.03}  # fmt: skip
    two = one | {"helmet.mass": 1.5, "rider.mass": 80.0, "impact.friction": 0.5,
                 "helmet.description": "yours"}  # fmt: skip
    three = two | {"rider.height": 1.8, "sim.duration": 0.04}
    assert labels([one, two]) == [
        "left, 5 m/s; helmet mass 1.25; rider mass 70; friction 0.4",
        "left, 5 m/s; helmet mass 1.5; rider mass 80; friction 0.5",
    ]
    assert labels([one, three], speeds=False)[1] == (
        "left; helmet mass 1.5; rider mass 80; friction 0.5; height 1.8"
    )
    assert labels([one, dict(one)]) == ["left, 5 m/s"] * 2


def test_impacts_share_what_does_not_vary():
    one = {"impact.direction": "left", "helmet.name": "a", "impact.friction": 0.4,
           "impact.state": [1.0]}  # fmt: skip
    two = one | {"helmet.name": "b", "impact.state": [2.0]}
    three = one | {"impact.friction": 0.5}
    assert varying([one, two, three]) == ["helmet.name", "impact.friction"]
    assert varying([one, dict(one)]) == [] == varying([one])
    assert common([one, two]) == {"impact.direction": "left", "impact.friction": 0.4}
    assert common([one, dict(one)]) == one
    assert common([]) == {}


def test_a_bad_log_does_not_keep_the_others_from_being_shown(path, tmp_path):
    write_bag(tmp_path / "bag", SETUPS[:1])
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(path.read_bytes()[:1000])
    (tmp_path / "empty_folder").mkdir()
    answer = run("review", bad, path, tmp_path / "empty_folder", tmp_path / "bag")
    assert answer.exit_code == 2
    assert "2 complete impacts" in answer.output and "1 complete impact\n" in answer.output
    assert "helmet-sim recover" in answer.stderr and "no .mcap file" in answer.stderr
    assert "Traceback" not in answer.output + answer.stderr


def test_other_standards_and_unknown_ones(path):
    answer = run("review", path, "--standard", "en_1078")
    assert answer.exit_code == 0, answer.output
    answer = run("review", path, "--standard", "nobody")
    assert answer.exit_code == 2 and "standard" in answer.stderr


def test_reading_and_reviewing_need_no_ros(path):
    """In an interpreter in which no ROS package can be imported."""
    code = (
        "import sys, importlib.abc\n"
        "class NoRos(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in ('rclpy', 'std_msgs', 'rosidl_runtime_py') or "
        "name.split('.')[0].endswith(('_msgs', '_interfaces')):\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, NoRos())\n"
        "from helmet_sim_ros.cli import main\n"
        "main(['review', sys.argv[1]])\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("same") == 2


def test_samples_of_the_log_are_those_of_the_simulation(path):
    for impact, setup in zip(open_log(path), SETUPS, strict=True):
        assert same_samples(impact.record, simulated(setup)[1])
