"""Recovery: whatever instant the recorder is killed at, every finished impact is saved."""

from __future__ import annotations

import json
import os
import random
import signal
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from click.testing import CliRunner
from logs import add_impact, session, simulated, write_bag, write_log
from mcap.reader import make_reader

from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.layout import IMPACT, RUN
from helmet_sim_ros.mcap_log.recover import recover, recovered_path

#: The whole proof is 100 kills: HELMET_SIM_KILLS=100 python -m pytest test/test_recover.py
KILLS = int(os.environ.get("HELMET_SIM_KILLS", "12"))
SETUPS = [
    ImpactSetup(duration=0.01, normal_velocity=4.0, tangential_velocity=3.0),
    ImpactSetup(duration=0.012, normal_velocity=6.0, direction="back"),
    ImpactSetup(duration=0.01, normal_velocity=3.0, direction="top"),
]

#: Several chunks per impact.
LONG = {"duration": 0.02, "time_step": 2e-5}


def test_killed_at_random_instants_every_finished_impact_is_saved(tmp_path):
    """A process writes impact after impact, tells of each that is done, and gets SIGKILL."""
    impact, truth = simulated(SETUPS[0])
    rng = random.Random(2026)
    saved = cut = 0
    for kill in range(KILLS):
        path = tmp_path / f"{kill}.mcap"
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            log = session(path)
            for number in range(10_000):
                add_impact(log, impact, f"i{number}", 1.0 + 0.1 * number)
                os.write(writer, b"x")
        os.close(writer)
        with open(reader, "rb") as pipe:
            told = len(pipe.read(rng.randrange(5)))
            time.sleep(rng.uniform(0.0, 0.2))
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            told += len(pipe.read())
        part = path.with_name(path.name + ".part")
        assert not path.exists()
        before = part.read_bytes() if part.exists() else b""
        try:
            result = recover(part)
        except LogError:
            assert told == 0
            continue
        log = open_log(result.path)
        assert [i.impact_id for i in log] == [f"i{k}" for k in range(len(log))]
        assert result.impacts == len(log) >= told
        assert not log.problems
        for one in log:
            assert same_samples(one.record, truth)
            assert one.setup == truth.setup and one.model == impact.model_xml()
        assert all(log[k].logged == evaluate(truth) for k in range(told))
        assert part.read_bytes() == before
        saved += len(log)
        cut += bool(result.lost)
    assert saved > KILLS and cut > 0


