"""The recorder node: every impact into an MCAP log that any ROS 2 tool opens."""

from __future__ import annotations

import json
import time
from collections import OrderedDict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from helmet_sim_ros.errors import HelmetSimError, IncompleteError, LogError, NodeError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler, Block
from helmet_sim_ros.mcap_log.criteria import digest_of
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.conversion import nanoseconds
from helmet_sim_ros.nodes.log_session import CRITERIA_TOPIC, STRIKES_TOPIC, LogSession
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS, Parameters
from helmet_sim_ros.nodes.process import WALL, answering, next_round, run_node, wait
from helmet_sim_ros.nodes.qos import CRITERIA_READER, LATCHED, SAMPLES_READER, SERVICE
from helmet_sim_ros.nodes.recorder_config import (
    RecorderConfig,
    check_inside,
    check_writable,
    free_path,
)
from helmet_sim_ros.schema import leaves

#: ``~/finish`` waits for what is still on its way: until all samples that have arrived are taken,
#: every impact has its criteria or a reason, and nothing is open, or something is open but no
#: samples came for ``PATIENCE``; at most ``LONGEST`` [s].
PATIENCE = 3.0
LONGEST = 60.0
#: How long after its start, or after the last evaluator has gone, this node may not yet know of
#: one that runs [s].
DISCOVERY = 10.0
#: How long an impact waits for its criteria after the evaluator was last heard [s].
CRITERIA_TIMEOUT = 30.0
#: Criteria kept for impacts whose samples have not been written yet: more than the 5000 blocks that
#: Fast DDS may hold unread for this node where the user chose profiles of his own.
CRITERIA_KEPT = 6000
#: Criteria kept that are written already: of as many impacts as an assembler knows to have ended.
TOLD_KEPT = 100
#: How often the node looks whether anybody sends at all [s].
WATCH_PERIOD = 0.2


class _Judged(NamedTuple):
    """Criteria or head strikes that arrived: their topic, digest of the setup, simulation time, the
    message as it came."""

    topic: str
    digest: str
    time_ns: int
    serialized: bytes


class _Awaiting(NamedTuple):
    """An impact that is written, but not yet judged."""

    session: LogSession
    digest: str
    complete: bool
    since: float


