"""What a client is told is what was done: attacked through real nodes, by clients of all kinds."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from node_processes import Rig
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from helmet_sim_ros.cli.run import check_asked
from helmet_sim_ros.mcap_log import open_log
from helmet_sim_ros.mcap_log.criteria import digest_of
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.nodes.qos import SERVICE
from helmet_sim_ros.nodes.setup_parameters import parameter_values
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.study import load_scenario

SETUP = ImpactSetup(rig="headform", duration=0.01, time_step=1e-4)
DROPS = """
common: {impact: {rig: headform, tangential_velocity: 0}, sim: {duration: 0.01, time_step: 1.0e-4}}
product: {impact.normal_velocity: [2.5, 5]}
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    folder = tmp_path_factory.mktemp("trust")
    with Rig(folder, ["simulation", "evaluator", "recorder"]) as running:
        Meddler(running)
        yield running


class Meddler:
    """Another client, who sets the speed just before an impact runs.

    Below ``/meddled`` it serves what a simulation does, by asking the real one.
    """

    def __init__(self, rig: Rig) -> None:
        self.node = rig.node
        self._ask = {}
        group = ReentrantCallbackGroup()
        for name, kind, serve in (
            ("set_parameters_atomically", SetParametersAtomically, self._relay),
            ("get_parameters", GetParameters, self._relay),
            ("run_impact", Trigger, self._run),
        ):
            self._ask[kind] = self.node.create_client(
                kind, f"simulation/{name}", callback_group=group
            )
            self.node.create_service(
                kind, f"meddled/simulation/{name}", serve, callback_group=group
            )

    async def _relay(self, request: Any, response: Any) -> Any:
        kind = GetParameters if isinstance(request, GetParameters.Request) else (
            SetParametersAtomically
        )  # fmt: skip
        return await self._ask[kind].call_async(request)

    async def _run(self, request: Any, response: Any) -> Any:
        faster = [Parameter("impact.normal_velocity", value=9.0).to_parameter_msg()]
        change = SetParametersAtomically.Request(parameters=faster)
        assert (await self._ask[SetParametersAtomically].call_async(change)).result.successful
        return await self._ask[Trigger].call_async(request)


def test_the_digest_of_the_setup_travels_with_the_impact(rig: Rig) -> None:
    assert rig.set(**parameter_values(SETUP)) == ""
    result = rig.impact()
    asked = setup_digest(SETUP.described())
    assert result["setup_digest"] == asked
    assert digest_of(rig.criteria[result["impact_id"]]) == asked
    log = open_log(finish(rig, result["impact_id"]))
    (entry,) = log._index.entries
    assert entry.notes["setup_digest"] == asked == setup_digest(log.impacts[0].record.setup)


def test_a_scenario_does_not_report_the_impact_of_another_client_as_its_own(
    rig: Rig, tmp_path: Path
) -> None:
    """Every row came back "evaluated", with 235 g under the name of a case that has 68 g."""
    file = tmp_path / "drops.yaml"
    file.write_text(DROPS)
    meddled = ["-r", "simulation/run_impact:=meddled/simulation/run_impact"]
    try:
        rig.start("scenario", *meddled, scenario__file=str(file))
        answer = rig.call("scenario/run")
    finally:
        rig.stop("scenario")
    assert not answer.success
    rows = json.loads(answer.message)["cases"]
    assert [row["status"] for row in rows] == ["failed", "failed"]
    for row in rows:
        assert row["impact_id"] in row["error"] and "another setup" in row["error"]
        assert row["evaluation"] is None
    rig.start("scenario", scenario__file=str(file))
    try:
        answer = rig.call("scenario/run")
    finally:
        rig.stop("scenario")
    assert answer.success, answer.message
    for row, setup in zip(
        json.loads(answer.message)["cases"], load_scenario(file).setups, strict=True
    ):
        assert row["setup_digest"] == setup_digest(setup.described())


