"""The recorder killed at random instants: what it told as on disk can be read again.

``KILLS=100 SEED=7 python -m pytest test/test_nodes_kills.py`` kills it more often, and elsewhere.
"""

from __future__ import annotations

import os
import random
import signal
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from impacts import Impacts
from node_processes import Rig
from std_msgs.msg import Float64MultiArray

from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.qos import SAMPLES_WRITER

KILLS = int(os.environ.get("KILLS", "3"))
SEED = int(os.environ.get("SEED", "1"))


def test_what_the_status_told_is_there_after_a_kill_at_a_random_instant(tmp_path: Path) -> None:
    """Of 133 impacts that the recorder had told as on disk, 2 were gone after one of 30 kills."""
    rng, impacts, number, told = random.Random(SEED), Impacts(), 0, 0
    with Rig(tmp_path, ["evaluator"]) as rig:
        sender = rig.node.create_publisher(Float64MultiArray, samples.TOPIC, SAMPLES_WRITER)
        for kill in range(KILLS):
            folder = tmp_path / f"logs_{kill}"
            rig.status.pop("recorder", None)
            # Files of two impacts each, so that a kill also meets one that is being finished.
            rig.start("recorder", output_dir=folder, max_impacts=2)
            rig.until(lambda: "recorder" in rig.status)
            on_disk: set[str] = set()
            left = rng.randint(5, 100)
            while left or not on_disk - {""}:
                number += 1
                sender.publish(impacts.message(number))
                rig.serve(0.02)
                on_disk.add(rig.status["recorder"]["impact_id"])
                left = max(0, left - 1)
            process = rig.processes["recorder"]
            rig.serve(rng.uniform(0.0, 0.2))
            on_disk.add(rig.status["recorder"]["impact_id"])
            os.kill(process.pid, signal.SIGKILL)
            rig.stop("recorder", signal.SIGKILL)
            on_disk.discard("")
            told += len(on_disk)
            assert on_disk <= readable(folder, impacts), f"kill {kill}, seed {SEED}"
    print(f"{KILLS} kills, {told} impacts told as on disk, none lost")
    assert told > KILLS


def readable(folder: Path, impacts: Impacts) -> set[str]:
    """The impacts in a folder that are there with samples and criteria, after recovery."""
    for part in folder.glob("*.part"):
        with suppress(LogError):  # nothing complete in it; whether anything was told is seen below
            recover(part)
    found = set()
    for path in folder.glob("*.mcap"):
        for impact in open_log(path).impacts:
            assert same_samples(impact.record, impacts.record)
            if impact.logged is not None:
                assert impact.logged == impacts.evaluation
                found.add(impact.impact_id)
    return found
