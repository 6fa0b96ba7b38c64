"""The recorder as a process: what it writes, read by readers that are not ours."""

from __future__ import annotations

import json
import resource
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from node_processes import Rig
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord, same_samples
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.nodes.diagnostics import to_evaluation
from helmet_sim_ros.nodes.setup_parameters import parameter_values

SETUP = ImpactSetup(duration=0.01, direction="front", tangential_velocity=4.0)
SCENARIO = "common: {impact.direction: front}\n"
PER_SAMPLE = {
    "/head/acceleration": "geometry_msgs/msg/AccelStamped",
    "/head/velocity": "geometry_msgs/msg/TwistStamped",
    "/head/pose": "geometry_msgs/msg/PoseStamped",
    "/head/imu": "sensor_msgs/msg/Imu",
    "/helmet/pose": "geometry_msgs/msg/PoseStamped",
    "/helmet/ground_contact": "geometry_msgs/msg/WrenchStamped",
    "/helmet/coupling": "geometry_msgs/msg/WrenchStamped",
    "/neck/load": "geometry_msgs/msg/WrenchStamped",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/clock": "rosgraph_msgs/msg/Clock",
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("nodes"), ["simulation", "evaluator"]) as running:
        values = parameter_values(SETUP)
        assert running.set(**values) == ""
        yield running


def readers(rig: Rig, count: int) -> None:
    rig.until(lambda: rig.status["simulation"]["readers"] == str(count))


@pytest.fixture
def recorder(rig: Rig, tmp_path: Path) -> Iterator[Path]:
    """A recorder of its own for this test; its output directory."""
    rig.status.pop("recorder", None)
    rig.start("recorder", output_dir=tmp_path / "logs")
    readers(rig, 2)
    yield tmp_path / "logs"
    killed = "recorder" in rig.killed
    if "recorder" in rig.processes:
        assert rig.stop("recorder") == 0
    rig.call("simulation/reset")
    assert rig.set(sim__real_time_factor=0.0) == ""
    if not killed:
        readers(rig, 1)


def finish(rig: Rig) -> Path:
    answer = rig.call("recorder/finish")
    assert answer.success, answer.message
    return Path(json.loads(answer.message)["path"])


def begin_slow_impact(rig: Rig) -> None:
    """Have an impact under way that will not end by itself."""
    assert rig.set(sim__real_time_factor=1e-3) == ""
    rig.ask("simulation/run_impact")
    rig.until(lambda: rig.status["simulation"]["message"] == "running")


