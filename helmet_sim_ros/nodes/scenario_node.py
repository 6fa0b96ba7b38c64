"""The scenario node: runs a whole matrix of impacts and falls through the other nodes.

For each case it sets the parameters of the simulation atomically, asks for the impact or fall, and
waits for the evaluation of exactly that one and for the recorder to have it on disk. Every wait has
a deadline; a case that fails is told as failed, and the matrix goes on.

``~/progress`` is JSON: ``scenario``, ``state`` (idle, starting, running, finished), ``case``,
``done``, ``failed``, ``cases``, ``elapsed_s``, ``left_s``. ``~/run`` answers at the end, with the
result as JSON: ``scenario``, ``complete``, ``error``, ``file``, ``reference``, and in ``cases`` one
row each with ``name``, ``status`` (evaluated, failed, cancelled), ``error``, ``impact_id``,
``recorded``, ``setup``, ``setup_digest``, ``evaluation``, ``reference``, and of a fall, in place
of ``evaluation``, ``strikes``: a list, empty without head contact, each with its own
``evaluation``. A case whose impact or criteria carry another digest than the setup that was asked
for has failed.
"""

from __future__ import annotations

import json
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from pydantic import Field
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from helmet_sim_ros.errors import HelmetSimError, NodeError, SetupError
from helmet_sim_ros.mcap_log.criteria import digest_of
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST, setup_digest
from helmet_sim_ros.nodes.diagnostics import to_evaluation, to_strikes
from helmet_sim_ros.nodes.parameters import NODE_OPTIONS, Parameters, renamed, without_prefix
from helmet_sim_ros.nodes.process import answering, run_node, wait
from helmet_sim_ros.nodes.qos import CRITERIA, LATCHED, SERVICE, STATUS_READER
from helmet_sim_ros.nodes.setup_parameters import FALL, IMPACT, kind_of, parameter_values
from helmet_sim_ros.schema import Config, leaves, quantity
from helmet_sim_ros.study.scenario.matrix import Case, Scenario, load_scenario
from helmet_sim_ros.study.scenario.overrides import parse_overrides

#: How long the other nodes may take to appear [s]; the simulation compiles when it is first used.
START_TIMEOUT = 180.0
#: How long short questions (parameters, the end of a log) may take [s].
ANSWER_TIMEOUT = 10.0
#: How often a wait looks whether the node it waits for is still there [s].
PULSE = 0.1

#: How many impacts of other clients may come between an impact and its turn here.
REMEMBERED = 100

PREFIX = "scenario."
#: Topics of the evaluator: criteria of impacts, head strikes of falls.
RESULTS = ("criteria", "strikes")

T = TypeVar("T")


class ScenarioOptions(Config):
    """Parameters of the scenario node."""

    file: str = Field("oblique_table1", description="name in config/scenarios, or path to a file")
    overrides: tuple[str, ...] = Field((), description="KEY=VALUE, replaced in every case")
    record: bool = Field(True, description="wait for the recorder; false: run without one")
    timeout: float = quantity(
        "longest wait for the impact, its evaluation and its log each", "s", 120.0, gt=0.0, le=1e6
    )

    def load(self) -> Scenario:
        """The scenario these options ask for.

        Raises:
            SetupError: anything refused in it.
        """
        return load_scenario(self.file, overrides=parse_overrides(self.overrides))


