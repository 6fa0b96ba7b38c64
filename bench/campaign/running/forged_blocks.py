"""Garbage and forged messages on ``impact/samples`` while impacts run."""

from __future__ import annotations

import json
import random
from pathlib import Path

from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from bench.campaign.attack import Outcome
from bench.campaign.garbage_blocks import HEADERS, ODD
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import OnNodes, compare, logged, random_setup, waited
from helmet_sim_ros import ImpactSetup, open_log, simulate
from helmet_sim_ros.biomech.record import block_labels, to_block
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.qos import SAMPLES_WRITER
from helmet_sim_ros.nodes.setup_parameters import parameter_values

IMPACTS = 3


class ForgedBlocks(OnNodes):
    """An impact is in the log with its own samples and criteria, or incomplete and said to be."""

    name = "forged blocks"
    what = "garbage, and blocks of the running and of other impacts, sent by a stranger"
    cases = (4, 250)

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        record = simulate(ImpactSetup(duration=2e-3, time_step=1e-4, rig="headform"))
        self._labels, self._data = tuple(block_labels(record.joint_names)), to_block(record)
        self._setup = dict(record.setup)

    def _begun(self) -> Rig:
        rig = super()._begun()
        self._sender = rig.node.create_publisher(Float64MultiArray, samples.TOPIC, SAMPLES_WRITER)
        rig.until(lambda: self._sender.get_subscription_count() == 2)
        return rig

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        ran, forged = {}, 0
        for _ in range(IMPACTS):
            setup = random_setup(rng)
            if reason := rig.set(**parameter_values(setup)):
                return Outcome("lost", f"a good setup was refused: {reason}")
            call = rig.ask("simulation/run_impact")
            while not call.done():
                for _ in range(rng.randrange(3)):
                    running = rig.status["simulation"]["impact_id"]
                    self._sender.publish(self._message(running or "x", rng))
                    forged += 1
                rig.serve(0.002)
            answer = waited(rig, call)
            if not answer.success:
                return Outcome("lost", f"an impact failed: {answer.message}")
            ran[json.loads(answer.message)["impact_id"]] = setup
        # Once all are judged, nothing is on its way to the recorder but what finish waits for.
        rig.until(lambda: set(ran) <= set(rig.criteria))
        answer = waited(rig, rig.ask("recorder/finish"))
        if not answer.success and "no log is open" not in answer.message:
            return Outcome("lost", f"the log was not finished: {answer.message}")
        found, incomplete = logged(self.logs), 0
        problems = self._problems()
        for impact_id, setup in ran.items():
            try:
                if impact_id in found:
                    compare(found[impact_id], setup)
                    continue
                said = problems
            except LogError as error:  # what stands there instead of criteria
                said = str(error)
            if f"impact {impact_id}" not in said or "incomplete" not in said:
                return Outcome("lost", f"{impact_id} is gone and nobody says so: {said:.200}")
            incomplete += 1
        rig.criteria.clear()
        self.cleared()
        detail = f"{forged} forged messages, {incomplete} of {len(ran)} impacts incomplete"
        return Outcome("refused" if incomplete else "held", detail)

    def _problems(self) -> str:
        """What the logs say of impacts that are not complete."""
        logs = [open_log(path) for path in self.logs.glob("*.mcap")]
        return " ".join(problem for log in logs for problem in log.problems)

    def _message(self, running: str, rng: random.Random) -> Float64MultiArray:
        """What a stranger sends; never the complete impact that is running, which none could tell
        from the true one."""
        how = rng.randrange(5)
        if how == 0:
            return Float64MultiArray(data=[rng.random()] * rng.randrange(20))
        if how == 1:
            return _raw(rng.choice([*HEADERS, json.dumps(rng.choice(ODD))]), "a,b", [1.0, 2.0])
        first = rng.randrange(len(self._data))
        last = rng.randrange(first, len(self._data))
        name = running if how == 2 else f"forged-{rng.randrange(10**6)}"
        block = Block(
            name, first, len(self._data) + rng.randrange(2), rng.uniform(0.0, 100.0), self._labels,
            self._data[first:last], setup=self._setup if how == 4 else None,
            aborted="forged" if how == 3 and rng.random() < 0.1 else None,
        )  # fmt: skip
        return samples.to_message(block)


def _raw(header: str, labels: str, data: list[float]) -> Float64MultiArray:
    """A message like one of samples, with any header."""
    message = Float64MultiArray(data=data)
    text = header.encode("utf-8", "replace").decode().replace("\x00", "?")
    message.layout.dim = [
        MultiArrayDimension(label=text, size=1), MultiArrayDimension(label=labels, size=2)
    ]  # fmt: skip
    return message
