"""Clients that set parameters and run impacts at once, none knowing of the others."""

from __future__ import annotations

import json
import random
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import (
    ANSWERED,
    OnNodes,
    compare_all,
    random_setups,
    served_until,
)
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.nodes.qos import SERVICE
from helmet_sim_ros.nodes.setup_parameters import parameter_values

CLIENTS = 3
#: Calls of a case, about half of them impacts.
CALLS = 20


class ConcurrentClients(OnNodes):
    """Every call is answered, and what ran is what is reported: one client's setup, whole."""

    name = "concurrent clients"
    what = f"{CALLS} calls of {CLIENTS} clients in bursts: parameters set, impacts run"
    cases = (6, 50)

    _nodes: tuple[Any, ...] | list[Any] = ()

    def _begun(self) -> Rig:
        rig = super()._begun()
        self._nodes = [rclpy.create_node(f"client_{number}") for number in range(CLIENTS)]
        self._clients = []
        for node in self._nodes:
            rig._executor.add_node(node)
            setter = node.create_client(
                SetParametersAtomically, "simulation/set_parameters_atomically", qos_profile=SERVICE
            )
            runner = node.create_client(Trigger, "simulation/run_impact", qos_profile=SERVICE)
            self._clients.append((setter, runner))
        rig.until(lambda: all(c.service_is_ready() for pair in self._clients for c in pair))
        return rig

    def _end(self) -> None:
        for node in self._nodes:
            node.destroy_node()
        self._nodes = []
        super()._end()

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        setups = random_setups(rng, CALLS)
        # What stands there from the case before may run as well.
        (first,) = random_setups(rng, 1)
        if reason := rig.set(**parameter_values(first)):
            return Outcome("lost", f"a good setup was refused: {reason}")
        known = {setup_digest(setup.described()): setup for setup in [first, *setups]}
        sets, runs = [], []
        for setup in setups:
            setter, runner = rng.choice(self._clients)
            if rng.random() < 0.5:
                sets.append(setter.call_async(_request(parameter_values(setup))))
            else:
                runs.append(runner.call_async(Trigger.Request()))
            if rng.random() < 0.3:
                rig.serve(rng.uniform(0.0, 0.1))
        served_until(rig, lambda: all(call.done() for call in [*sets, *runs]), ANSWERED)
        silent = [sum(not call.done() for call in calls) for calls in (sets, runs)]
        if any(silent):
            return Outcome("lost", f"no answer to {silent[0]} sets of parameters, {silent[1]} runs")
        refused = [c.result().result.reason for c in sets if not c.result().result.successful]
        refused += [c.result().message for c in runs if not c.result().success]
        if strange := [reason for reason in refused if "busy" not in reason]:
            return Outcome("lost", f"refused, but nothing was busy: {strange[0]!r}")
        ran = {}
        for answer in (call.result() for call in runs if call.result().success):
            told = json.loads(answer.message)
            if told["setup_digest"] not in known:
                return Outcome("lost", f"{told['impact_id']} ran with a setup that nobody set")
            ran[told["impact_id"]] = known[told["setup_digest"]]
        found = self.finished(rig) if ran else {}
        if set(found) - set(ran):
            return Outcome("lost", f"logged, but not answered: {sorted(set(found) - set(ran))}")
        compare_all(found, ran)
        self.cleared()
        detail = f"{len(ran)} impacts, {len(refused)} of {CALLS} calls refused as busy"
        return Outcome("refused" if refused else "held", detail)


def _request(values: dict[str, Any]) -> Any:
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return SetParametersAtomically.Request(parameters=parameters)
