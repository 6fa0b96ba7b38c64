"""Serialising many samples at once gives the messages that one each would give."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2 serialises messages")

from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.nodes.conversion import CHANNELS, messages, stamp
from helmet_sim_ros.nodes.scene_markers import SceneMarkers
from helmet_sim_ros.nodes.serialised import CLOCK_TOPIC, SerialisedScene, serialised

TYPES = {channel.topic: channel.type for channel in CHANNELS} | {CLOCK_TOPIC: Clock}


@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_every_message_of_every_topic_says_the_same_in_as_many_bytes(rig):
    record = simulate(ImpactSetup(rig=rig, tangential_velocity=5.0, duration=0.01))
    times, at_once = serialised(record, 12.3)
    assert len(times) == len(record)
    for i, (time_ns, one) in enumerate(messages(record, 12.3)):
        assert times[i] == time_ns
        expected = dict(one) | {CLOCK_TOPIC: Clock(clock=stamp(time_ns))}
        assert list(at_once) == list(expected)
        for topic, message in expected.items():
            raw = at_once[topic][i].tobytes()
            assert len(raw) == len(serialize_message(message))
            read = deserialize_message(raw, TYPES[topic])
            assert repr(read) == repr(message), topic  # not ==: joint efforts are NaN
    assert ("joint_states" in at_once) == (rig == "rider")


@pytest.mark.parametrize("surface", ["ground", "car_front"])
def test_every_scene_says_the_same_in_as_many_bytes(surface):
    """Also where the arrows of the forces come and go."""
    setup = ImpactSetup(surface=surface, tangential_velocity=5.0, duration=0.02)
    record = simulate(setup)
    markers, scene = SceneMarkers(setup), SerialisedScene(SceneMarkers(setup))
    shown = set()
    for i in range(0, len(record), 20):
        message = markers.message(record, i, 10_000_000_000 + i)
        expected, raw = serialize_message(message), scene.message(record, i, 10_000_000_000 + i)
        assert len(raw) == len(expected)
        read, meant = (deserialize_message(data, MarkerArray) for data in (raw, expected))
        assert repr(read) == repr(meant)
        shown.add(tuple(marker.action for marker in message.markers))
    assert len(shown) > 1
