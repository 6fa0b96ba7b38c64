"""The attacks of ``python -m bench.campaign``: hundreds of cases on files, few on nodes."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

import node_processes
from click.testing import CliRunner
from logs import write_log

from bench.campaign.__main__ import main
from bench.campaign.attack import LONGEST, Attack, Impossible, Outcome, run, run_case
from bench.campaign.damaged_logs import DamagedLogs
from bench.campaign.garbage_blocks import GarbageBlocks
from bench.campaign.hostile_names import HostileNames
from bench.campaign.mutated_tables import MutatedTables
from bench.campaign.mutated_yaml import MutatedYaml
from bench.campaign.parameter_sets import ParameterSets
from bench.campaign.running import Rig, clock_jumps
from bench.campaign.running.clock_jumps import ClockJumps
from bench.campaign.running.concurrent_clients import ConcurrentClients
from bench.campaign.running.on_nodes import Loss, compare_all, logged
from bench.mutants import ROOT, with_machine_code
from helmet_sim_ros import ImpactSetup

#: The same for everybody; ``python -m bench.campaign --seed`` tries others.
SEED = 17


@pytest.mark.parametrize(
    ("attack", "cases"),
    [
        (DamagedLogs, 150),
        (MutatedYaml, 300),
        (MutatedTables, 500),
        (ParameterSets, 1000),
        (GarbageBlocks, 600),
        (HostileNames, 25),
    ],
)
def test_nothing_is_lost_and_nothing_else_fails(
    attack: type[Attack], cases: int, tmp_path: Path
) -> None:
    tally = run(attack(), SEED, range(cases), tmp_path / "attack")
    assert not tally.bad
    assert sum(tally.counts.values()) == cases
    assert tally.counts["refused"]
    # Next to no damage to a log is without any consequence.
    assert tally.counts["held"] or attack is DamagedLogs


class Broken(Attack):
    """An attack on something that does everything wrong."""

    name, what, cases = "broken", "", (10, 10)

    def prepare(self, folder):
        self.blob = b""

    def case(self, rng):
        how = rng.randrange(4)
        if how == 0:
            raise ZeroDivisionError("division by zero")
        if how == 1:
            return Outcome("lost", "a sample")
        if how == 2:
            self.blob = b"x" * 300_000_000
        if how == 3:
            end = time.process_time() + 1.1 * LONGEST
            while time.process_time() < end:
                pass
        return Outcome("refused")


def test_the_campaign_sees_foreign_errors_losses_hangs_and_memory(tmp_path: Path) -> None:
    attack = Broken()
    tally = run(attack, 1, range(1, 13), tmp_path / "attack")
    details = " ".join(outcome.detail for _, outcome in tally.bad)
    assert "ZeroDivisionError: division by zero (test_campaign.py line" in details
    assert "a sample" in details and "MB more memory" in details and "processor time" in details
    assert tally.slowest > LONGEST
    number, outcome = tally.bad[0]
    assert run_case(attack, 1, number)[0].verdict == outcome.verdict


class Late(Broken):
    """An attack that meets a loss, and whose nodes do not end then."""

    def case(self, rng):
        try:
            raise Loss("a sample is gone")
        except Loss:
            raise AssertionError("evaluator has not ended") from None


def test_what_came_first_is_told_beside_what_came_of_it(tmp_path: Path) -> None:
    (_, outcome), *_ = run(Late(), 1, range(1), tmp_path / "attack").bad
    assert "evaluator has not ended" in outcome.detail
    assert outcome.detail.endswith("after Loss: a sample is gone")


def deaf(rig: Rig, name: str) -> subprocess.Popen[bytes]:
    """A process of a rig that ends by SIGKILL only: it sleeps for longer than anybody waits."""
    code = "import signal, time; signal.signal(2, signal.SIG_IGN); print(); time.sleep(600)"
    with (rig.folder / f"{name}.txt").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-X", "faulthandler", "-u", "-c", code],
            stdout=subprocess.PIPE, stderr=said,
        )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()
    rig.processes[name] = process
    return process


def test_nodes_that_do_not_end_are_ended_all_and_say_where_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node_processes, "ENDED", 0.2)
    rig = Rig(tmp_path)
    rig.node = SimpleNamespace(destroy_node=lambda: None)
    processes = [deaf(rig, "first"), deaf(rig, "second")]
    with pytest.raises(AssertionError) as told:
        rig.__exit__(None, None, None)
    for name in ("first", "second"):
        assert f"{name} has not ended after SIGINT" in str(told.value)
    assert str(told.value).count('File "<string>", line 1') == 2
    assert [process.wait(10) for process in processes] == [-signal.SIGABRT] * 2


def test_the_command_prints_a_table_and_how_to_repeat_a_case() -> None:
    run_twice = [
        CliRunner().invoke(main, ["--only", "parameter sets", "--cases", "40", "--seed", "3"])
        for _ in range(2)
    ]
    assert run_twice[0].exit_code == 0
    assert "parameter sets" in run_twice[0].output and "seed 3" in run_twice[0].output
    rows = [answer.output.splitlines()[-2] for answer in run_twice]
    assert rows[0] == rows[1]


def test_nothing_is_lost_of_running_nodes(tmp_path: Path) -> None:
    tally = run(ConcurrentClients(), SEED, range(2), tmp_path / "attack")
    assert not tally.bad, tally.bad
    assert sum(tally.counts.values()) == 2


def test_what_a_log_lacks_or_has_otherwise_is_a_loss(tmp_path: Path) -> None:
    right = ImpactSetup(rig="headform", duration=2e-3, time_step=1e-4)
    other = right.replaced({"normal_velocity": 6.0})
    write_log(tmp_path / "a.mcap", [right, right])
    found = logged(tmp_path)
    compare_all(found, {"test-0": right, "test-1": right})
    for ran, loss in (({"test-1": other}, "another setup"), ({"test-2": right}, "not in the log")):
        with pytest.raises(Loss, match=loss):
            compare_all(found, ran)
    # The setup is right, and the samples are those of another.
    found["test-0"].__dict__["setup"] = other.described()
    with pytest.raises(Loss, match="other samples"):
        compare_all(found, {"test-0": other})
    shutil.copy(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with pytest.raises(Loss, match="twice"):
        logged(tmp_path)
    (tmp_path / "none").mkdir()
    write_log(tmp_path / "none" / "c.mcap", [right], judged=False)
    with pytest.raises(Loss, match="no criteria in the log: and it does not say why"):
        compare_all(logged(tmp_path / "none"), {"test-0": right})


class NotHere(Broken):
    """An attack that this machine does not allow."""

    def prepare(self, folder):
        raise Impossible("mount: permission denied")


def test_an_attack_that_cannot_be_tried_is_skipped_and_says_why(tmp_path: Path) -> None:
    tally = run(NotHere(), 1, range(3), tmp_path / "attack")
    assert tally.words == "skipped: mount: permission denied"
    assert not tally.counts and not tally.bad


def test_clocks_that_cannot_jump_are_skipped_and_ones_that_did_not_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    attack, now = ClockJumps(), datetime.now(UTC)
    attack.logs = tmp_path
    (tmp_path / f"impacts_{now:%Y%m%dT%H%M%SZ}.mcap").touch()
    attack._check_name(now)
    with pytest.raises(Loss, match="the clock of the recorder"):
        attack._check_name(now + timedelta(days=1))
    monkeypatch.setattr(clock_jumps, "PLACES", ())
    tally = run(ClockJumps(), 1, range(3), tmp_path / "attack")
    assert "libfaketime" in tally.skipped and not tally.counts


def test_mutants_know_what_machine_code_is_built_from() -> None:
    """Functions, and the modules of constants and types that those name; no configuration."""
    model = Path("helmet_sim_ros", "model")
    built = with_machine_code(ROOT)
    assert {model / "loop.py", model / "layout.py", model / "force" / "contact.py"} <= built
    assert not {model / "setup.py", model / "forms.py", model / "urdf.py"} & built
