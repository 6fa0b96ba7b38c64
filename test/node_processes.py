"""Nodes as processes of their own over real DDS, and a client that never waits for ever."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from domains import claim_domain
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

from helmet_sim_ros.cli._processes import end_with_parent
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.nodes.qos import CRITERIA, LATCHED

DOMAIN = claim_domain()
#: How long a node may take to end [s].
ENDED = 20.0


class Rig:
    """Node processes and a client node in the same ROS domain; all end with the block."""

    def __init__(self, folder: Path, nodes: Sequence[str] = ()) -> None:
        self.folder = folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.status: dict[str, dict[str, str]] = {}
        self.criteria: dict[str, DiagnosticArray] = {}
        self.killed: list[str] = []
        self._nodes = nodes
        self._clients: dict[str, Any] = {}

    def __enter__(self) -> Rig:
        os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        prepare_environment()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        try:
            self.node = rclpy.create_node("test_client")
            self._executor = SingleThreadedExecutor()
            self._executor.add_node(self.node)
            for topic in ("evaluation/criteria", "evaluation/strikes"):
                self.node.create_subscription(DiagnosticArray, topic, self._judged, CRITERIA)
            for name in ("simulation", "recorder"):
                self.node.create_subscription(
                    DiagnosticStatus, f"{name}/status", self._heard, LATCHED
                )
            for name in self._nodes:
                self.start(name)
            if "simulation" in self._nodes:
                readers = str(len({"evaluator", "recorder"} & set(self._nodes)))
                self.until(lambda: self.status.get("simulation", {}).get("readers") == readers, 300)
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # Before the others leave: Fast DDS may hang if it hears of them while it goes.
        self.node.destroy_node()
        rclpy.try_shutdown()
        codes, late = {}, []
        for name in list(self.processes):  # each of them, whatever the others do
            try:
                codes[name] = self.stop(name)
            except AssertionError as error:
                late.append(str(error))
        assert not late, "; ".join(late)
        if kind is None:
            assert set(codes.values()) <= {0}, codes

    def start(self, kind: str, *arguments: str, name: str = "", **parameters: Any) -> None:
        """Start a node, under another name for this rig if wanted; logs go to the rig's folder."""
        name = name or kind
        assert name not in self.processes
        values = {"output_dir": str(self.folder)} if kind == "recorder" else {}
        flags = []
        for key, value in (values | parameters).items():
            flags += ["-p", f"{key.replace('__', '.')}:={value}"]
        command = [sys.executable, "-X", "faulthandler", "-m", f"helmet_sim_ros.nodes.{kind}_node"]
        with open(self._said(name), "w") as file:
            self.processes[name] = subprocess.Popen(
                [*command, "--ros-args", *flags, *arguments],
                cwd=self.folder,
                stderr=file,
                preexec_fn=end_with_parent(),
            )

    def _said(self, name: str) -> Path:
        return self.folder / f"{name}.txt"

    def stop(self, name: str, kind: signal.Signals = signal.SIGINT) -> int:
        """End a node with a signal; its exit code. One that does not end must say where it is."""
        process = self.processes.pop(name)
        self.killed += [name] * (kind == signal.SIGKILL)
        if process.poll() is None:
            process.send_signal(kind)
        try:
            process.wait(ENDED)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # Python writes the stacks of all its threads
            with suppress(subprocess.TimeoutExpired):
                process.wait(ENDED)
            said = self._said(name).read_text()
            raise AssertionError(f"{name} has not ended after {kind.name}: {said}") from None
        finally:
            process.kill()
        return process.returncode

    def until(self, ready: Callable[[], Any], seconds: float = 60.0) -> Any:
        """Serve callbacks until ``ready()`` gives something true, which is returned."""
        deadline = time.monotonic() + seconds
        while not (found := ready()):
            for name, process in self.processes.items():
                assert process.poll() is None, f"{name}: {self._said(name).read_text()}"
            assert time.monotonic() < deadline, "waited in vain"
            self._executor.spin_once(timeout_sec=0.02)
        return found

    def serve(self, seconds: float) -> None:
        """Serve callbacks for some time."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def ask(self, service: str, request: Any = None) -> Any:
        """Begin a service call; the future of its answer."""
        kinds = {"pause": SetBool, "set_parameters_atomically": SetParametersAtomically,
                 "get_parameters": GetParameters}  # fmt: skip
        kind = kinds.get(service.rpartition("/")[2], Trigger)
        if service not in self._clients:
            self._clients[service] = self.node.create_client(kind, service)
        client = self._clients[service]
        self.until(client.service_is_ready)
        return client.call_async(request or kind.Request())

    def call(self, service: str, request: Any = None) -> Any:
        """The answer of a service."""
        future = self.ask(service, request)
        self.until(future.done)
        return future.result()

    def set(self, node: str = "simulation", **values: Any) -> str:
        """Set parameters of a node together (``__`` for a dot); the reason if it refuses."""
        parameters = [
            Parameter(name.replace("__", "."), value=value).to_parameter_msg()
            for name, value in values.items()
        ]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = self.call(f"{node}/set_parameters_atomically", request).result
        assert result.successful or result.reason
        return str(result.reason)

    def get(self, name: str, node: str = "simulation") -> Any:
        """The value of a parameter."""
        answer = self.call(f"{node}/get_parameters", GetParameters.Request(names=[name]))
        return parameter_value_to_python(answer.values[0])

    def impact(self, kind: str = "impact") -> dict[str, Any]:
        """Run the configured impact or fall and wait for its criteria or head strikes."""
        answer = self.call(f"simulation/run_{kind}")
        assert answer.success, answer.message
        result: dict[str, Any] = json.loads(answer.message)
        self.until(lambda: result["impact_id"] in self.criteria)
        return result

    def recorded(self, impact_id: str) -> Path:
        """Wait until the recorder has an impact; the file's final name."""
        self.until(lambda: self.status.get("recorder", {}).get("impact_id") == impact_id)
        return Path(self.status["recorder"]["path"])

    def _judged(self, message: DiagnosticArray) -> None:
        self.criteria[message.status[0].hardware_id] = message

    def _heard(self, message: DiagnosticStatus) -> None:
        told = {pair.key: pair.value for pair in message.values}
        level = {DiagnosticStatus.OK: "ok", DiagnosticStatus.WARN: "warn"}.get(
            message.level, "error"
        )
        self.status[message.name] = told | {"message": message.message, "level": level}
