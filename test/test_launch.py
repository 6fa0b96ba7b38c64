"""The launch file under the real ``launch``, where it is installed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("launch_ros", reason="launch and launch_ros come with a system ROS only")

from node_processes import Rig

ROOT = Path(__file__).resolve().parents[1]
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
service = LaunchService()
arguments = [tuple(word.split(":=")) for word in sys.argv[2:]]
included = IncludeLaunchDescription(sys.argv[1], launch_arguments=arguments)
service.include_launch_description(LaunchDescription([included]))
sys.exit(service.run())
"""


@pytest.mark.parametrize("one_process", ["false", "true"])
def test_a_launched_node_has_what_the_arguments_say(tmp_path: Path, one_process: str) -> None:
    parameters = tmp_path / "simulation.yaml"
    parameters.write_text("/**/simulation: {ros__parameters: {impact.normal_velocity: 4.0}}")
    arguments = {
        "one_process": one_process, "namespace": "lab", "output_dir": tmp_path / "logs",
        "scenario": "ece_22_05", "standard": "ece_r22_05", "simulation_params": parameters,
    }  # fmt: skip
    words = [f"{name}:={value}" for name, value in arguments.items()]
    with Rig(tmp_path) as rig:
        launched = subprocess.Popen(
            [sys.executable, "-c", LAUNCH, ROOT / "launch" / "impact.launch.py", *words],
            env=os.environ | {"AMENT_PREFIX_PATH": sys.prefix}, cwd=tmp_path,
        )  # fmt: skip
        try:
            got = {
                name: rig.get(name, f"/lab/{node}")
                for node, name in (
                    ("simulation", "impact.normal_velocity"), ("evaluator", "standard"),
                    ("recorder", "output_dir"), ("scenario", "scenario.file"),
                )
            }  # fmt: skip
        finally:
            launched.send_signal(signal.SIGINT)
            code = launched.wait(timeout=60)
    assert code == 0
    assert got == {
        "impact.normal_velocity": 4.0, "standard": "ece_r22_05",
        "output_dir": str(tmp_path / "logs"), "scenario.file": "ece_22_05",
    }  # fmt: skip
