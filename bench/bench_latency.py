"""What a user waits for, through real nodes on this machine.

    python bench/bench_latency.py

Prints the time from ``run_impact`` sent to criteria received (median over impacts of the default
rider, 40 ms), the same until the recorder has the impact on disk, and the time of
``helmet-sim run oblique_table1`` from the command to its table.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time

from helmet_sim_ros.cli._processes import NodeProcesses
from helmet_sim_ros.nodes.client import call, ros_client, wait_for_service
from helmet_sim_ros.nodes.environment import prepare_environment

IMPACTS = 20
RUNS = 3


def latencies(folder: str) -> tuple[list[float], list[float]]:
    """Seconds from the request to its criteria, and to its log, per impact."""
    with NodeProcesses({"recorder": {"output_dir": folder}}) as nodes, ros_client() as node:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
        from std_srvs.srv import Trigger

        from helmet_sim_ros.nodes.qos import CRITERIA, LATCHED

        judged: list[float] = []
        recorded: list[float] = []
        readers: list[int] = []

        def simulation(status: DiagnosticStatus) -> None:
            readers.append(int({v.key: v.value for v in status.values}["readers"]))

        def recorder(status: DiagnosticStatus) -> None:
            if {v.key: v.value for v in status.values}["impact_id"]:
                recorded.append(time.monotonic())

        def criteria(array: DiagnosticArray) -> None:
            judged.append(time.monotonic())

        node.create_subscription(DiagnosticArray, "/evaluation/criteria", criteria, CRITERIA)
        node.create_subscription(DiagnosticStatus, "/recorder/status", recorder, LATCHED)
        node.create_subscription(DiagnosticStatus, "/simulation/status", simulation, LATCHED)
        run = node.create_client(Trigger, "/simulation/run_impact")
        wait_for_service(node, run, 60, nodes.check)
        while not readers or readers[-1] < 2:
            rclpy.spin_once(node, timeout_sec=0.1)
        to_criteria, to_log = [], []
        for _ in range(IMPACTS):
            judged.clear()
            recorded.clear()
            sent = time.monotonic()
            call(node, run, Trigger.Request(), 60, nodes.check)
            while not (judged and recorded):
                rclpy.spin_once(node, timeout_sec=0.1)
                nodes.check()
                if time.monotonic() > sent + 60:
                    raise SystemExit("an impact was not evaluated and recorded within 60 s")
            to_criteria.append(judged[0] - sent)
            to_log.append(recorded[0] - sent)
    return to_criteria, to_log


def whole_scenario(folder: str) -> float:
    """Seconds of ``helmet-sim run oblique_table1`` until its table is printed."""
    began = time.monotonic()
    command = [sys.executable, "-m", "helmet_sim_ros", "run", "oblique_table1", "--output", folder]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if "6 of 6 impacts evaluated" in line:
                return time.monotonic() - began
    raise SystemExit("oblique_table1 was not complete")


def main() -> None:
    prepare_environment(domain_id=1 + os.getpid() % 90)
    with tempfile.TemporaryDirectory() as folder:
        to_criteria, to_log = latencies(folder)
        runs = [whole_scenario(folder) for _ in range(RUNS)]
    print(f"run_impact to criteria     median {statistics.median(to_criteria):.3f} s, "
          f"worst {max(to_criteria):.3f} s of {IMPACTS}")  # fmt: skip
    print(f"run_impact to log on disk  median {statistics.median(to_log):.3f} s, "
          f"worst {max(to_log):.3f} s of {IMPACTS}")  # fmt: skip
    print(f"oblique_table1             median {statistics.median(runs):.1f} s, "
          f"worst {max(runs):.1f} s of {RUNS}")  # fmt: skip


if __name__ == "__main__":
    main()
