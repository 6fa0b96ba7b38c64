"""Scenarios through real nodes: the verbs run, up and call, and the scenario node's own services.

Every test has processes of its own over real DDS, in a ROS domain of its own.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from domains import claim_domain

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.model.fall.strikes import head_strikes
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.nodes.client import call, ros_client, wait_for_service
from helmet_sim_ros.study import load_scenario

DOMAIN = claim_domain()
HELMET_SIM = [sys.executable, "-m", "helmet_sim_ros"]
MAGIC = b"\x89MCAP0\r\n"

TWO_DROPS = """
description: two short drops
common: {impact: {rig: headform, tangential_velocity: 0}, sim.duration: 0.02}
product: {impact.normal_velocity: [2.5, 5]}
"""
LONG = """
common: {impact.rig: headform, sim.duration: 1.0}
product: {impact.friction: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]}
"""
MIXED = """
description: two short drops and two short falls, one of which meets nothing
common: {}
cases:
  - {name: vn2.5, impact: {rig: headform, normal_velocity: 2.5}, sim.duration: 0.02}
  - {name: vn5, impact: {rig: headform, normal_velocity: 5.0}, sim.duration: 0.02}
  - {name: struck, fall: {preset: pedestrian, pitch_deg: 170.0, height: 1.2, scene: car, x: 0.3},
     sim.duration: 0.1}
  - {name: loose, fall: {preset: pedestrian, height: 1.4}, sim.duration: 0.05}
"""
DIVERGING = """
common: {impact.rig: headform, sim.duration: 0.02}
cases:
  - {name: before}
  - {name: diverges, helmet.shell: {contact_stiffness: 1e8, effective_mass: 1e-5}}
  - {name: after}
"""


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("ROS_NAMESPACE", raising=False)


@pytest.fixture
def start(domain: None, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start helmet-sim in an empty directory; whatever is left is killed at the end."""
    (tmp_path / "drops.yaml").write_text(TWO_DROPS)
    (tmp_path / "long.yaml").write_text(LONG)
    (tmp_path / "mixed.yaml").write_text(MIXED)
    (tmp_path / "diverging.yaml").write_text(DIVERGING)
    started = []

    def begin(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*HELMET_SIM, *arguments], cwd=tmp_path, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        started.append(process)
        return process

    yield begin
    for process in started:
        for pid in [*children(process.pid), process.pid]:
            if alive(pid):
                os.kill(pid, signal.SIGKILL)
        process.wait()


def children(pid: int) -> list[int]:
    listed = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(text) for text in listed.read_text().split()] if listed.exists() else []


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition: Callable[[], Any], seconds: float = 60.0) -> Any:
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)
    return found


def node_named(pids: list[int], name: str) -> int:
    for pid in pids:
        if f"{name}_node".encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
            return pid
    return 0


def wait_until_up() -> None:
    """Until each of the four nodes serves."""
    with ros_client() as node:
        from std_srvs.srv import Trigger

        for name in ("simulation/cancel", "evaluator/last_result", "recorder/finish",
                     "scenario/run"):  # fmt: skip
            wait_for_service(node, node.create_client(Trigger, name), 60)


def recording(folder: Path) -> bool:
    return any(folder.glob("*.part"))


def test_a_scenario_runs_from_nodes_to_tables_and_log(start, tmp_path):
    process = start("run", "mixed.yaml", "--all-criteria")
    output, _ = process.communicate(timeout=240)
    assert process.returncode == 0, output
    lines = [text.split() for text in output.splitlines()]
    scenario = load_scenario(tmp_path / "mixed.yaml")
    for velocity, setup in zip(("vn2.5", "vn5"), scenario.setups, strict=True):
        line = next(words for words in lines if words[:1] == [velocity])
        assert line[1] == f"{evaluate(simulate(setup)).peak_g.value:.0f}"
    (strike,) = head_strikes(simulate(scenario.falls[0]))
    line = next(words for words in lines if words[:1] == ["struck"])
    assert line[1:3] == [f"{strike.time:.3f}", "bumper"] and line[-1] == "pass"
    assert f"{strike.evaluation.peak_g.value:.0f}" in line
    assert "no head contact: loose" in output
    assert "4 of 4 cases evaluated" in output
    assert "peak_normal_force" in output and "struck, strike 1" in output
    log = next(text for text in output.splitlines() if text.startswith("log: "))
    file = tmp_path / log.removeprefix("log: ")
    assert file.read_bytes()[:8] == MAGIC == file.read_bytes()[-8:]
    assert file.name.startswith("mixed_")
    assert [impact.is_fall for impact in open_log(file)] == [False, False, True, True]
    table = (tmp_path / "logs" / "mixed" / "strikes.csv").read_text().splitlines()
    assert len(table) == 2 and table[1].startswith("struck,1,")