class RecorderNode(Node):
    """Begins a file with the first impact; ends it on ``~/finish``, a limit, or a signal.

    ``~/status`` names the last impact that is on disk: every sample, the criteria (or, in words,
    why there are none), handed to the operating system before it is told.
    """

    def __init__(self) -> None:
        super().__init__("recorder", **NODE_OPTIONS)
        self._assembler = Assembler()
        self._session: LogSession | None = None
        self._retired: list[LogSession] = []  # full, but criteria for them are still on their way
        self._awaiting: dict[str, _Awaiting] = {}
        # Criteria by impact; the evaluator may well be ahead of this node.
        self._criteria: OrderedDict[str, _Judged] = OrderedDict()
        # Those that are written. A stranger's block ends an impact that then starts anew; where the
        # evaluator meets that block later, it has told its one verdict already.
        self._told: OrderedDict[str, _Judged] = OrderedDict()
        self._digest = ""  # of the setup of the impact that is being written
        self._seen = self._judged_last = time.monotonic()
        self._heard = 0.0  # when samples last arrived, wall time
        self._root: Path | None = None  # where logs may go
        self._last: dict[str, Any] = {"impact_id": "", "path": "", "impacts": 0, "criteria": ""}
        self._untold = False  # a log has ended by itself, and no client has asked for it since
        self._settings = Parameters(
            self, leaves(RecorderConfig), self._configuration,
            refuse=self._busy_reason, changed=self._moved,
        )  # fmt: skip
        self._place = self._settings.value.place
        self._status = self.create_publisher(DiagnosticStatus, "~/status", LATCHED)
        self.create_service(
            Trigger,
            "~/finish",
            self._finish,
            qos_profile=SERVICE,
            callback_group=ReentrantCallbackGroup(),
        )
        self.create_subscription(
            Float64MultiArray, samples.TOPIC, self._receive, SAMPLES_READER, raw=True
        )
        for topic in (CRITERIA_TOPIC, STRIKES_TOPIC):
            self.create_subscription(
                DiagnosticArray, topic, partial(self._judged, topic), CRITERIA_READER, raw=True
            )
        self.create_timer(WATCH_PERIOD, self._watch, clock=WALL)
        self._tell("waiting for an impact")

    def leaving(self) -> bool:
        """Whether what is written still waits for its criteria; the process wants to end."""
        return bool(self._awaiting)

    def close(self) -> None:
        """Finish the log, whatever is in it; the process ends."""
        try:
            self._close_log("the recorder was stopped")
        except LogError as error:
            self.get_logger().error(str(error))

    # what arrives

    def _receive(self, serialized: bytes) -> None:
        self._heard = time.monotonic()
        try:
            block = samples.from_message(deserialize_message(serialized, Float64MultiArray))
        except IncompleteError as error:
            self.get_logger().error(f"{samples.TOPIC}: {error}")
            return
        try:
            self._record(block, serialized)
        except HelmetSimError as error:
            self._failed(error)
        finally:
            self._heard = time.monotonic()

    def _record(self, block: Block, serialized: bytes) -> None:
        ended = self._assembler.feed(block)
        for impact in ended:
            if impact.impact_id != block.impact_id:
                self._end_impact(impact)
        mine = [impact for impact in ended if impact.impact_id == block.impact_id]
        expected = self._assembler.pending == block.impact_id
        if expected or block.aborted or any(impact.record for impact in mine):
            self._session_for(block).add(block, serialized)
            if block.first == 0:
                self._digest = block.setup_digest or ""
        for impact in mine:
            self._end_impact(impact)

    def _judged(self, topic: str, serialized: bytes) -> None:
        message = deserialize_message(serialized, DiagnosticArray)
        if not message.status:
            return
        self._judged_last = time.monotonic()
        stamp = message.header.stamp
        self._criteria[message.status[0].hardware_id] = _Judged(
            topic, digest_of(message), stamp.sec * 1_000_000_000 + stamp.nanosec, serialized
        )
        while len(self._criteria) > CRITERIA_KEPT:
            self._criteria.popitem(last=False)
        try:
            self._settle()
        except LogError as error:
            self._failed(error)

    def _watch(self) -> None:
        if self.count_publishers(CRITERIA_TOPIC):
            self._seen = time.monotonic()
        try:
            if self._assembler.pending and not self.count_publishers(samples.TOPIC):
                for impact in self._assembler.abandon("the simulation is gone"):
                    self._end_impact(impact)
            self._settle()
        except LogError as error:
            self._failed(error)

    # what is written

    def _session_for(self, block: Block) -> LogSession:
        """The file that this block belongs to; begins one where needed."""
        session = self._session
        if session is not None and block.first == 0:
            # A clock that starts again is another simulation: its times do not fit this file.
            again = nanoseconds(block.start_time, 0.0) <= session.end_ns
            if again or self._full(session):
                self._session = None
                self._retired.append(session)
                self._finish_retired()
        if self._session is None:
            config = check_writable(self._settings.value)
            self._session = LogSession(
                free_path(config), config, self.resolve_topic_name, self.get_logger().warning
            )
            self._last |= {"path": str(self._session.path), "impacts": 0}
            self._tell("recording")
        return self._session

    def _end_impact(self, impact: Assembled) -> None:
        if impact.problem:
            self.get_logger().warning(impact.problem)
        if self._session is not None:
            self._session.end_impact(impact)
            self._awaiting[impact.impact_id] = _Awaiting(
                self._session, self._digest, impact.record is not None, time.monotonic()
            )
            self._settle()

    def _settle(self) -> None:
        """Write criteria that have arrived, and tell which impacts are done with."""
        for impact_id, awaiting in list(self._awaiting.items()):
            judged = self._criteria.pop(impact_id, None)
            reason = self._no_criteria(awaiting, judged)
            if reason and judged is None and (judged := self._told.get(impact_id)) is not None:
                reason = self._no_criteria(awaiting, judged)
            if judged is not None or reason:
                del self._awaiting[impact_id]
                self._settled(impact_id, awaiting.session, judged, reason)
        self._finish_retired()
        settled = not self._awaiting and not self._assembler.pending
        if self._session and settled and self._full(self._session):
            self._close_log("")

    def _settled(
        self, impact_id: str, session: LogSession, judged: _Judged | None, reason: str
    ) -> None:
        """Write the criteria of an impact, or why it has none, and then tell that it is on disk."""
        message, level = "recording", DiagnosticStatus.OK
        if judged is not None and not reason:
            session.add_serialized_criteria(judged.time_ns, judged.serialized, judged.topic)
            self._told[impact_id] = judged
            while len(self._told) > TOLD_KEPT:
                self._told.popitem(last=False)
        else:
            session.note_no_criteria(impact_id, reason)
            message, level = f"impact {impact_id} has no criteria: {reason}", DiagnosticStatus.WARN
            self.get_logger().warning(message)
        self._last |= {"impact_id": impact_id, "impacts": session.impacts}
        self._last |= {"path": str(session.path), "criteria": reason or "logged"}
        self._tell(message, level)

    def _no_criteria(self, awaiting: _Awaiting, judged: _Judged | None) -> str:
        """Why an impact gets no criteria; empty while they may still come, or if they are right."""
        now = time.monotonic()
        if judged is not None:
            # Criteria that say what is missing have no setup.
            digests = {judged.digest, awaiting.digest} - {""}
            foreign = awaiting.complete and len(digests) == 2
            return "those that came are of another setup" if foreign else ""
        if self.count_publishers(CRITERIA_TOPIC):
            self._seen = now
        elif now < self._seen + DISCOVERY:  # the first or the next may not yet be discovered
            return ""
        else:
            return "no evaluator runs"
        if now > max(awaiting.since, self._judged_last) + CRITERIA_TIMEOUT:
            return f"the evaluator gave none within {CRITERIA_TIMEOUT:g} s"
        return ""

    def _full(self, session: LogSession) -> bool:
        config = self._settings.value
        many = 0 < config.max_impacts <= session.impacts
        return many or 0 < config.max_bytes <= session.size

    # how a file ends

    @answering
    async def _finish(self, request: Any) -> str:
        began = self._heard = time.monotonic()
        taken = 0.0
        await next_round(self)  # in the present one samples had their turn before this service
        while time.monotonic() < began + LONGEST:
            if self._on_its_way():
                await wait(self, Future(), 0.01)
            elif self._heard > taken:  # more may have arrived
                taken = self._heard
                await next_round(self)
            else:
                break
        if self._session is None and not self._retired and not self._untold:
            raise NodeError("no log is open")
        try:
            self._close_log("the log was finished by a client")
        except LogError as error:
            self._failed(error)
            raise
        self._untold = False
        return json.dumps(self._last)

    def _on_its_way(self) -> bool:
        if self._awaiting:
            return True  # not for ever: see _no_criteria
        return bool(self._assembler.pending) and time.monotonic() < self._heard + PATIENCE

    def _close_log(self, reason: str) -> None:
        """Finish what is open; an impact under way ends there."""
        session, self._session = self._session, None
        waiting, self._awaiting = self._awaiting, {}
        if session is not None:
            self._retired.append(session)
            for impact in self._assembler.abandon(reason):
                session.end_impact(impact)
        for impact_id, awaiting in waiting.items():
            awaiting.session.note_no_criteria(impact_id, reason or "the log was finished before")
        self._finish_retired()

    def _finish_retired(self) -> None:
        """Finish every file whose impacts all have their criteria."""
        for session in list(self._retired):
            if not any(awaiting.session is session for awaiting in self._awaiting.values()):
                self._retired.remove(session)
                self._finished(session)

    def _finished(self, session: LogSession) -> None:
        path = session.close()
        self._last |= {"path": str(path), "impacts": session.impacts}
        self._untold = True
        self.get_logger().info(f"{path}: {session.impacts} impacts")
        self._tell("finished")

    def _failed(self, error: HelmetSimError) -> None:
        """The disk is full or gone: close what there is; the next impact tries a new file."""
        self.get_logger().error(str(error))
        self._assembler.abandon(str(error))
        sessions = [*self._retired, *([self._session] if self._session else [])]
        self._session, self._retired, self._awaiting, self._untold = None, [], {}, False
        for session in sessions:
            try:
                session.close()
            except LogError as again:
                self.get_logger().error(str(again))
        self._tell(str(error), DiagnosticStatus.ERROR)

    # parameters and status

    def _configuration(self, values: dict[str, Any]) -> RecorderConfig:
        config = RecorderConfig(**values)
        if self._root is None:  # as the operator started it
            self._root = Path(config.output_dir).resolve()
        check_inside(config, self._root)
        return check_writable(config)

    def _busy_reason(self) -> str:
        pending = self._assembler.pending
        return f"busy: impact {pending} is being recorded" if pending else ""

    def _moved(self) -> None:
        if self._settings.value.place != self._place:
            self._place = self._settings.value.place
            try:
                self._close_log("")
            except LogError as error:
                self._failed(error)

    def _tell(self, message: str, level: bytes = DiagnosticStatus.OK) -> None:
        values = [KeyValue(key=key, value=str(value)) for key, value in self._last.items()]
        self._status.publish(
            DiagnosticStatus(level=level, name="recorder", message=message, values=values)
        )


def main(args: list[str] | None = None) -> int:
    """Entry point of ``recorder_node``."""
    return run_node("recorder", RecorderNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
