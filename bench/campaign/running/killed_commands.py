"""``helmet-sim run`` ended at a random instant: by SIGKILL, SIGTERM or Ctrl-C."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from bench.campaign.attack import Attack, Outcome
from bench.campaign.running import claim_domain
from bench.campaign.running.kills import ended_by, shared_memory
from bench.campaign.running.on_nodes import compare, logged
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.study import load_scenario

MATRIX = """
common: {impact: {rig: headform}, sim: {duration: 0.01, time_step: 1.0e-4}}
product:
  impact.normal_velocity: [2, 3, 4, 5, 6, 7]
  impact.direction: [front, back, left, right, top]
"""
#: Latest instant of the signal [s]: the nodes need some seconds to come up.
LATEST = 12.0
#: How long all processes may take to end [s]; a recorder finishes its log.
ENDED = 60.0
#: What the next command does first with what a killed one could not remove.
NEXT_START = "from helmet_sim_ros.cli._processes import remove_abandoned_folders as r; r()"


class KilledCommands(Attack):
    """No process and no shared memory is left, the next start clears up, the log is recoverable."""

    name = "killed commands"
    what = "helmet-sim run gets SIGKILL, SIGTERM or SIGINT at a random instant"
    cases = (4, 40)
    bounded = False

    def prepare(self, folder: Path) -> None:
        self._folder = folder
        self._matrix = folder / "matrix.yaml"
        self._matrix.write_text(MATRIX, encoding="utf-8")
        self._setups = {
            setup_digest(setup.described()): setup for setup in load_scenario(self._matrix).setups
        }
        self._domain = claim_domain()

    def case(self, rng: random.Random) -> Outcome:
        kind = rng.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
        where = rng.choice(["--one-process", "--four-processes"])
        logs, temporary = self._folder / "logs", self._folder / "tmp"
        for folder in (logs, temporary):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        environment = os.environ | {"TMPDIR": str(temporary)}
        shared = shared_memory()
        process = subprocess.Popen(
            [sys.executable, "-m", "helmet_sim_ros", "run", str(self._matrix), where,
             "--output", str(logs), "--domain-id", str(self._domain)],
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        what = f"run {where} after {kind.name}"
        try:
            time.sleep(rng.uniform(0.0, LATEST))
            family = ended_by(process, kind, ENDED)
        finally:
            process.kill()
            process.wait()
        if family:
            return Outcome("lost", f"{what}: still there: {family}")
        if left := shared_memory() - shared:
            return Outcome("lost", f"{what}: left in shared memory: {left}")
        subprocess.run([sys.executable, "-c", NEXT_START], env=environment, check=True)
        if folders := list(temporary.glob("helmet-sim-*")):
            return Outcome("lost", f"{what}: left for ever: {folders}")
        found = logged(logs)
        for impact in found.values():
            compare(impact, self._setups[setup_digest(impact.setup)], judged=False)
        return Outcome("held", f"{what}: {len(found)} impacts")
