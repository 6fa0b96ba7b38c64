"""A process that subscribes to the topics of an impact, and is slow: see ``bad_readers.py``."""

from __future__ import annotations

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64MultiArray

from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.log_session import CRITERIA_TOPIC
from helmet_sim_ros.nodes.qos import CRITERIA, CRITERIA_READER, SAMPLES_READER, SAMPLES_WRITER


def main(seconds: float, keeps_all: bool) -> None:
    """Take messages for ever, so many seconds for each."""
    rclpy.init(args=[])
    node = rclpy.create_node("bad_reader")

    def take(message: object) -> None:
        time.sleep(seconds)

    for kind, topic, qos in (
        (Float64MultiArray, samples.TOPIC, SAMPLES_READER if keeps_all else SAMPLES_WRITER),
        (DiagnosticArray, CRITERIA_TOPIC, CRITERIA_READER if keeps_all else CRITERIA),
    ):
        node.create_subscription(kind, topic, take, qos)
    rclpy.spin(node)


if __name__ == "__main__":
    main(float(sys.argv[1]), sys.argv[2] == "all")