class ScenarioNode(Node):
    """Serves ``~/run`` and ``~/cancel`` and tells ``~/progress``."""

    def __init__(self) -> None:
        super().__init__("scenario", **NODE_OPTIONS)
        self._running = self._cancelled = False
        self._options = Parameters(
            self, renamed(leaves(ScenarioOptions), PREFIX), _options, refuse=self._busy_reason
        )
        self._changed = Future()
        # By impact: other clients may have theirs run in between.
        self._criteria: OrderedDict[str, DiagnosticArray] = OrderedDict()
        self._on_disk: OrderedDict[str, dict[str, str]] = OrderedDict()
        self._status: dict[str, dict[str, str]] = {"simulation": {}, "recorder": {}}
        self._state: dict[str, Any] = {}
        group = ReentrantCallbackGroup()

        def client(kind: Any, name: str) -> Client:
            return self.create_client(kind, name, callback_group=group)

        self._configure = client(SetParametersAtomically, "simulation/set_parameters_atomically")
        self._runs = {kind: client(Trigger, f"simulation/run_{kind}") for kind in (IMPACT, FALL)}
        self._stop = client(Trigger, "simulation/cancel")
        self._recorder = client(SetParametersAtomically, "recorder/set_parameters_atomically")
        self._finish = client(Trigger, "recorder/finish")
        for name in RESULTS:
            self.create_subscription(
                DiagnosticArray, f"evaluation/{name}", self._judged, CRITERIA, callback_group=group
            )
        for name in self._status:
            self.create_subscription(
                DiagnosticStatus, f"{name}/status", self._heard, STATUS_READER, callback_group=group
            )
        self._progress = self.create_publisher(String, "~/progress", LATCHED)
        self.create_service(Trigger, "~/run", self._run, qos_profile=SERVICE, callback_group=group)
        self.create_service(
            Trigger, "~/cancel", self._cancel, qos_profile=SERVICE, callback_group=group
        )
        self._tell(state="idle", case="", done=0, failed=0, cases=0)

    # services

    @answering
    async def _run(self, request: Any) -> str:
        if self._running:
            raise NodeError(self._busy_reason())
        self._running, self._cancelled = True, False
        try:
            result = await self._matrix(self._options.value.load())
        finally:
            self._running = False
        if not result["complete"]:
            raise NodeError(json.dumps(result))
        return json.dumps(result)

    @answering
    def _cancel(self, request: Any) -> str:
        if not self._running:
            raise NodeError("no scenario is running")
        self._cancelled = True
        if self._stop.service_is_ready():
            self._stop.call_async(Trigger.Request())
        self._notify()
        return f"cancelling at case {self._state['case']}"

    # the matrix

    async def _matrix(self, scenario: Scenario) -> dict[str, Any]:
        record = self._options.value.record
        rows: list[dict[str, Any]] = []
        began, path = time.monotonic(), ""
        state = {"scenario": scenario.name, "cases": len(scenario.cases)}
        self._tell(**state, state="starting", case="", done=0, failed=0)
        await self._ready(scenario)
        for case in scenario.cases:
            elapsed = time.monotonic() - began
            self._tell(
                **state, state="running", case=case.name, done=len(rows), failed=_failed(rows),
                elapsed_s=elapsed,
                left_s=elapsed / len(rows) * (len(scenario.cases) - len(rows)) if rows else None,
            )  # fmt: skip
            rows.append(await self._row(case))
        error = ""
        if record:
            try:
                path = json.loads((await self._ask(self._finish, ANSWER_TIMEOUT)).message)["path"]
            except (HelmetSimError, ValueError) as problem:
                if any(row["recorded"] for row in rows):  # else there may be no log at all
                    error = f"the log was not finished: {problem}"
        self._tell(
            **state, state="finished", case="", done=len(rows), failed=_failed(rows),
            elapsed_s=time.monotonic() - began, left_s=0.0,
        )  # fmt: skip
        return {
            "scenario": scenario.name,
            "complete": not error and not _failed(rows),
            "error": error,
            "file": path,
            "reference": scenario.reference.source if scenario.reference else "",
            "cases": rows,
        }

    async def _row(self, case: Case) -> dict[str, Any]:
        """Run one case; whatever happens to it ends in its row."""
        row: dict[str, Any] = {
            "name": case.name, "status": "evaluated", "error": "", "impact_id": "",
            "recorded": "", "setup": dict(case.values), "setup_digest": "",
            "reference": case.reference, "evaluation": None, "strikes": None,
        }  # fmt: skip
        kind = kind_of(case.setup)
        try:
            if self._cancelled:
                raise NodeError("cancelled before it began")
            self._status["recorder"].pop("level", None)  # an error of an earlier case
            await self._set(self._configure, parameter_values(case.setup))
            answer = await self._ask(self._runs[kind], self._options.value.timeout)
            impact_id, ran = ran_impact(answer.message)
            row |= {"impact_id": impact_id, SETUP_DIGEST: ran}
            asked = setup_digest(case.setup.described())
            if ran != asked:
                raise NodeError(not_asked(impact_id, ran, asked))
            judged = await self._judgement(impact_id, asked, kind)
            if self._options.value.record:
                row["recorded"] = await self._recorded(impact_id)
            row |= judged
        except HelmetSimError as error:
            row["status"] = "cancelled" if self._cancelled else "failed"
            row["error"] = str(error)
            self.get_logger().warning(f"case {case.name}: {error}")
        return row

    async def _ready(self, scenario: Scenario) -> None:
        """Wait until nothing that the matrix needs can miss its first sample."""
        record = self._options.value.record
        kinds = {kind_of(case.setup) for case in scenario.cases}
        services = [self._configure, *(self._runs[kind] for kind in kinds)]
        services += [self._recorder, self._finish] * record
        for client in services:
            await self._until(
                client.service_is_ready, f"no node answers {client.srv_name}", START_TIMEOUT
            )
        await self._until(
            lambda: all(self.count_publishers(f"evaluation/{name}") for name in RESULTS),
            "no evaluator publishes " + " and ".join(f"evaluation/{name}" for name in RESULTS),
            START_TIMEOUT,
        )  # fmt: skip
        readers = 2 if record else 1
        await self._until(
            lambda: int(self._status["simulation"].get("readers", 0)) >= readers,
            f"impact/samples has fewer than {readers} readers", START_TIMEOUT,
        )  # fmt: skip
        if record:
            changes = "".join(f"# with {text}\n" for text in self._options.value.overrides if text)
            text = changes + scenario.path.read_text(encoding="utf-8")
            await self._tell_recorder({"scenario_name": scenario.name, "scenario_text": text})

    async def _tell_recorder(self, values: dict[str, Any]) -> None:
        """Set parameters of the recorder, which may still be writing an earlier impact."""
        deadline = time.monotonic() + START_TIMEOUT
        while True:
            try:
                return await self._set(self._recorder, values)
            except NodeError as error:
                if "busy" not in str(error) or time.monotonic() > deadline:
                    raise
            await wait(self, Future(), PULSE)

    # the other nodes

    async def _set(self, client: Client, values: dict[str, Any]) -> None:
        """Set parameters of another node, all or none."""
        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = (await self._answer(client, request, ANSWER_TIMEOUT)).result
        if not result.successful:
            raise NodeError(f"{client.srv_name}: {result.reason}")

    async def _ask(self, client: Client, seconds: float) -> Any:
        """Trigger a service of another node.

        Raises:
            NodeError: it refuses (its reason), or does not answer in time.
        """
        answer = await self._answer(client, Trigger.Request(), seconds)
        if not answer.success:
            raise NodeError(answer.message)
        return answer

    async def _answer(self, client: Client, request: Any, seconds: float) -> Any:
        if not client.service_is_ready():
            raise NodeError(f"no node answers {client.srv_name}")
        future = client.call_async(request)
        future.add_done_callback(lambda _: self._notify())

        def answered() -> bool:
            if not future.done() and not client.service_is_ready():
                raise NodeError(f"the node of {client.srv_name} is gone")
            return bool(future.done())

        try:
            await self._until(answered, f"{client.srv_name} did not answer", seconds)
        finally:
            client.remove_pending_request(future)
        return future.result()

    async def _judgement(self, impact_id: str, asked: str, kind: str) -> dict[str, Any]:
        """What the evaluator says: ``evaluation`` of an impact, ``strikes`` of a fall."""

        def judged() -> bool:
            return self._cancelled or impact_id in self._criteria

        await self._until(judged, "no evaluation of the impact", self._options.value.timeout)
        if impact_id not in self._criteria:
            raise NodeError("cancelled before its evaluation arrived")
        criteria = self._criteria.pop(impact_id)
        result: dict[str, Any]
        if kind == FALL:
            result = {"strikes": [strike.as_dict() for strike in to_strikes(criteria)[1]]}
        else:
            result = {"evaluation": to_evaluation(criteria)[1].as_dict()}
        if digest_of(criteria) != asked:
            raise NodeError(not_asked(impact_id, digest_of(criteria), asked, "was judged"))
        return result

    async def _recorded(self, impact_id: str) -> str:
        """The log that holds the impact."""
        status = self._status["recorder"]

        def recorded() -> bool:
            if status.get("level") == "error":
                raise NodeError(f"not recorded: {status['message']}")
            return impact_id in self._on_disk

        await self._until(recorded, "no log of the impact", self._options.value.timeout)
        told = self._on_disk.pop(impact_id)
        if told.get("criteria", "logged") != "logged":
            raise NodeError(f"not recorded: {told['message']}")
        return told["path"]

    async def _until(self, ready: Callable[[], bool], otherwise: str, seconds: float) -> None:
        """Wait for a condition, looked at after every message and every :data:`PULSE`."""
        deadline = time.monotonic() + seconds
        while not ready():
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise NodeError(f"{otherwise} within {seconds:g} s")
            self._changed = Future()
            await wait(self, self._changed, min(PULSE, left))

    # what arrives, and what is told

    def _judged(self, message: DiagnosticArray) -> None:
        if message.status:
            remember(self._criteria, message.status[0].hardware_id, message)
            self._notify()

    def _heard(self, message: DiagnosticStatus) -> None:
        level = "error" if message.level == DiagnosticStatus.ERROR else "ok"
        told = {pair.key: pair.value for pair in message.values}
        told |= {"message": message.message, "level": level}
        if message.name in self._status:
            self._status[message.name].update(told)
            if message.name == "recorder" and level == "ok":
                remember(self._on_disk, told.get("impact_id", ""), told)
            self._notify()

    def _notify(self) -> None:
        if not self._changed.done():
            self._changed.set_result(None)

    def _busy_reason(self) -> str:
        if not self._running:
            return ""
        state = self._state
        return f"busy: {state['scenario']} runs, case {state['done'] + 1} of {state['cases']}"

    def _tell(self, **state: Any) -> None:
        self._state = {"scenario": "", "elapsed_s": 0.0, "left_s": None} | state
        self._progress.publish(String(data=json.dumps(self._state)))