def test_call_does_not_show_an_impact_that_another_client_changed(rig: Rig) -> None:
    """The answer had the peak of 9 m/s for somebody who had asked for 3 m/s."""
    assert rig.set(**parameter_values(SETUP)) == ""
    for namespace, code in (("meddled", 1), ("", 0)):
        process = subprocess.Popen(
            [sys.executable, "-m", "helmet_sim_ros", "call", "impact", "--normal-velocity", "3",
             "--namespace", namespace],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        rig.until(lambda process=process: process.poll() is not None)
        said = process.communicate()[0]
        assert process.returncode == code, said
        assert ("another setup" in said) == bool(code)
        assert ("peak_g" in said) != bool(code)


def test_run_believes_neither_a_row_of_another_setup_nor_a_log_that_is_gone(tmp_path: Path) -> None:
    """Somebody who sets ``scenario.file`` on our scenario node got the table of his own file; and
    the table named a log in a folder that had been removed."""
    file = tmp_path / "drops.yaml"
    file.write_text(DROPS)
    cases = load_scenario(file).cases
    log = tmp_path / "there.mcap"
    log.write_bytes(b"")

    def row(digest: str, recorded: Path) -> dict[str, Any]:
        return {"status": "evaluated", "error": "", "impact_id": "a-1", "evaluation": {"x": 1},
                "recorded": str(recorded), "setup_digest": digest}  # fmt: skip

    right = [setup_digest(case.setup.described()) for case in cases]
    for rows, bad in (
        ([row(right[0], log), row(right[1], log)], []),
        ([row(right[1], log), row(right[1], log)], [0]),
        ([row(right[0], log), row(right[1], tmp_path / "gone.mcap")], [1]),
    ):
        result = {"cases": rows, "error": "", "complete": True}
        check_asked(result, cases)
        assert [i for i, r in enumerate(rows) if r["status"] == "failed" and r["error"]] == bad
        assert result["complete"] is not bool(bad)
    result = {"cases": [row(right[0], log)], "error": "", "complete": True}
    check_asked(result, cases)
    assert not result["complete"] and "1 cases were run" in result["error"]


def finish(rig: Rig, impact_id: str) -> Path:
    rig.recorded(impact_id)
    answer = rig.call("recorder/finish")
    assert answer.success, answer.message
    return Path(json.loads(answer.message)["path"])


def run_impacts(rig: Rig, count: int) -> list[str]:
    """Impacts one right after the other, without waiting for anybody."""
    answers = [rig.call("simulation/run_impact") for _ in range(count)]
    assert all(answer.success for answer in answers)
    return [json.loads(answer.message)["impact_id"] for answer in answers]


def test_criteria_of_every_impact_are_in_the_log_however_far_the_recorder_is_behind(
    rig: Rig,
) -> None:
    """Of 1120 impacts, 381 had no criteria in the log although the evaluator had given them all: a
    review of the log took for never judged what a client had seen judged."""
    assert rig.set(**parameter_values(SETUP.replaced({"duration": 1.0}))) == ""
    long = run_impacts(rig, 4)  # keeps the recorder busy, which writes a message for each sample
    assert rig.set(**parameter_values(SETUP.replaced({"duration": 1e-3}))) == ""
    ids = long + run_impacts(rig, 300)
    log = open_log(finish(rig, ids[-1]))
    mine = [impact for impact in log.impacts if impact.impact_id in ids]
    assert [impact.impact_id for impact in mine] == ids and not log.problems
    assert [impact.impact_id for impact in mine if impact.logged is None] == []


def test_every_one_of_many_calls_at_once_is_answered(rig: Rig) -> None:
    """Of 15 calls that waited for a busy simulation, 5 were never answered."""
    client = rig.node.create_client(Trigger, "simulation/run_impact", qos_profile=SERVICE)
    rig.until(client.service_is_ready)
    process = rig.processes["simulation"]
    process.send_signal(signal.SIGSTOP)
    try:
        calls = [client.call_async(Trigger.Request()) for _ in range(30)]
        rig.serve(0.5)
    finally:
        process.send_signal(signal.SIGCONT)
    rig.until(lambda: all(call.done() for call in calls))
    rig.node.destroy_client(client)


def test_a_missing_evaluator_is_said_in_the_log_and_in_the_status(rig: Rig) -> None:
    """The status said "recording" and nothing else, whether there were criteria or not."""
    assert rig.set(**parameter_values(SETUP)) == ""
    assert rig.stop("evaluator") == 0
    try:
        (impact_id,) = run_impacts(rig, 1)
        path = finish(rig, impact_id)
    finally:
        rig.start("evaluator")
        rig.until(lambda: rig.status["simulation"]["readers"] == "2")
    assert "no evaluator" in rig.status["recorder"]["criteria"]
    log = open_log(path)
    notes = {index.name: log._source.metadata(index) for index in log._source.metadata_index}
    assert "no evaluator" in notes[f"no_criteria/{impact_id}"]["reason"]
    assert next(i for i in log.impacts if i.impact_id == impact_id).logged is None


def test_no_parameter_opens_a_file_that_the_operator_did_not_name(rig: Rig, tmp_path: Path) -> None:
    """``helmet.name`` opened any file of the machine and told its beginning; a name of 300
    characters was not answered at all."""
    secret = tmp_path / "secret.yaml"
    secret.write_text("hidden: treasure\n")
    rig.start("scenario")
    try:
        for node, name, values in (
            ("simulation", "helmet.name", {}),
            ("evaluator", "standard", {}),
            ("scenario", "scenario.file", {}),
            ("scenario", "scenario.overrides", {"list": "helmet.name="}),
            ("recorder", "output_dir", {}),
        ):
            for path in (
                str(secret), str(tmp_path / "none.yaml"), "/etc/passwd", "../../../../etc/passwd",
                "~root/x.yaml", "~nobody-here/x.yaml", "/" + "x" * 300, "/x/" * 2000, "/a\nb.yaml",
                "/\u202e.yaml", "/\x00.yaml",
            ):  # fmt: skip
                if name == "output_dir" and path.startswith("~"):
                    continue  # no home there, a folder of this name
                value: Any = [values["list"] + path] if values else path
                reason = rig.set(node, **{name.replace(".", "__"): value})
                key = "helmet.name" if values else name
                assert key.rpartition(".")[2] in reason, (name, path, reason)
                assert "treasure" not in reason and "root:" not in reason
                assert reason.isprintable()
    finally:
        rig.stop("scenario")
    assert not (tmp_path / "none.yaml").exists()
    assert "config_paths" in rig.set(config_paths=[str(tmp_path)])  # nor may a client widen it
    for name in ("a" * 300, "a.yaml" * 60):
        assert "helmet.name" in rig.set(helmet__name=name)


def test_what_the_operator_named_may_be_chosen(rig: Rig, tmp_path: Path) -> None:
    """A folder, and nothing above or below it; a link in it leads nowhere else."""
    shipped = find_config("helmets", "bicycle", "helmet").read_text()
    named, below = tmp_path / "named", tmp_path / "named" / "below"
    below.mkdir(parents=True)
    for folder in (tmp_path, named, below):
        (folder / "mine.yaml").write_text(shipped)
    (named / "link.yaml").symlink_to(tmp_path / "mine.yaml")
    (named / "mine.txt").write_text(shipped)
    assert rig.stop("simulation") == 0
    rig.start("simulation", config_paths=f"[{named}]")
    try:
        assert rig.set(helmet__name=str(named / "mine.yaml")) == ""
        assert rig.set(helmet__name=str(below / ".." / "mine.yaml")) == ""
        for outside in (tmp_path / "mine.yaml", below / "mine.yaml", named / "link.yaml",
                        named / "mine.txt", named / ".." / "mine.yaml"):  # fmt: skip
            assert "config_paths" in rig.set(helmet__name=str(outside)), outside
    finally:
        assert rig.stop("simulation") == 0
        rig.status.pop("simulation")
        rig.start("simulation")
        rig.until(lambda: rig.status.get("simulation", {}).get("readers") == "2")


@pytest.mark.parametrize(
    "name", ["a\nb", "log\u202egpj", "a\x1b[2J", "x" * 300, "..", "a/b", "\u200b"]
)
def test_a_name_of_a_log_that_is_not_what_it_seems_is_refused(rig: Rig, name: str) -> None:
    """Names with a line break, a right-to-left override or 300 characters were taken; the last
    failed at every impact."""
    plain = name in ("..", "a/b")  # a file is called otherwise than its scenario then
    for key in ("file_name",) if plain else ("file_name", "scenario_name"):
        reason = rig.set("recorder", **{key: name})
        assert key in reason and "must" in reason and reason.isprintable()