@pytest.mark.parametrize(("option", "count"), [("--four-processes", 4), ("--one-process", 0)])
def test_ctrl_c_ends_all_nodes_and_leaves_a_finished_log(start, tmp_path, option, count):
    process = start("run", "long.yaml", option)
    wait_until(lambda: recording(tmp_path / "logs"))
    nodes = children(process.pid)
    assert len(nodes) == count
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 1
    assert not any(map(alive, nodes))
    (log,) = (tmp_path / "logs").iterdir()
    assert log.suffix == ".mcap"
    assert log.read_bytes()[-8:] == MAGIC


def test_the_crash_of_one_node_is_told_and_ends_the_others(start, tmp_path):
    process = start("run", "long.yaml", "--four-processes")
    wait_until(lambda: recording(tmp_path / "logs"))
    nodes = children(process.pid)
    os.kill(node_named(nodes, "simulation"), signal.SIGKILL)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Error: the simulation node ended with exit code -9" in output
    assert "Traceback" not in output
    assert not any(map(alive, nodes))


@pytest.mark.parametrize("when", ["starting", "serving"])
def test_nodes_do_not_outlive_a_killed_command(start, when):
    process = start("up")
    nodes = wait_until(lambda: len(found := children(process.pid)) == 4 and found)
    if when == "serving":
        wait_until_up()
    process.kill()
    process.wait()
    wait_until(lambda: not any(map(alive, nodes)), 30.0)