def test_every_cut_of_a_file_keeps_what_is_complete(tmp_path):
    """Cut between any two bytes around what the recorder writes when an impact ends."""
    path = tmp_path / "whole.mcap"
    records = write_log(path, [setup.replaced(LONG) for setup in SETUPS[:2]])
    data = path.read_bytes()
    impacts = open_log(path)
    notes = [entry.offset for entry in impacts._source.metadata_index if "impact/" in entry.name]
    with open(path, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    chunk_ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks]
    ends = [max(end for end in chunk_ends if end <= note) for note in notes]
    cuts = {end + d for end in (*ends, *notes) for d in (-1, 0, 400)}
    part = tmp_path / "cut.mcap.part"
    for cut in sorted(cuts | set(range(0, len(data), len(data) // 6))):
        part.write_bytes(data[:cut])
        complete = sum(cut >= end for end in ends)
        target = recovered_path(part)
        target.unlink(missing_ok=True)
        if complete == 0:
            with pytest.raises(LogError, match=r"nothing to recover|empty|not an MCAP"):
                recover(part)
            assert not target.exists()
            continue
        result = recover(part)
        log = open_log(target)
        assert len(log) == result.impacts == complete
        assert all(same_samples(i.record, r) for i, r in zip(log, records, strict=False))
        assert all(i.setup == r.setup and i.model for i, r in zip(log, records, strict=False))
        with open(target, "rb") as stream:
            written = sum(1 for _ in make_reader(stream).iter_messages("/head/acceleration"))
        assert written == sum(len(record) for record in records[:complete])
        assert result.lost and json.loads(log.metadata["recovered"]["lost"]) == list(result.lost)


def test_damage_in_the_middle_costs_only_the_impact_that_it_hits(tmp_path):
    path = tmp_path / "a.mcap"
    records = write_log(path, SETUPS)
    log = open_log(path)
    middle = sum(entry.offset for entry in log._source.metadata_index[1:3]) // 2
    data = bytearray(path.read_bytes())
    data[middle] ^= 0x55
    path.write_bytes(data)
    result = recover(path)
    assert result.path.name == "a_recovered.mcap"
    saved = open_log(result.path)
    assert [i.impact_id for i in saved] == ["test-0", "test-2"]
    assert same_samples(saved[1].record, records[2]) and saved[1].logged == evaluate(records[2])
    assert any("test-1" in text for text in result.lost)
    assert any("damaged" in text for text in saved.problems)


def test_a_bag_that_was_cut_off_is_recovered_too(tmp_path):
    records = write_bag(tmp_path / "bag", [setup.replaced(LONG) for setup in SETUPS])
    (file,) = (tmp_path / "bag").glob("*.mcap")
    data = file.read_bytes()
    file.write_bytes(data[: int(0.75 * len(data))])
    log = open_log(recover(file).path)
    assert 1 <= len(log) < 3
    assert all(same_samples(i.record, r) for i, r in zip(log, records, strict=False))
    assert set(log.metadata) == {"recovered"}  # a bag has none for its impacts, and gets none


def test_what_cannot_be_recovered_is_told_and_nothing_is_replaced(tmp_path):
    path = tmp_path / "a.mcap"
    write_log(path, SETUPS[:1])
    part = tmp_path / "b.mcap.part"
    part.write_bytes(path.read_bytes()[:-50])
    (tmp_path / "b.mcap").write_text("precious")
    (tmp_path / "text.part").write_text("not a log at all")
    answer = CliRunner().invoke(
        main, ["recover", str(path), str(part), str(tmp_path / "text.part"), str(tmp_path / "no")]
    )
    assert answer.exit_code == 2
    for words in ("nothing to recover", "exists already", "not an MCAP file", "No such file"):
        assert words in answer.stderr
    assert (tmp_path / "b.mcap").read_text() == "precious"
    answer = CliRunner().invoke(main, ["recover", str(part), "-o", str(tmp_path / "c.mcap")])
    assert answer.exit_code == 0, answer.output
    assert "1 complete impact" in answer.output and "lost: the index" in answer.output
    assert len(open_log(tmp_path / "c.mcap")) == 1
    assert not list(Path(tmp_path).glob("*.recovering"))


def test_metadata_that_are_gone_are_told_by_their_name(tmp_path):
    path = tmp_path / "log.mcap"
    write_log(path, SETUPS[:1])
    with path.open("rb") as stream:
        (index,) = (i for i in make_reader(stream).get_summary().metadata_indexes if i.name == RUN)
    damaged = bytearray(path.read_bytes())
    damaged[index.offset + index.length // 2] ^= 0xFF
    path.with_name("log.mcap.part").write_bytes(damaged)
    path.unlink()
    lost = recover(path.with_name("log.mcap.part")).lost
    assert f"metadata {RUN}" in lost
    assert not [text for text in lost if text.startswith("impact")]


def test_an_impact_whose_metadata_alone_are_damaged_is_no_damaged_impact(tmp_path):
    """Of impacts without metadata, those are told whose samples are gone, and no others."""
    path = tmp_path / "log.mcap"
    write_log(path, SETUPS)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    notes = {index.name: index for index in summary.metadata_indexes}
    first, second = (notes[f"{IMPACT}test-{number}"] for number in (0, 1))
    damaged = bytearray(path.read_bytes())
    for place in (
        first.offset + first.length // 2,
        second.offset + second.length // 2,
        (first.offset + second.offset) // 2,
    ):  # the last: samples of the second
        damaged[place] ^= 0xFF
    path.with_name("log.mcap.part").write_bytes(damaged)
    path.unlink()
    result = recover(path.with_name("log.mcap.part"))
    assert [impact.impact_id for impact in open_log(result.path)] == ["test-0", "test-2"]
    assert "impact test-1: it is damaged" in result.lost
    assert not [text for text in result.lost if text.startswith("impact test-0")]