@pytest.fixture(scope="module")
def log(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    """A log of two impacts and what the simulation said of them."""
    folder = tmp_path_factory.mktemp("log")
    rig.start("recorder", output_dir=folder)
    readers(rig, 2)
    rig.until(lambda: "recorder" in rig.status)
    assert rig.set("recorder", scenario_name="two", scenario_text=SCENARIO) == ""
    results = [rig.impact() for _ in range(2)]
    assert rig.recorded(results[-1]["impact_id"]).parent == folder
    path = finish(rig)
    assert rig.stop("recorder") == 0
    readers(rig, 1)
    return path, results


def expected_values(record: ImpactRecord) -> dict[str, list[np.ndarray]]:
    """Topic -> the vectors of its messages in the order of :func:`vectors`."""
    r = record
    return {
        "/head/acceleration": [r.head_acceleration, r.head_angular_acceleration],
        "/head/velocity": [r.head_velocity, r.head_angular_velocity],
        "/head/pose": [r.head_position, r.head_orientation],
        "/helmet/pose": [r.helmet_position, r.helmet_orientation],
        "/helmet/ground_contact": [r.ground_force, r.ground_torque],
        "/helmet/coupling": [r.coupling_force, r.coupling_torque],
        "/neck/load": [r.neck_force, r.neck_torque],
        "/joint_states": [r.joint_positions, r.joint_velocities],
    }


def vectors(topic: str, message: Any) -> list[list[float]]:
    if topic == "/joint_states":
        return [list(message.position), list(message.velocity)]
    if topic.endswith("pose"):
        p, q = message.pose.position, message.pose.orientation
        return [[p.x, p.y, p.z], [q.x, q.y, q.z, q.w]]
    kind = {"/head/acceleration": "accel", "/head/velocity": "twist"}.get(topic, "wrench")
    part = getattr(message, kind)
    first, second = (part.force, part.torque) if kind == "wrench" else (part.linear, part.angular)
    return [[v.x, v.y, v.z] for v in (first, second)]


def check_every_sample(messages: list[tuple[str, int, Any]], starts: list[float]) -> None:
    """Messages as topic, log time and content are two runs of :data:`SETUP`."""
    record = simulate(SETUP)
    times = [round(start * 1e9) + round(t * 1e9) for start in starts for t in record.time.tolist()]
    by_topic: dict[str, list[tuple[int, Any]]] = {}
    for topic, time_ns, message in messages:
        by_topic.setdefault(topic, []).append((time_ns, message))
    for topic in PER_SAMPLE:
        assert [time_ns for time_ns, _ in by_topic[topic]] == times, topic
    for topic, arrays in expected_values(record).items():
        found = [vectors(topic, message) for _, message in by_topic[topic]]
        for part, array in enumerate(arrays):
            assert np.array_equal([row[part] for row in found], np.vstack([array, array])), topic
        stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for _, m in by_topic[topic]]
        assert stamps == [divmod(time_ns, 10**9) for time_ns in times]
    (first, second) = [to_evaluation(m) for _, m in by_topic["/evaluation/criteria"]]
    assert first[1] == second[1] == evaluate(record)
    assert {len(m.markers) for _, m in by_topic["/scene"]}.pop() > 10


def test_mcap_ros2_reads_every_sample(log: tuple[Path, list[dict[str, Any]]]) -> None:
    path, results = log
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = [
            (channel.topic, message.log_time, decoded)
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]
    for _, _, message in messages:  # mcap_ros2 gives bytes as numbers, as rclpy does not
        for status in getattr(message, "status", ()):
            status.level = bytes([status.level])
    check_every_sample(messages, [result["start_time"] for result in results])


def test_rosbags_reads_every_sample(log: tuple[Path, list[dict[str, Any]]]) -> None:
    path, results = log
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(path) as reader:
        messages = [
            (connection.topic, time_ns, store.deserialize_cdr(data, connection.msgtype))
            for connection, time_ns, data in reader.messages()
        ]
        for connection in reader.connections:
            assert connection.digest in ("", store.hash_rihs01(connection.msgtype))
    check_every_sample(messages, [result["start_time"] for result in results])


def test_the_log_follows_the_ros_2_profile(log: tuple[Path, list[dict[str, Any]]]) -> None:
    path, results = log
    store = get_typestore(Stores.ROS2_JAZZY)
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        metadata = {item.name: item.metadata for item in reader.iter_metadata()}
        attachments = {item.name: item.data.decode() for item in reader.iter_attachments()}
    assert summary is not None
    types = {}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert profile["reliability"] == "reliable"
        assert channel.metadata["topic_type_hash"] == store.hash_rihs01(schema.name)
        types[channel.topic] = schema.name
    assert PER_SAMPLE.items() <= types.items()
    assert {"/impact/samples", "/evaluation/criteria", "/scene"} <= set(types)

    assert metadata["run"]["version.mujoco"] and metadata["run"]["started"].endswith("+00:00")
    assert metadata["run"]["scenario"] == "two" and path.name.startswith("two_")
    assert attachments["scenario.yaml"] == SCENARIO
    for result in results:
        notes = metadata[f"impact/{result['impact_id']}"]
        assert notes["complete"] == "true" and float(notes["start_time"]) == result["start_time"]
        assert setup_from_names(json.loads(notes["setup"])).described() == SETUP.described()
        assert attachments[notes["model"]].startswith("<mujoco")
    assert len(attachments) == 2  # the same model twice is one attachment


