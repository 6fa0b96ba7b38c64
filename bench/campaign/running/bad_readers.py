"""Subscribers that are slow, stand still or die while impacts run."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import (
    FORGOTTEN,
    OnNodes,
    compare_all,
    halt,
    random_setup,
    random_setups,
    run_setup,
    run_setups,
)
from helmet_sim_ros.cli._processes import end_with_parent

READER = Path(__file__).with_name("bad_reader.py")
IMPACTS = 6
#: Longest time that a reader takes for a message [s].
SLOWEST = 0.05
#: Longest halt of one that stands still [s].
LONGEST = 3.0


class BadReaders(OnNodes):
    """However others read, the log has every impact."""

    name = "bad readers"
    what = "another subscriber of samples and criteria is slow, stands still for 3 s, or is killed"
    cases = (4, 100)

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        kind = rng.choice(["slow", "still", "killed"])
        history = rng.choice(["all", "last"])
        reader = subprocess.Popen(
            [sys.executable, str(READER), str(rng.uniform(0.0, SLOWEST)), history],
            preexec_fn=end_with_parent(),
        )  # fmt: skip
        try:
            rig.until(lambda: rig.status["simulation"]["readers"] == "3", FORGOTTEN)
            ran = run_setups(rig, random_setups(rng, 1))
            if kind == "still":
                setup, seconds = random_setup(rng), rng.uniform(0.0, LONGEST)
                answer = run_setup(rig, setup, lambda: halt(rig, reader, seconds))
                ran[answer["impact_id"]] = setup
            elif kind == "killed":
                reader.kill()
            ran |= run_setups(rig, random_setups(rng, IMPACTS))
        finally:
            reader.kill()
            reader.wait()
        compare_all(self.finished(rig), ran)
        self.connected(rig)
        self.cleared()
        return Outcome("held", f"a reader that is {kind} and keeps {history}")
