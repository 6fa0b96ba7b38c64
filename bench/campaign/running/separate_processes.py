"""Impacts through separate processes, one after the other, nobody waiting for anybody."""

from __future__ import annotations

import random

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import OnNodes, compare_all, random_setups, run_setups

#: Impacts of a case, all in one log.
IMPACTS = 20


class SeparateProcesses(OnNodes):
    """Samples and criteria of every impact are in the log, bit for bit those of one process."""

    name = "separate processes"
    what = f"{IMPACTS} random impacts at a stretch, each against the same in this process"
    cases = (5, 500)

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        ran = run_setups(rig, random_setups(rng, IMPACTS))
        found = self.finished(rig)
        if set(found) - set(ran):
            return Outcome("lost", f"impacts that nobody ran: {sorted(set(found) - set(ran))}")
        compare_all(found, ran)
        self.cleared()
        return Outcome("held", f"{len(ran)} impacts")
