"""Serialising many samples at once gives the messages that one each would give."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2 serialises messages")

from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.nodes.conversion import CHANNELS, messages, stamp
from helmet_sim_ros.nodes.serialised import CLOCK_TOPIC, serialised

TYPES = {channel.topic: channel.type for channel in CHANNELS} | {CLOCK_TOPIC: Clock}


@pytest.mark.parametrize("rig", ["rider", "headform"])
def test_every_message_of_every_topic_says_the_same_in_as_many_bytes(rig):
    record = simulate(ImpactSetup(rig=rig, tangential_velocity=5.0, duration=0.01))
    count = 0
    for (time_ns, one), (at_once_ns, at_once) in zip(
        messages(record, 12.3), serialised(record, 12.3), strict=True
    ):
        assert at_once_ns == time_ns
        expected = dict(one) | {CLOCK_TOPIC: Clock(clock=stamp(time_ns))}
        assert list(at_once) == list(expected)
        for topic, message in expected.items():
            assert len(at_once[topic]) == len(serialize_message(message))
            read = deserialize_message(at_once[topic], TYPES[topic])
            assert repr(read) == repr(message), topic  # not ==: joint efforts are NaN
        count += 1
    assert count == len(record)
    assert ("joint_states" in at_once) == (rig == "rider")
