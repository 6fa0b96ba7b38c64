"""The simulation node: one configured impact at a time, steered and watched from outside.

Frames of the topics: see :mod:`helmet_sim_ros.nodes.conversion`. Stamps are simulation time, which
never runs backwards while the process lives; /clock tells it also while nothing moves.
"""

from __future__ import annotations

import json
import time
import uuid
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import from_block
from helmet_sim_ros.errors import HelmetSimError, NodeError
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST, setup_digest
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.live_view import LiveView, SimulationClock
from helmet_sim_ros.nodes.outgoing import Outgoing
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS
from helmet_sim_ros.nodes.process import WALL, answering, run_node
from helmet_sim_ros.nodes.qos import LATCHED, SAMPLES_IN_FLIGHT, SAMPLES_WRITER, SERVICE
from helmet_sim_ros.nodes.run_control import RunControl
from helmet_sim_ros.nodes.setup_parameters import SimulationConfig, declare

#: Most samples in one block: a few milliseconds of computing, and about 90 kB.
BLOCK = 100
#: How often the number of connected readers is looked at [s].
WATCH_PERIOD = 0.1


class SimulationNode(Node):
    """Serves ``~/run_impact`` and everything that is said while an impact runs."""

    def __init__(self) -> None:
        super().__init__("simulation", **NODE_OPTIONS)
        self._control = RunControl(self)
        self._settings = declare(self, self._busy_reason)
        first = Impact(self._settings.value.setup)
        first.advance(1)  # compile now, not in the first impact
        self._simulation_clock = SimulationClock(self)
        self._live = LiveView(self, self._simulation_clock)
        self._live.robot.describe(first.model)
        self._samples = self.create_publisher(Float64MultiArray, samples.TOPIC, SAMPLES_WRITER)
        self._status = self.create_publisher(DiagnosticStatus, "~/status", LATCHED)
        self._process = uuid.uuid4().hex[:8]
        self._count = 0
        self._state: dict[str, Any] = {"impact_id": "", "done": 0, "total": 0, "readers": 0}
        group = ReentrantCallbackGroup()
        for name, kind, callback in (
            ("run_impact", Trigger, self._run_impact),
            ("pause", SetBool, self._pause),
            ("step", Trigger, self._step),
            ("cancel", Trigger, self._cancel),
            ("reset", Trigger, self._reset),
        ):
            self.create_service(
                kind, f"~/{name}", callback, qos_profile=SERVICE, callback_group=group
            )
        self.create_timer(WATCH_PERIOD, self._watch, clock=WALL)
        self._tell("idle")

    # services

    @answering
    async def _run_impact(self, request: Any) -> str:
        if self._control.running:
            raise NodeError(self._busy_reason())
        self._control.begin()
        self._count += 1
        impact_id = f"{self._process}-{self._count:04d}"
        try:
            result = await self._impact(impact_id, self._settings.value)
            self._tell("idle")
        except HelmetSimError as error:
            self._tell(f"impact {impact_id} failed: {error}", DiagnosticStatus.WARN)
            raise
        finally:
            self._control.end()
        return json.dumps(result)

    @answering
    def _pause(self, request: Any) -> str:
        self._control.pause(request.data)
        if self._control.running:
            self._tell("paused" if request.data else "running")
        return "paused" if request.data else "running"

    @answering
    async def _step(self, request: Any) -> str:
        if not self._control.running:
            raise NodeError("no impact is running")
        if not self._control.paused:
            raise NodeError("only while paused; call pause first")
        await self._control.step()
        return f"{self._state['done']} of {self._state['total']} samples"

    @answering
    async def _cancel(self, request: Any) -> str:
        if not self._control.running:
            raise NodeError("no impact is running")
        self._control.cancel("cancelled by a client")
        await self._control.idle()
        return f"cancelled impact {self._state['impact_id']}"

    @answering
    async def _reset(self, request: Any) -> str:
        self._control.pause(False)
        self._control.cancel("reset by a client")
        await self._control.idle()
        self._tell("idle")
        return "ready; parameters are kept, simulation time goes on"

    # the impact

    async def _impact(self, impact_id: str, config: SimulationConfig) -> dict[str, Any]:
        """Compute and publish one impact, slice by slice."""
        began = time.monotonic()
        setup, live = config.setup, config.live
        impact = Impact(setup)
        self._live.robot.describe(impact.model)
        start_time = self._simulation_clock.next_start() * 1e-9
        stride = max(1, round(1.0 / (live.publish_rate * setup.time_step)))
        described = setup.described()
        outgoing = Outgoing(self, self._samples, SAMPLES_IN_FLIGHT)
        digest = setup_digest(described)
        self._state |= {"impact_id": impact_id, "done": 0, "total": impact.total}
        self._tell("paused" if self._control.paused else "running")

        def block(first: int, last: int, **extra: Any) -> Block:
            return Block(
                impact_id, first, impact.total, start_time, tuple(impact.labels),
                impact.block(first, last), **extra,
            )  # fmt: skip

        pause, done = 0.0, 0
        try:
            while done < impact.total:
                await self._control.permit(pause)
                slice_began = time.monotonic()
                stepwise = self._control.paused or live.real_time_factor > 0.0
                last = impact.advance(min(stride, BLOCK) if stepwise else BLOCK)
                heading: dict[str, Any] = {}
                if done == 0:
                    heading = {"setup": described, "model": impact.model_xml()}
                    heading[SETUP_DIGEST] = digest
                if last == impact.total:
                    heading["extras"] = impact.extras()
                part = block(done, last, **heading)
                await outgoing.send(samples.to_message(part))
                shown = part.data[-done % stride :: stride]
                self._live.show(setup, from_block(list(part.labels), shown, described), start_time)
                self._control.slice_done()
                if live.real_time_factor > 0.0:
                    pause = (last - done) * setup.time_step / live.real_time_factor
                    pause -= time.monotonic() - slice_began
                self._state["done"] = done = last
        except HelmetSimError as error:
            await outgoing.send(samples.to_message(block(done, done, aborted=str(error))))
            raise
        record = impact.record()
        self._simulation_clock.advance(
            round(start_time * 1e9) + round(float(record.time[-1]) * 1e9)
        )
        await outgoing.acknowledged()
        return {
            "impact_id": impact_id,
            "samples": impact.total,
            SETUP_DIGEST: digest,
            "peak_g": evaluate(record).peak_g.value,
            "start_time": start_time,
            "wall_s": round(time.monotonic() - began, 4),
        }

    # what is told

    def _busy_reason(self) -> str:
        """Why nothing may be changed or started now; ``""`` if it may."""
        if not self._control.running:
            return ""
        state = self._state
        return f"busy: impact {state['impact_id']} runs ({state['done']} of {state['total']})"

    def _watch(self) -> None:
        readers = self._samples.get_subscription_count()
        if readers != self._state["readers"]:
            self._tell(self._said)

    def _tell(self, message: str, level: bytes = DiagnosticStatus.OK) -> None:
        self._said = message
        self._state["readers"] = self._samples.get_subscription_count()
        values = [KeyValue(key=k, value=str(v)) for k, v in self._state.items()]
        self._status.publish(
            DiagnosticStatus(level=level, name="simulation", message=message, values=values)
        )


def main(args: list[str] | None = None) -> int:
    """Entry point of ``simulation_node``."""
    return run_node("simulation", SimulationNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
