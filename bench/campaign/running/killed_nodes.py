"""Nodes that get SIGKILL at a random instant while impacts run, and are started again."""

from __future__ import annotations

import json
import random
import signal
import time
from typing import Any, ClassVar

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.kills import shared_memory
from bench.campaign.running.on_nodes import (
    FORGOTTEN,
    OnNodes,
    compare,
    compare_all,
    random_setups,
    run_setups,
)
from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.nodes.setup_parameters import parameter_values

#: Latest instant of a kill [s]; by then some ten impacts have been run.
LATEST = 1.0
#: What a node publishes; while it is known, so is the node.
TOPICS = {
    "simulation": "impact/samples",
    "evaluator": "evaluation/criteria",
    "recorder": "recorder/status",
    "scenario": "scenario/progress",
}
MATRIX = """
common: {impact: {rig: headform}, sim: {duration: 0.01, time_step: 1.0e-4}}
product: {impact.normal_velocity: [2, 3, 4, 5, 6, 7]}
"""


class KilledNodes(OnNodes):
    """What was told as on disk is there, and the others go on when the killed one is back."""

    name = "killed nodes"
    what = "SIGKILL of one of the four nodes while impacts run; then a new one"
    cases = (4, 160)
    kinds = ("simulation", "evaluator", "recorder", "scenario")
    parameters: ClassVar[dict[str, Any]] = {"max_impacts": 5}

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        victim = rng.choice(self.kinds)
        shared = shared_memory()
        answered, told = self._until_killed(rig, rng, victim)
        self._again(rig, victim)
        if victim == "scenario":
            answer = rig.call("scenario/run")
            if not answer.success:
                return Outcome("lost", f"{victim} killed: the next run: {answer.message}")
        after = run_setups(rig, random_setups(rng, 2))
        found = self.finished(rig)
        for impact_id in told - set(found):
            return Outcome("lost", f"{victim} killed: {impact_id} was told as on disk")
        for impact_id, setup in answered.items():
            if impact_id in found:
                compare(found[impact_id], setup, judged=False)
            elif victim != "recorder":  # which may lose what it has not told yet
                return Outcome("lost", f"{victim} killed: {impact_id} is not in the log")
        compare_all(found, after)
        if left := shared_memory() - shared:
            return Outcome("lost", f"{victim} killed: left in shared memory: {left}")
        self.cleared()
        return Outcome("held", f"{victim} killed, {len(told)} told, {len(answered)} answered")

    def start(self, rig: Rig, kind: str) -> None:
        if kind != "scenario":
            super().start(rig, kind)
            return
        matrix = self.home / "matrix.yaml"
        matrix.write_text(MATRIX, encoding="utf-8")
        rig.start(kind, scenario__file=str(matrix))

    def _until_killed(
        self, rig: Rig, rng: random.Random, victim: str
    ) -> tuple[dict[str, ImpactSetup], set[str]]:
        """Run impacts until a node is killed: those answered, and those told as on disk."""
        answered: dict[str, ImpactSetup] = {}
        told: set[str] = set()
        known = rig.status["recorder"]["impact_id"]  # of the case before
        if victim == "scenario":
            rig.ask("scenario/run")
        deadline = time.monotonic() + rng.uniform(0.0, LATEST)
        while time.monotonic() < deadline:
            if victim != "scenario":
                (setup,) = random_setups(rng, 1)
                rig.set(**parameter_values(setup))
                call = rig.ask("simulation/run_impact")
            while time.monotonic() < deadline and (victim == "scenario" or not call.done()):
                rig.serve(0.005)
                told.add(rig.status["recorder"]["impact_id"])
            if victim != "scenario" and call.done() and call.result().success:
                answered[json.loads(call.result().message)["impact_id"]] = setup
        rig.stop(victim, signal.SIGKILL)
        return answered, told - {"", known}

    def _again(self, rig: Rig, victim: str) -> None:
        """Start the killed node again, once the middleware has forgotten the old one."""
        rig.until(lambda: not rig.node.count_publishers(TOPICS[victim]), FORGOTTEN)
        if victim in ("evaluator", "recorder"):
            rig.until(lambda: rig.status["simulation"].get("readers") == "1", FORGOTTEN)
        self.start(rig, victim)
        self.connected(rig)
        rig.until(lambda: rig.status["simulation"]["message"] == "idle", FORGOTTEN)