def ran_impact(answer: str) -> tuple[str, str]:
    """Identity and digest of the setup in an answer of ``~/run_impact`` or ``~/run_fall``.

    Raises:
        NodeError: not such an answer.
    """
    try:
        told = json.loads(answer)
        return str(told["impact_id"]), str(told.get(SETUP_DIGEST, ""))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise NodeError("the simulation gave an answer without an impact") from None


def not_asked(impact_id: str, found: str, asked: str, what: str = "ran") -> str:
    """Why an impact does not count: it is not the one that was asked for."""
    return (
        f"impact {impact_id} {what} with another setup than the one asked for (digest "
        f"{found[:12] or 'missing'}, asked {asked[:12]}): another client changed it meanwhile"
    )


def remember(known: OrderedDict[str, T], key: str, value: T) -> None:
    """Keep a value by its key, and not more than the last :data:`REMEMBERED`."""
    known[key] = value
    while len(known) > REMEMBERED:
        known.popitem(last=False)


def _failed(rows: list[dict[str, Any]]) -> int:
    return sum(row["status"] != "evaluated" for row in rows)


def _options(values: dict[str, Any]) -> ScenarioOptions:
    try:
        options = ScenarioOptions(**without_prefix(values, PREFIX))
    except SetupError as error:
        raise SetupError([p._replace(key=PREFIX + p.key) for p in error.problems]) from None
    try:
        options.load()  # refuse a bad file when it is set, not when it runs
    except SetupError as error:
        which = "file with overrides" if any(options.overrides) else "file"
        problems = [
            p._replace(key=PREFIX + ("file" if p.key == "scenario" else f"{which}: {p.key}"))
            for p in error.problems
        ]
        raise SetupError(problems, error.source) from None
    return options


def main(args: list[str] | None = None) -> int:
    """Entry point of ``scenario_node``."""
    return run_node("scenario", ScenarioNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