def test_fifty_impacts_in_a_row_lose_nothing(rig: Rig, recorder: Path) -> None:
    record = simulate(SETUP)
    ids = []
    for _ in range(50):  # as fast as the simulation can, no waiting for anybody
        answer = rig.call("simulation/run_impact")
        assert answer.success, answer.message
        ids.append(json.loads(answer.message)["impact_id"])
    path = finish(rig)
    rig.until(lambda: set(ids) <= set(rig.criteria))
    expected = evaluate(record)
    assert all(to_evaluation(rig.criteria[i]) == (i, expected) for i in ids)
    whole = open_log(path)
    assert [impact.impact_id for impact in whole.impacts] == ids and not whole.problems
    assert all(same_samples(impact.record, record) for impact in whole.impacts)
    assert list(recorder.iterdir()) == [path]


def test_a_foam_helmet_leaves_its_crush_map_in_the_log(rig: Rig, recorder: Path) -> None:
    foam = ImpactSetup(duration=0.01, direction="front", overrides={"helmet.coupling": "foam"})
    assert rig.set(helmet__coupling="foam", impact__tangential_velocity=0.0) == ""
    try:
        impact_id = rig.impact()["impact_id"]
        assert rig.recorded(impact_id)
        (logged,) = open_log(finish(rig)).impacts
    finally:
        assert rig.set(**parameter_values(SETUP)) == ""
    expected = simulate(foam)
    assert same_samples(logged.record, expected)
    assert logged.record.extras["residual_crush"].max() > 0.01
    for name in ("crush", "residual_crush", "column_position"):
        assert np.array_equal(logged.record.extras[name], expected.extras[name])


def test_sigint_in_the_middle_of_an_impact_leaves_a_valid_file(rig: Rig, recorder: Path) -> None:
    done = rig.impact()["impact_id"]
    path = rig.recorded(done)
    begin_slow_impact(rig)
    rig.until(lambda: int(rig.status["simulation"]["done"]) >= 0)
    assert rig.stop("recorder", signal.SIGINT) == 0
    assert list(recorder.iterdir()) == [path]
    found = open_log(path)
    assert [impact.impact_id for impact in found.impacts] == [done]
    assert same_samples(found.impacts[0].record, simulate(SETUP))


def test_limits_and_names_split_logs_and_nothing_is_overwritten(rig: Rig, recorder: Path) -> None:
    rig.until(lambda: "recorder" in rig.status)
    assert rig.set("recorder", max_impacts=2, file_name="drop") == ""
    for _ in range(3):
        last = rig.impact()["impact_id"]
    rig.recorded(last)
    finish(rig)
    assert sorted(file.name for file in recorder.iterdir()) == ["drop.mcap", "drop_2.mcap"]
    assert [len(open_log(recorder / n).impacts) for n in ("drop.mcap", "drop_2.mcap")] == [2, 1]
    assert not rig.call("recorder/finish").success


def test_a_log_that_a_limit_has_closed_is_told_to_who_wants_it_finished(
    rig: Rig, recorder: Path
) -> None:
    """A matrix was said to be incomplete if its last impact was the last that its log took."""
    rig.until(lambda: "recorder" in rig.status)
    assert rig.set("recorder", max_impacts=2) == ""
    matrix = recorder.with_name("two.yaml")
    matrix.write_text("common: {impact.rig: headform}\nproduct: {impact.normal_velocity: [3, 4]}\n")
    rig.start("scenario", scenario__file=matrix)
    answer = rig.call("scenario/run")
    assert rig.stop("scenario") == 0
    assert answer.success, answer.message
    (path,) = recorder.iterdir()
    assert json.loads(answer.message)["file"] == str(path)
    assert len(open_log(path).impacts) == 2
    assert not rig.call("recorder/finish").success  # told once
    assert rig.set(**parameter_values(SETUP)) == ""


