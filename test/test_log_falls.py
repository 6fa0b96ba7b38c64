"""Falls in blocks and logs: samples that are not uniform, and what the head strikes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from click.testing import CliRunner
from logs import add_impact, session, simulated
from rclpy.serialization import serialize_message

from helmet_sim_ros import Fall, ImpactSetup, head_strikes, open_log, simulate
from helmet_sim_ros.biomech.record import DENSE, SHELL, same_samples, to_block
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import IncompleteError, LogError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.mcap_log.strikes import JudgedStrike
from helmet_sim_ros.model.arrows import point_of_attack
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.diagnostics import from_strikes
from helmet_sim_ros.nodes.evaluator_node import judged_strikes
from helmet_sim_ros.nodes.log_session import STRIKES_TOPIC, LogSession
from helmet_sim_ros.nodes.scene_markers import SceneMarkers
from helmet_sim_ros.nodes.slices import Slices, Thinning
from helmet_sim_ros.report.page.page import report_page
from helmet_sim_ros.report.replay.video import VideoOptions, frame_indices
from helmet_sim_ros.report.review.check import ReviewedFall, reviewed

#: A car strikes the helmet at once, and one that meets nothing.
STRUCK = Fall(preset="pedestrian", pitch_deg=170.0, height=1.2, duration=0.3, scene="car", x=0.3)
LOOSE = Fall(preset="pedestrian", height=1.4, duration=0.05)
DROP = ImpactSetup(rig="headform", duration=0.02)


def blocks_of(fall: Fall, stepwise: bool = False) -> list[Block]:
    slices = Slices(fall, "fall", 1.1, 1e-3)
    found = []
    while not slices.source.is_over:
        found.append(slices.next(stepwise))
    return found


def write(log: LogSession, fall: Fall, strikes: list[JudgedStrike], impact_id: str) -> None:
    start = 2.0 if impact_id == "struck" else 4.0
    for block in blocks_of(fall):
        own = replace(block, impact_id=impact_id, start_time=start)
        log.add(own, serialize_message(samples.to_message(own)))
    record = simulate(fall)
    log.end_impact(Assembled(impact_id, start, len(record), record))
    log.add_criteria(from_strikes(strikes, impact_id, log.end_ns, "digest"), STRIKES_TOPIC)


@pytest.fixture(scope="module")
def record():
    return simulate(STRUCK)


@pytest.fixture(scope="module")
def strikes(record):
    return judged_strikes(record)


@pytest.fixture(scope="module")
def path(tmp_path_factory, strikes) -> Path:
    """A log of a drop and two falls."""
    path = tmp_path_factory.mktemp("falls") / "falls.mcap"
    log = session(path)
    add_impact(log, simulated(DROP)[0], "drop", 1.1)
    write(log, STRUCK, strikes, "struck")
    write(log, LOOSE, [], "loose")
    log.close()
    return path


@pytest.mark.parametrize("stepwise", [False, True])
def test_blocks_of_a_fall_give_every_sample_bit_for_bit(record, stepwise):
    assembler, ended = Assembler(), []
    blocks = blocks_of(STRUCK, stepwise)
    for block in blocks:
        sent = samples.from_message(samples.to_message(block))
        assert sent.header() == block.header() and not sent.uniform
        ended += assembler.feed(sent)
    (fall,) = ended
    assert [block.total for block in blocks[:-1]] == [None] * (len(blocks) - 1)
    assert fall.total == blocks[-1].total == len(record)
    assert same_samples(fall.record, record)
    assert np.array_equal(fall.record.extras[SHELL], record.extras[SHELL])
    assert fall.record.extras[DENSE] == record.extras[DENSE]


def test_slices_in_slow_motion_follow_the_period_of_the_live_view():
    blocks = blocks_of(STRUCK, stepwise=True)
    ends = np.array([block.data[-1, 0] for block in blocks if len(block.data)])
    assert np.diff(ends).max() < 3.1e-3  # thin samples are 2 ms and a long step of 1 ms apart
    assert np.isclose(np.diff(ends), 1e-3).sum() > 20  # where the head strikes
    thinning = Thinning(1e-3)
    shown = [block.data[i, 0] for block in blocks for i in thinning.chosen(block.data[:, 0])]
    assert shown[0] == 0.0 and np.diff(shown).min() >= 1e-3 - 1e-8


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda b: b[:3] + b[4:], "sample 300 expected, 400 arrived"),
        (lambda b: [*b[:-1], replace(b[-1], extras={})], "nothing says where they are dense"),
        (lambda b: [*b[:-1], replace(b[-1], extras={DENSE: [[0, 100]]})], "are not 5e-05 s apart"),
        (lambda b: [*b[:-1], replace(b[-1], extras={DENSE: [[30, 9999]]})], "30 to 9999 of"),
        (lambda b: [*b[:-1], replace(b[-1], extras={DENSE: [[30, 90.5]]})], "pairs of integers"),
        (lambda b: [*b[:2], replace(b[2], uniform=True, total=5000)], "changed on the way"),
        (lambda b: [replace(b[0], total=500), *b[1:]], "changed on the way"),
        (lambda b: [b[0], replace(b[1], data=b[1].data[::-1]), *b[2:]], "time: must increase"),
    ],
)  # fmt: skip
def test_a_fall_with_a_gap_or_wrong_stretches_is_incomplete(damage, said):
    assembler = Assembler()
    ended = [done for block in damage(blocks_of(STRUCK)) for done in assembler.feed(block)]
    assert ended[0].record is None and said in ended[0].problem


@pytest.mark.parametrize("wrong", [{"uniform": 1}, {"uniform": True, "total": None}])
def test_only_a_fall_leaves_its_length_open(wrong):
    block = blocks_of(LOOSE)[0]
    header = json.loads(block.header()) | wrong
    with pytest.raises(IncompleteError, match=r"uniform|integers"):
        parse_block(json.dumps(header), ",".join(block.labels), block.data)


def test_a_log_gives_samples_and_strikes_of_a_fall_bit_for_bit(path, record, strikes):
    log = open_log(path)
    assert [impact.is_fall for impact in log] == [False, True, True]
    fall, loose = log["struck"], log["loose"]
    assert same_samples(fall.record, record) and fall.samples == len(record)
    assert fall.strikes == tuple(strikes) and loose.strikes == ()
    assert fall.logged is None and log["drop"].strikes is None
    again = head_strikes(fall.record)
    for found, told in zip(head_strikes(record), again, strict=True):
        assert found.evaluation == told.evaluation
        assert found.state.numbers() == told.state.numbers()
        assert found.setup() == told.setup()
    assert len(log.frame()) == 3


def test_a_fall_without_strikes_in_the_log_and_one_that_could_not_be_judged(tmp_path):
    from helmet_sim_ros.nodes.diagnostics import from_problem

    log = session(tmp_path / "silent.mcap")
    write(log, LOOSE, [], "loose")
    log.close()
    other = session(tmp_path / "failed.mcap")
    for block in blocks_of(LOOSE):
        other.add(block, serialize_message(samples.to_message(block)))
    record = simulate(LOOSE)
    other.end_impact(Assembled("fall", 1.1, len(record), record))
    other.add_criteria(from_problem("failed: no", "fall", other.end_ns), STRIKES_TOPIC)
    other.close()
    with pytest.raises(LogError, match="failed: no"):
        _ = open_log(tmp_path / "failed.mcap")["fall"].strikes
    (fall,) = reviewed(open_log(tmp_path / "failed.mcap"))
    assert isinstance(fall, ReviewedFall) and fall.check == "DIFFERS"


def test_review_compares_strikes_and_notices_a_wrong_one(path, tmp_path, record, strikes):
    result = CliRunner().invoke(main, ["review", str(path)])
    assert result.exit_code == 0, result.output
    assert "1 complete impact and 2 complete falls" in result.output
    assert "#2 pedestrian, 1.4 m/s, car: 1 head strike, same" in result.output
    assert "#3 pedestrian, 1.4 m/s, road: no head contact, same" in result.output
    assert "no head contact: #3" in result.output and "bumper" in result.output
    wrong = [replace(strikes[0], row=strikes[0].row | {"struck": "bonnet"}), *strikes[1:]]
    log = session(tmp_path / "wrong.mcap")
    write(log, STRUCK, wrong, "struck")
    log.close()
    result = CliRunner().invoke(main, ["review", str(tmp_path / "wrong.mcap")])
    assert result.exit_code == 1 and "strike 1 struck: logged 'bonnet'" in result.output
    told = json.loads(CliRunner().invoke(main, ["review", "--json", str(path)]).output)
    assert [len(fall["strikes"]) for fall in told["falls"]] == [len(strikes), 0]


def test_review_notices_a_criterion_of_a_strike_that_the_samples_do_not_give(tmp_path, strikes):
    data = strikes[0].evaluation.as_dict()
    data["criteria"]["peak_g"]["value"] *= 1.5
    wrong = [replace(strikes[0], evaluation=Evaluation.from_dict(data)), *strikes[1:]]
    log = session(tmp_path / "wrong.mcap")
    write(log, STRUCK, wrong, "struck")
    log.close()
    (fall,) = reviewed(open_log(tmp_path / "wrong.mcap"))
    assert isinstance(fall, ReviewedFall) and fall.check == "DIFFERS"
    differing = [[d.criterion for d in strike.differences] for strike in fall.strikes]
    assert differing == [["peak_g"], *[[]] * (len(strikes) - 1)]
    assert all(strike.has_logged for strike in fall.strikes)


def test_the_report_shows_falls_with_their_strikes(path, strikes):
    page = report_page([open_log(path)])
    assert "Head strikes of falls" in page and "no head contact, log check: same" in page
    assert page.count('<article id="impact-') == 1 + len(strikes)
    assert f"2 falls, {1 + len(strikes)} impacts or head strikes" in page
    assert 'data-replay="2"' in page


def test_export_writes_the_samples_and_a_table_of_strikes(path, tmp_path, record, strikes):
    result = CliRunner().invoke(main, ["export", str(path), "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    rows = (tmp_path / "falls_struck.csv").read_text().splitlines()
    assert rows[0].split(",") == record.labels
    table = np.loadtxt(rows[2:], delimiter=",")
    assert np.array_equal(table, to_block(record))
    lines = (tmp_path / "falls_strikes.csv").read_text().splitlines()
    assert len(lines) == 1 + len(strikes)
    result = CliRunner().invoke(main, ["export", str(path), "-f", "isomme", "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    channel = (tmp_path / "falls_struck" / "Channel" / "falls_struck.001").read_text()
    assert "Sampling interval           :4.99999" in channel or "5e-05" in channel
    for name, words in (
        ("falls_struck", ("Fall, pedestrian", "Simulated fall, rider", "the start of the fall")),
        ("falls_drop", ("Helmet impact, ", "Simulated impact, headform", "the first touch")),
    ):
        test = (tmp_path / name / f"{name}.mme").read_text()
        assert all(text in test for text in words)


def test_recover_saves_a_complete_fall(path, tmp_path, record):
    cut = tmp_path / "cut.mcap.part"
    cut.write_bytes(path.read_bytes()[:-2000])
    saved = recover(cut)
    assert saved.impacts == 3
    fall = open_log(saved.path)["struck"]
    assert same_samples(fall.record, record) and fall.strikes


def test_a_video_of_a_fall_keeps_time(record):
    indices = frame_indices(record, VideoOptions(slow=2.0, rate=25))
    times = record.time[indices]
    assert len(times) == 16 and np.diff(times) == pytest.approx(0.02, abs=2.6e-3)


def test_markers_show_the_car_where_it_is_and_forces_at_the_helmet(record):
    markers = SceneMarkers(STRUCK)
    struck = int(np.linalg.norm(record.ground_force, axis=1).argmax())
    time = float(record.time[struck])

    def bumper(index):
        shown = markers.message(record, index, 0).markers
        first = next(m for m in shown if m.ns == "surface")
        return np.array([first.pose.position.x, first.pose.position.y, first.pose.position.z])

    way = bumper(struck) - bumper(0)
    assert way[1] == pytest.approx(-(11.1 * time - 0.5 * 8.0 * time**2))
    point = point_of_attack(record, struck)
    assert np.linalg.norm(point - record.helmet_position[struck]) < 0.2
    force = record.ground_force[struck]
    off = record.ground_torque[struck] - np.cross(point, force)
    normal = force - record.ground_friction[struck]
    assert np.linalg.norm(np.cross(off, normal)) < 1e-6 * np.linalg.norm(force) ** 2
