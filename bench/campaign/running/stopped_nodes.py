"""Nodes that stand still for a while: SIGSTOP, and SIGCONT later."""

from __future__ import annotations

import random

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import (
    OnNodes,
    compare_all,
    halt,
    random_setups,
    run_setup,
    run_setups,
)

IMPACTS = 4
#: Longest halt [s]; a reader that hangs for 30 s is given up.
LONGEST = 3.0


class StoppedNodes(OnNodes):
    """A node that goes on where it stood has missed nothing."""

    name = "stopped nodes"
    what = "SIGSTOP of a node while impacts run, SIGCONT up to 3 s later"
    cases = (4, 200)

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        victim = rng.choice(self.kinds)
        first, *others = random_setups(rng, IMPACTS)

        def stand_still() -> None:
            rig.serve(rng.uniform(0.0, 0.1))
            halt(rig, rig.processes[victim], rng.uniform(0.1, LONGEST))

        ran = {run_setup(rig, first, stand_still)["impact_id"]: first} | run_setups(rig, others)
        compare_all(self.finished(rig), ran)
        self.cleared()
        return Outcome("held", f"{victim} stood still")