def test_a_place_that_is_not_allowed_or_not_writable_is_refused_or_told(
    rig: Rig, recorder: Path
) -> None:
    rig.until(lambda: "recorder" in rig.status)
    for name in ("../up", "/tmp/x", "a/b", "..", ".hidden", "x/.."):
        assert "file_name" in rig.set("recorder", file_name=name)
    blocked = recorder / "file"
    blocked.write_text("")
    reason = rig.set("recorder", output_dir=str(blocked / "logs"))
    assert "output_dir" in reason and "writable" in reason
    first = rig.impact()["impact_id"]
    path = rig.recorded(first)
    # The directory goes away while nothing is open: the next impact says so, and life goes on.
    assert finish(rig) == path
    moved = recorder.rename(recorder.with_name("moved"))
    recorder.write_text("")
    rig.impact()
    rig.until(lambda: "output_dir" in rig.status["recorder"]["message"])
    recorder.unlink()
    last = rig.impact()["impact_id"]
    assert rig.recorded(last).parent == recorder
    assert len(open_log(moved / path.name).impacts) == 1


def test_a_simulation_that_starts_again_gets_a_file_of_its_own(rig: Rig, recorder: Path) -> None:
    first = rig.recorded(rig.impact()["impact_id"])
    assert rig.stop("simulation") == 0
    rig.start("simulation")
    rig.until(lambda: rig.status["simulation"]["impact_id"] == "")
    readers(rig, 2)
    assert rig.set(**parameter_values(SETUP)) == ""
    second = rig.recorded(rig.impact()["impact_id"])
    assert finish(rig) == second != first
    for path in (first, second):
        assert len(open_log(path).impacts) == 1


def test_a_folder_that_is_removed_while_recording_is_told(rig: Rig, recorder: Path) -> None:
    """Impacts were told as recorded, and scenarios as evaluated, that were nowhere on disk."""
    rig.recorded(rig.impact()["impact_id"])
    shutil.rmtree(recorder)
    lost = rig.impact()["impact_id"]
    rig.until(lambda: "was removed" in rig.status["recorder"]["message"])
    assert rig.status["recorder"]["level"] == "error"
    assert rig.status["recorder"]["impact_id"] != lost
    last = rig.impact()["impact_id"]  # life goes on, in a folder that is made again
    rig.recorded(last)
    assert [impact.impact_id for impact in open_log(finish(rig)).impacts] == [last]


def test_a_full_disk_leaves_one_log_with_what_was_told_and_nothing_else(
    rig: Rig, recorder: Path
) -> None:
    """Each impact made another empty ``.part``."""
    first = rig.impact()["impact_id"]
    path = rig.recorded(first)
    part = path.with_name(path.name + ".part")
    pid = rig.processes["recorder"].pid
    none = resource.prlimit(
        pid, resource.RLIMIT_FSIZE, (part.stat().st_size, resource.RLIM_INFINITY)
    )
    for _ in range(3):
        rig.status.pop("recorder")
        rig.impact()
        rig.until(lambda: rig.status.get("recorder", {}).get("level") == "error")
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
    assert list(recorder.iterdir()) == [part]
    recovered = recover(part)
    assert recovered.impacts == 1 and open_log(recovered.path).impacts[0].impact_id == first
    resource.prlimit(pid, resource.RLIMIT_FSIZE, none)
    last = rig.impact()["impact_id"]
    rig.recorded(last)
    assert [impact.impact_id for impact in open_log(finish(rig)).impacts] == [last]


# Last, because the simulation takes 20 s to notice that a reader was killed.
def test_sigkill_loses_at_most_the_impact_in_progress(rig: Rig, recorder: Path) -> None:
    ids = [rig.impact()["impact_id"] for _ in range(2)]
    path = rig.recorded(ids[-1])
    begin_slow_impact(rig)
    assert rig.stop("recorder", signal.SIGKILL) == -signal.SIGKILL
    part = path.with_name(path.name + ".part")
    assert list(recorder.iterdir()) == [part]
    counts: dict[str, int] = {}
    try:
        with open(part, "rb") as stream:
            for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
    except Exception as error:  # the end of the file is missing, nothing else
        assert "EndOfFile" in type(error).__name__ or "end" in str(error).lower()
    assert all(counts[topic] >= 2 * SETUP.samples for topic in PER_SAMPLE)
    assert counts["/evaluation/criteria"] == 2
