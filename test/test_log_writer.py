"""Writing logs: definitions, names, and what happens when the disk does not play along."""

from __future__ import annotations

import resource
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.seal import unsealed
from helmet_sim_ros.mcap_log.writer import LogWriter

pytest.importorskip("rclpy", reason="message definitions come with ROS 2")

from helmet_sim_ros.mcap_log.schemas import message_definition, type_hash
from helmet_sim_ros.nodes.recorder_config import RecorderConfig, free_path

STRING = "std_msgs/msg/String"
TYPES = [
    "geometry_msgs/msg/AccelStamped", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState", "rosgraph_msgs/msg/Clock", "std_msgs/msg/Float64MultiArray",
    "visualization_msgs/msg/MarkerArray", "diagnostic_msgs/msg/DiagnosticArray",
]  # fmt: skip


@pytest.mark.parametrize("name", TYPES)
def test_a_definition_is_complete_and_hashes_to_the_published_type(name: str) -> None:
    text = message_definition(name)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, name))
    assert store.hash_rihs01(name) == type_hash(name) != ""
    used = [line for line in text.splitlines() if line.startswith("MSG: ")]
    assert len(used) == len(set(used)) == text.count("=" * 80)


def test_an_unknown_type_is_named() -> None:
    with pytest.raises(LogError, match="no_msgs/msg/Thing"):
        message_definition("no_msgs/msg/Thing")


def test_a_log_has_its_name_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = LogWriter(path)
    writer.add_channel("/words", STRING, "[]")
    writer.add_channel("/words", STRING, "[]")
    writer.write("/words", 5, b"\0\1\0\0\1\0\0\0\0")
    writer.add_metadata("run", {"a": "b"})
    writer.attach("note.txt", "text/plain", "hello", 5)
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    assert writer.close() == path
    assert list(tmp_path.iterdir()) == [path]
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert len(reader.get_summary().channels) == 1  # declared twice
        ((_, channel, message),) = reader.iter_messages()
        assert (channel.topic, message.log_time) == ("/words", 5)
        (run,) = reader.iter_metadata()
        assert unsealed("run", run.metadata) == {"a": "b", "library": "helmet_sim_ros"}
        assert [item.data for item in reader.iter_attachments()] == [b"hello"]


def test_rows_of_messages_are_written_as_messages_one_by_one_are(tmp_path: Path) -> None:
    """Byte for byte, statistics and indices included, also beside single messages."""
    times = np.arange(40, 90, 10)
    tables = {
        topic: np.random.default_rng(size).integers(0, 256, (len(times), size), dtype=np.uint8)
        for topic, size in (("/words", 9), ("/numbers", 24))
    }
    paths = [tmp_path / "rows.mcap", tmp_path / "single.mcap"]
    for path in paths:
        writer = LogWriter(path)
        for topic in tables:
            writer.add_channel(topic, STRING, "[]")
        writer.write("/words", 50, b"before")
        if path.stem == "rows":
            writer.write_rows(times[:3], {topic: rows[:3] for topic, rows in tables.items()})
            writer.flush()
            writer.write_rows(times[3:], {topic: rows[3:] for topic, rows in tables.items()})
        else:
            for i, time in enumerate(times.tolist()):
                for topic, rows in tables.items():
                    writer.write(topic, time, rows[i].tobytes())
                if i == 2:
                    writer.flush()
        writer.write("/numbers", 30, b"after")
        writer.close()
    rows, single = (path.read_bytes() for path in paths)
    assert rows == single
    with open(paths[0], "rb") as stream:
        messages = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(messages) == 2 + 2 * len(times)


def test_criteria_are_at_the_time_of_their_header(tmp_path: Path) -> None:
    """The end of the impact; FIRST_START and SPACING are those of the logs for tests."""
    from logs import FIRST_START, SPACING, write_log
    from mcap_ros2.decoder import DecoderFactory

    from helmet_sim_ros import ImpactSetup

    setup = ImpactSetup(rig="headform", duration=2e-3, time_step=1e-4)
    write_log(tmp_path / "a.mcap", [setup, setup])
    with open(tmp_path / "a.mcap", "rb") as stream:
        found = [
            (message.log_time, decoded.header.stamp)
            for _, _, message, decoded in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages("/evaluation/criteria")
        ]
    ends = [FIRST_START + number * SPACING + 2e-3 for number in range(2)]
    assert [time for time, _ in found] == [stamp.sec * 10**9 + stamp.nanosec for _, stamp in found]
    assert [time for time, _ in found] == pytest.approx([1e9 * end for end in ends], abs=1.0)


def test_an_existing_log_is_never_replaced(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap.part"):
        (tmp_path / name).write_text("precious")
        with pytest.raises(LogError, match=name):
            LogWriter(tmp_path / name.removesuffix(".part"))
        assert (tmp_path / name).read_text() == "precious"


def test_a_directory_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file or directory"):
        LogWriter(tmp_path / "missing" / "a.mcap")


def test_a_full_disk_is_told_and_leaves_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = LogWriter(path)
    writer.add_channel("/words", STRING, "[]")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(LogError, match=r"a\.mcap\.part: cannot be written: File too large"):
            for i in range(100):
                noise = "".join(chr(33 + (i * 7919 + j * j) % 90) for j in range(5000))
                writer.attach(f"{i}", "text/plain", noise, i)
                writer.flush()
        with pytest.raises(LogError):
            writer.close()
        writer.abandon()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not path.exists()
    assert 15_000 < (tmp_path / "a.mcap.part").stat().st_size <= 20_000


def test_names_are_free_and_say_what_is_inside(tmp_path: Path) -> None:
    noon = datetime(2026, 1, 2, 12, tzinfo=UTC)
    named = RecorderConfig(output_dir=str(tmp_path), file_name="drop.mcap")
    assert free_path(named).name == "drop.mcap"
    (tmp_path / "drop.mcap").touch()
    (tmp_path / "drop_2.mcap.part").touch()
    assert free_path(named).name == "drop_3.mcap"
    free = RecorderConfig(output_dir=str(tmp_path), scenario_name="a/b c")
    assert free_path(free, noon) == tmp_path / "a_b_c_20260102T120000Z.mcap"