def test_up_serves_impacts_and_scenarios_until_ctrl_c(start, tmp_path):
    """One set of nodes for all that a client may ask of them."""
    up = start("up", "--config-path", str(tmp_path))
    wait_until_up()

    impact = start(
        "call", "impact", "--rig", "headform", "--normal-velocity", "3", "--duration", "0.02",
        "--set", "sim.real_time_factor=0", "--timeout", "60",
    )  # fmt: skip
    output, _ = impact.communicate(timeout=120)
    assert impact.returncode == 0, output
    told = dict(line.split(": ", 1) for line in output.splitlines())
    assert float(told["peak_g"]) > 0 and told["impact_id"]

    with ros_client() as node:
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter
        from std_srvs.srv import Trigger

        run = node.create_client(Trigger, "/scenario/run")
        cancel = node.create_client(Trigger, "/scenario/cancel")
        settings = node.create_client(SetParameters, "/scenario/set_parameters")
        for client in (run, cancel, settings):
            wait_for_service(node, client, 60)

        def choose(**values: object) -> Any:
            parameters = [
                Parameter(f"scenario.{key}", value=value).to_parameter_msg()
                for key, value in values.items()
            ]
            request = SetParameters.Request(parameters=parameters)
            return call(node, settings, request, 30).results[0]

        # a file that does not exist, or a bad value in it, is refused when it is chosen
        refused = choose(file="nowhere.yaml")
        assert not refused.successful
        assert "nowhere.yaml" in refused.reason

        # an idle scenario cannot be cancelled; a running one can, and says which case it was at
        assert not call(node, cancel, Trigger.Request(), 30).success
        assert choose(file=str(tmp_path / "long.yaml")).successful
        running = run.call_async(Trigger.Request())
        wait_until(lambda: any((tmp_path / "logs").glob("long_*.part")))
        second = call(node, run, Trigger.Request(), 30)
        assert not second.success
        assert second.message == "busy: long runs, case 1 of 10"
        assert "busy" in choose(timeout=10.0).reason
        assert call(node, cancel, Trigger.Request(), 30).success
        wait_until(lambda: spin(node) or running.done())
        assert not running.result().success
        result = json.loads(running.result().message)
        assert not result["complete"]
        assert {row["status"] for row in result["cases"][1:]} == {"cancelled"}

        # without a place for the log nothing runs at all
        (tmp_path / "logs").rename(tmp_path / "moved")
        (tmp_path / "logs").write_text("in the way")
        assert choose(file=str(tmp_path / "drops.yaml")).successful
        answer = call(node, run, Trigger.Request(), 120)
        assert not answer.success
        assert "output_dir" in answer.message
        (tmp_path / "logs").unlink()

        # a case that diverges fails, with its setup, and the matrix goes on to its end
        assert choose(file=str(tmp_path / "diverging.yaml")).successful
        answer = call(node, run, Trigger.Request(), 120)
        assert not answer.success
        rows = json.loads(answer.message)["cases"]
        assert [row["status"] for row in rows] == ["evaluated", "failed", "evaluated"]
        assert "diverged" in rows[1]["error"]
        assert rows[1]["setup"]["helmet.shell.contact_stiffness"] == 1e8
        assert rows[1]["evaluation"] is None

        # a scenario that is complete equals the library to 1e-9
        assert choose(file=str(tmp_path / "drops.yaml")).successful
        answer = call(node, run, Trigger.Request(), 120)
        assert answer.success, answer.message
        result = json.loads(answer.message)
        setups = load_scenario(tmp_path / "drops.yaml").setups
        for row, setup in zip(result["cases"], setups, strict=True):
            expected = evaluate(simulate(setup)).as_dict()["criteria"]
            for name, entry in row["evaluation"]["criteria"].items():
                assert entry["value"] == pytest.approx(expected[name]["value"], rel=1e-9)
        assert Path(result["file"]).read_bytes()[-8:] == MAGIC

    # a run beside these nodes would be mixed up with them; long enough to hear of them
    beside = start("run", "long.yaml")
    output, _ = beside.communicate(timeout=60)
    assert beside.returncode == 1
    assert f"is up in ROS domain {DOMAIN}" in output

    nodes = children(up.pid)
    up.send_signal(signal.SIGINT)
    output, _ = up.communicate(timeout=60)
    assert up.returncode == 0
    assert output.strip().endswith("all nodes ended")
    assert not any(map(alive, nodes))


def spin(node: Any) -> None:
    import rclpy

    rclpy.spin_once(node, timeout_sec=0.05)


def test_a_missing_simulation_is_told_without_a_long_wait(start):
    began = time.monotonic()
    process = start("call", "impact", "--timeout", "1")
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "no node answers /simulation" in output
    assert f"domain {DOMAIN}" in output
    assert time.monotonic() - began < 30


def test_a_whole_setup_works_in_a_namespace(domain, tmp_path):
    """All names are relative: four nodes below /lab run a scenario among themselves."""
    (tmp_path / "drops.yaml").write_text(TWO_DROPS)
    remap = ["--ros-args", "-r", "__ns:=/lab"]
    extra = {"scenario": ["-p", "scenario.file:=drops.yaml"]}
    processes = [
        subprocess.Popen(
            [sys.executable, "-m", f"helmet_sim_ros.nodes.{name}_node", *remap,
             *extra.get(name, [])], cwd=tmp_path,
        )
        for name in ("simulation", "evaluator", "recorder", "scenario")
    ]  # fmt: skip
    try:
        with ros_client() as node:
            from std_srvs.srv import Trigger

            run = node.create_client(Trigger, "/lab/scenario/run")
            wait_for_service(node, run, 60)
            answer = call(node, run, Trigger.Request(), 120)
        assert answer.success, answer.message
        assert json.loads(answer.message)["complete"]
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        codes = [process.wait(timeout=30) for process in processes]
    assert codes == [0, 0, 0, 0]
