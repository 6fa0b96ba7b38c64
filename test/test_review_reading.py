"""Reading logs back: lazily, exactly, and every way in which a file can be bad."""

from __future__ import annotations

import random
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from logs import add_impact, blocks, session, simulated, write_bag, write_log
from mcap.reader import make_reader
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import IndexType, Writer
from rclpy.serialization import serialize_message

from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.blocks import Assembled
from helmet_sim_ros.mcap_log.criteria import digest_of
from helmet_sim_ros.mcap_log.layout import FORMAT_VERSION
from helmet_sim_ros.mcap_log.seal import sealed
from helmet_sim_ros.nodes import samples

SETUPS = [
    ImpactSetup(duration=0.02, normal_velocity=5.0, tangential_velocity=5.0),
    ImpactSetup(duration=0.015, direction="front", normal_velocity=3.0, rig="headform"),
    ImpactSetup(duration=0.02, normal_velocity=7.5, overrides={"helmet.coupling": "foam"}),
]
#: What a writer may leave out.
BARE = ("use_statistics", "repeat_channels", "repeat_schemas", "use_summary_offsets")


@pytest.fixture(scope="module")
def log_and_records(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "three.mcap"
    return path, write_log(path, SETUPS)


@pytest.fixture
def path(log_and_records):
    return log_and_records[0]


def test_every_sample_setup_and_result_reads_back_exactly(log_and_records):
    path, records = log_and_records
    log = open_log(path)
    assert [impact.impact_id for impact in log] == ["test-0", "test-1", "test-2"]
    for impact, record in zip(log, records, strict=True):
        assert same_samples(impact.record, record)
        assert impact.setup == impact.record.setup == record.setup
        assert impact.logged == impact.evaluate() == evaluate(record)
        assert impact.evaluation is impact.logged
        assert impact.samples == len(record)
        assert "<mujoco" in impact.model and not impact.model_problem
    crush = log["test-2"].record.extras["residual_crush"]
    assert np.array_equal(crush, records[2].extras["residual_crush"]) and crush.max() > 0.0
    assert log.run["format"] == str(FORMAT_VERSION) and log.run["scenario"] == "test"
    assert not log.problems and not log.warnings
    with pytest.raises(KeyError):
        log["nobody"]


def test_opening_reads_no_samples(log_and_records, tmp_path):
    """Damage in one impact's samples is met when that impact is read, and by nobody else."""
    path, records = log_and_records
    with open(path, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    data = bytearray(path.read_bytes())
    data[chunks[0].chunk_start_offset + 200] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    log = open_log(damaged)
    assert len(log) == 3
    assert same_samples(log[1].record, records[1])
    with pytest.raises(LogError, match="damaged"):
        _ = log[0].record


def test_pandas_tables_hold_samples_results_and_units(log_and_records):
    pytest.importorskip("pandas")
    path, records = log_and_records
    log = open_log(path)
    frame = log[0].frame()
    assert np.array_equal(frame["ground_force.z"], records[0].ground_force[:, 2])
    assert np.array_equal(frame.index, records[0].time)
    assert frame.attrs["units"]["head_acceleration.x"] == "m/s^2"
    assert frame.attrs["units"]["joint_position.neck_axial"] == "m"
    results = log.frame()
    assert list(results["impact_id"]) == ["test-0", "test-1", "test-2"]
    assert list(results["peak_g"]) == [evaluate(r).peak_g.value for r in records]
    assert list(results["impact.direction"]) == ["left", "front", "left"]


@pytest.mark.parametrize("namespace", ["", "/lab/rig_1"])
def test_a_bag_of_ros2_bag_record_reads_the_same(tmp_path, namespace):
    records = write_bag(tmp_path / "bag", SETUPS[:2], namespace=namespace)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    log = open_log(file)
    for impact, record in zip(log, records, strict=True):
        assert same_samples(impact.record, record)
        assert impact.logged == evaluate(record)
        assert impact.setup == record.setup and "<mujoco" in impact.model
    assert log.run.get("format") is None


def test_a_file_without_index_or_chunks_reads_the_same(log_and_records, tmp_path):
    path, records = log_and_records
    for chunked in (True, False):
        target = tmp_path / f"plain_{chunked}.mcap"
        bare = dict.fromkeys(BARE, False) | {"index_types": IndexType.NONE}
        _rewrite(path, target, use_chunking=chunked, **bare)
        log = open_log(target)
        assert [same_samples(i.record, r) for i, r in zip(log, records, strict=True)] == [True] * 3
        assert log[1].logged == evaluate(records[1])


def test_an_incomplete_impact_is_named_and_the_others_are_read(tmp_path):
    first, _ = simulated(SETUPS[0])
    second, _ = simulated(SETUPS[1])
    log = session(tmp_path / "a.mcap")
    for block in list(blocks(first, "cut", 1.1))[:-1]:
        log.add(block, serialize_message(samples.to_message(block)))
    log.end_impact(Assembled("cut", 1.1, first.total, None, "incomplete: the plug was pulled"))
    for block in blocks(second, "whole", 1.2):
        log.add(block, serialize_message(samples.to_message(block)))
    log.end_impact(Assembled("whole", 1.2, second.total, second.record()))
    opened = open_log(log.close())
    assert [impact.impact_id for impact in opened] == ["whole"]
    assert opened.problems == ("incomplete: the plug was pulled",)
    assert opened[0].logged is None
    assert opened[0].evaluation == evaluate(second.record())
    assert opened.setup("cut")["impact.direction"] == "left"


def test_time_that_runs_backwards_is_told(tmp_path):
    log = session(tmp_path / "a.mcap")
    impact, _ = simulated(SETUPS[1])
    add_impact(log, impact, "late", 9.0)
    add_impact(log, impact, "early", 1.0)
    opened = open_log(log.close())
    assert len(opened) == 2
    assert "more than one simulation" in opened.warnings[0]


# bad files

WALL = 1_700_000_000_000_000_000  # ns, a time of day


def _rewrite(source: Path, target: Path, change=lambda kind, record: record, **options) -> None:
    """Copy a log record by record; ``change`` may alter a record, or drop it by returning None."""
    options.setdefault("index_types", IndexType.ALL)
    with open(source, "rb") as stream, open(target, "wb") as output:
        writer = Writer(output, **options)
        ids: dict[int, int] = {0: 0}
        channels: dict[int, int] = {}
        for record in StreamReader(stream).records:
            kind = type(record)
            if kind.__name__ == "DataEnd":
                break
            record = change(kind.__name__, record)
            if record is None:
                continue
            if kind is Header:
                writer.start(record.profile, record.library)
            elif kind is Schema and record.id not in ids:
                ids[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif kind is Channel and record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, ids.get(record.schema_id, 0),
                    record.metadata,
                )  # fmt: skip
            elif kind is Message:
                writer.add_message(
                    channels[record.channel_id], record.log_time, record.data, record.publish_time
                )
            elif kind is Metadata:
                writer.flush()
                writer.add_metadata(record.name, sealed(record.name, record.metadata))
        writer.finish()


def _changed(**fields):
    def change(kind, record):
        for key, value in fields.items():
            wanted, name = key.split("__")
            if kind == wanted:
                setattr(record, name, value(record))
        return record

    return change


def test_what_is_no_log_is_told_in_a_sentence(path, tmp_path):
    good = path.read_bytes()
    files = {
        "empty": (b"", "is empty"),
        "text": (b"time,ax\n0,1\n" * 10, "not an MCAP file"),
        "sqlite": (b"SQLite format 3\0" + bytes(100), "convert"),
        "newer_mcap": (good.replace(b"\x89MCAP0", b"\x89MCAP1"), "MCAP version"),
        "truncated": (good[: len(good) // 2], "helmet-sim recover"),
        "headless": (good[:8], "helmet-sim recover"),
        "garbage": (good[:8] + random.Random(1).randbytes(5000) + good[-8:], "damaged"),
    }
    for name, (content, words) in files.items():
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises(LogError, match=words) as error:
            open_log(file)
        assert str(file) in str(error.value)
    with pytest.raises(LogError, match="No such file"):
        open_log(tmp_path / "missing.mcap")
    with pytest.raises(LogError, match="directory"):
        open_log(tmp_path)


def test_foreign_contents_are_told_in_a_sentence(path, tmp_path):
    cases = {
        "foreign": (_changed(Channel__topic=lambda r: r.topic.replace("impact", "other")),
                    "no topic /impact/samples; topics in it: "),
        "type": (_changed(Schema__name=lambda r: r.name.replace("Float64Multi", "Float32Multi")),
                 "Float32MultiArray, expected std_msgs/msg/Float64MultiArray"),
        "schema": (_changed(Channel__schema_id=lambda r: 0), "schema\\) is missing"),
        "encoding": (_changed(Channel__message_encoding=lambda r: "json"), "expected ros2msg"),
        "definition": (_changed(Schema__data=lambda r: b"}{"), "cannot be understood"),
        "newer": (_changed(Metadata__metadata=lambda r: r.metadata | {"format": "4"}
                           if r.name == "run" else r.metadata), "log format 4"),
        "note": (_changed(Metadata__metadata=lambda r: {"start_time": "soon"}
                          if r.name != "run" else r.metadata), "metadata impact/test-0: damaged"),
        "clocks": (_changed(Message__log_time=lambda r: r.log_time + WALL * (r.channel_id == 3)),
                   "mixed clocks"),
    }  # fmt: skip
    for name, (change, words) in cases.items():
        target = tmp_path / f"{name}.mcap"
        _rewrite(path, target, change)
        with pytest.raises(LogError, match=words):
            open_log(target)


def test_a_log_without_samples_is_told(path, tmp_path):
    def change(kind, record):
        if kind == "Message" or (kind == "Metadata" and record.name != "run"):
            return None
        return record

    _rewrite(path, tmp_path / "none.mcap", change)
    with pytest.raises(LogError, match="no samples of impacts"):
        open_log(tmp_path / "none.mcap")


def test_a_metadata_record_that_lies_is_found_out(path, tmp_path):
    def change(kind, record):
        if kind == "Metadata" and record.name != "run":
            record.name = "impact/somebody-else"
        return record

    _rewrite(path, tmp_path / "lie.mcap", change)
    log = open_log(tmp_path / "lie.mcap")
    with pytest.raises(LogError, match="somebody-else: no samples"):
        _ = log[0].record


@pytest.mark.parametrize(
    ("name", "value"),
    [("start_time", "-1.0"), ("start_time", "2147483648.0"), ("start_time", "nan"),
     ("samples", "-1"), ("samples", "100000001")],
)  # fmt: skip
def test_a_start_or_a_length_that_no_impact_has_is_damage(path, tmp_path, name, value):
    def change(kind, record):
        if kind == "Metadata" and record.name != "run":
            record.metadata = sealed(record.name, record.metadata | {name: value})
        return record

    _rewrite(path, tmp_path / "odd.mcap", change)
    with pytest.raises(LogError, match=r"damaged.*out of range"):
        open_log(tmp_path / "odd.mcap")


def test_random_damage_never_raises_anything_else(path, tmp_path):
    """Whatever byte flips: a LogError, or the true samples."""
    truth = {i.impact_id: i.record for i in open_log(path)}
    good = path.read_bytes()
    rng = random.Random(20)
    file = tmp_path / "bad.mcap"
    refused = 0
    for _ in range(60):
        data = bytearray(good)
        # Index and metadata stand at the end; half of the damage goes there.
        low = rng.choice([0, len(data) - 12_000])
        for _ in range(rng.choice([1, 3])):
            data[rng.randrange(low, len(data))] = rng.randrange(256)
        file.write_bytes(data[: rng.choice([len(data)] * 4 + [rng.randrange(len(data))])])
        try:
            for impact in open_log(file):
                record = impact.record
                if impact.impact_id in truth:
                    assert same_samples(record, truth[impact.impact_id])
                _ = impact.setup, impact.logged
        except LogError:
            refused += 1
    assert refused > 10


def test_blocks_that_contradict_themselves_are_told(tmp_path, path):
    def change(kind, record):
        if kind == "Message" and b'"first": 100' in record.data[:400]:
            record.data = record.data.replace(b'"first": 100', b'"first": 1e5')
        return None if kind == "Metadata" and record.name != "run" else record

    _rewrite(path, tmp_path / "a.mcap", change)
    with pytest.raises(LogError, match="not a block of samples"):
        open_log(tmp_path / "a.mcap")


def test_criteria_tell_the_digest_of_the_setup_that_was_judged():
    def pair(key, value):
        return SimpleNamespace(key=key, value=value)

    def array(*pairs):
        return SimpleNamespace(status=[SimpleNamespace(values=list(pairs))])

    assert digest_of(array(pair("value", "68.0"), pair("setup_digest", "0a1b"))) == "0a1b"
    assert digest_of(array(pair("value", "68.0"))) == ""
    assert digest_of(SimpleNamespace(status=[])) == ""
