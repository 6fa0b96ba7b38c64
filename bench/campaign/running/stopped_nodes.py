"""Nodes that stand still for a while: SIGSTOP, and SIGCONT later."""

from __future__ import annotations

import json
import random
import signal

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import OnNodes, compare_all, random_setups, run_setups, waited
from helmet_sim_ros.nodes.setup_parameters import parameter_values

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
        setups = random_setups(rng, IMPACTS)
        rig.set(**parameter_values(setups[0]))
        call = rig.ask("simulation/run_impact")
        rig.serve(rng.uniform(0.0, 0.1))
        process = rig.processes[victim]
        process.send_signal(signal.SIGSTOP)
        try:
            rig.serve(rng.uniform(0.1, LONGEST))
        finally:
            process.send_signal(signal.SIGCONT)
        answer = waited(rig, call)
        if not answer.success:
            return Outcome("lost", f"{victim} stood still: {answer.message}")
        first = json.loads(answer.message)["impact_id"]
        ran = {first: setups[0]} | run_setups(rig, setups[1:])
        compare_all(self.finished(rig), ran)
        self.cleared()
        return Outcome("held", f"{victim} stood still")
