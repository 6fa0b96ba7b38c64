"""The simulation node: one configured impact or fall at a time, steered and watched from outside.

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
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord, from_block
from helmet_sim_ros.errors import HelmetSimError, NodeError
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST
from helmet_sim_ros.model.simulate import begun
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.live_view import LiveView, SimulationClock
from helmet_sim_ros.nodes.outgoing import Outgoing
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS
from helmet_sim_ros.nodes.process import answering, run_node
from helmet_sim_ros.nodes.qos import LATCHED, SAMPLES_IN_FLIGHT, SAMPLES_WRITER, SERVICE
from helmet_sim_ros.nodes.run_control import RunControl
from helmet_sim_ros.nodes.setup_parameters import (
    FALL,
    IMPACT,
    KIND,
    SERVICES,
    SimulationConfig,
    declare,
    kind_of,
)
from helmet_sim_ros.nodes.slices import Slices, Thinning


class SimulationNode(Node):
    """Serves ``~/run_impact`` and ``~/run_fall``, and all that is said while one of them runs."""

    def __init__(self) -> None:
        super().__init__("simulation", **NODE_OPTIONS)
        self._control = RunControl(self)
        self._settings = declare(self, self._busy_reason)
        first = begun(self._settings.value.setup)
        first.advance(1)  # compile now, not in the first impact
        self._simulation_clock = SimulationClock(self)
        self._live = LiveView(self, self._simulation_clock)
        self._live.robot.describe(first.model)
        self._status = self.create_publisher(DiagnosticStatus, "~/status", LATCHED)
        self._process = uuid.uuid4().hex[:8]
        self._count = 0
        self._state: dict[str, Any] = {"kind": "", "impact_id": "", "done": 0, "total": 0}
        self._state["readers"] = 0
        group = ReentrantCallbackGroup()
        for name, kind, callback in (
            ("run_impact", Trigger, self._run_impact),
            ("run_fall", Trigger, self._run_fall),
            ("pause", SetBool, self._pause),
            ("step", Trigger, self._step),
            ("cancel", Trigger, self._cancel),
            ("reset", Trigger, self._reset),
        ):
            self.create_service(
                kind, f"~/{name}", callback, qos_profile=SERVICE, callback_group=group
            )
        self._samples = self.create_publisher(
            Float64MultiArray, samples.TOPIC, SAMPLES_WRITER,
            event_callbacks=PublisherEventCallbacks(matched=self._reader_changed),
        )  # fmt: skip
        self._tell("idle")

    # services

    @answering
    async def _run_impact(self, request: Any) -> str:
        return await self._run(IMPACT)

    @answering
    async def _run_fall(self, request: Any) -> str:
        return await self._run(FALL)

    async def _run(self, kind: str) -> str:
        if self._control.running:
            raise NodeError(self._busy_reason())
        config = self._settings.value
        described = kind_of(config.setup)
        if described != kind:
            raise NodeError(
                f"the parameters describe {_with_article(described)} ({KIND}), which "
                f"{SERVICES[described]} runs"
            )
        self._control.begin()
        self._count += 1
        impact_id = f"{self._process}-{self._count:04d}"
        try:
            result = await self._sliced(impact_id, config)
            self._tell("idle")
        except HelmetSimError as error:
            self._tell(f"{kind} {impact_id} failed: {error}", DiagnosticStatus.WARN)
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
            raise NodeError("no impact or fall is running")
        if not self._control.paused:
            raise NodeError("only while paused; call pause first")
        await self._control.step()
        return f"{self._how_far()} samples"

    @answering
    async def _cancel(self, request: Any) -> str:
        if not self._control.running:
            raise NodeError("no impact or fall is running")
        self._control.cancel("cancelled by a client")
        await self._control.idle()
        return f"cancelled {self._running()}"

    @answering
    async def _reset(self, request: Any) -> str:
        self._control.pause(False)
        self._control.cancel("reset by a client")
        await self._control.idle()
        self._tell("idle")
        return "ready; parameters are kept, simulation time goes on"

    # the impact or fall

    async def _sliced(self, impact_id: str, config: SimulationConfig) -> dict[str, Any]:
        """Compute and publish one impact or fall, slice by slice."""
        began = time.monotonic()
        setup, live = config.setup, config.live
        period = max(1, round(1.0 / (live.publish_rate * setup.time_step))) * setup.time_step
        start_time = self._simulation_clock.next_start() * 1e-9
        slices, thinning = Slices(setup, impact_id, start_time, period), Thinning(period)
        source = slices.source
        self._live.robot.describe(source.model)
        outgoing = Outgoing(self, self._samples, SAMPLES_IN_FLIGHT)
        self._state |= {"kind": kind_of(setup), "impact_id": impact_id}
        self._state |= {"done": 0, "total": _number(slices.total)}
        self._tell("paused" if self._control.paused else "running")
        pause = 0.0
        try:
            while not source.is_over:
                await self._control.permit(pause)
                slice_began, before = time.monotonic(), source.time
                part = slices.next(self._control.paused or live.real_time_factor > 0.0)
                await outgoing.send(samples.to_message(part))
                shown = part.data[thinning.chosen(part.data[:, part.labels.index("time")])]
                record = from_block(list(part.labels), shown, slices.setup)
                self._live.show(setup, record, start_time)
                self._control.slice_done()
                if live.real_time_factor > 0.0:
                    pause = (source.time - before) / live.real_time_factor
                    pause -= time.monotonic() - slice_began
                self._state |= {"done": slices.done, "total": _number(slices.total)}
        except HelmetSimError as error:
            await outgoing.send(samples.to_message(slices.aborted(str(error))))
            raise
        end = round(start_time * 1e9) + round(source.time * 1e9)
        self._simulation_clock.advance(end)
        await outgoing.acknowledged()
        return {
            "impact_id": impact_id,
            "samples": slices.done,
            SETUP_DIGEST: slices.digest,
            **_outcome(source.record(), kind_of(setup)),
            "start_time": start_time,
            "wall_s": round(time.monotonic() - began, 4),
        }

    # what is told

    def _busy_reason(self) -> str:
        """Why nothing may be changed or started now; ``""`` if it may."""
        if not self._control.running:
            return ""
        return f"busy: {self._running()} runs ({self._how_far()})"

    def _running(self) -> str:
        return f"{self._state['kind']} {self._state['impact_id']}"

    def _how_far(self) -> str:
        return f"{self._state['done']} of {self._state['total']}"

    def _reader_changed(self, event: Any) -> None:
        self._tell(self._said)

    def _tell(self, message: str, level: bytes = DiagnosticStatus.OK) -> None:
        self._said = message
        self._state["readers"] = self._samples.get_subscription_count()
        values = [KeyValue(key=k, value=str(v)) for k, v in self._state.items()]
        self._status.publish(
            DiagnosticStatus(level=level, name="simulation", message=message, values=values)
        )


def _with_article(kind: str) -> str:
    return {IMPACT: "an impact", FALL: "a fall"}[kind]


def _number(total: int | None) -> int | str:
    """How many samples there will be, in the status."""
    return "unknown" if total is None else total


def _outcome(record: ImpactRecord, kind: str) -> dict[str, Any]:
    """What the answer tells of the result: the peak of an impact, the head strikes of a fall."""
    if kind == IMPACT:
        return {"peak_g": evaluate(record, criteria=["peak_g"]).peak_g.value}
    from helmet_sim_ros.model.fall.strikes import head_strikes  # loads what only falls need

    found = head_strikes(record)
    peak = None if found.worst is None else found.worst.evaluation.peak_g.value
    return {"strikes": len(found), "peak_g": peak}


def main(args: list[str] | None = None) -> int:
    """Entry point of ``simulation_node``."""
    return run_node("simulation", SimulationNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
