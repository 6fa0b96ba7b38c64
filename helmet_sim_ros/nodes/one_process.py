"""The four nodes in one process: one context, one executor, one thread.

They talk through the same topics and services as four processes do; the middleware hands messages
over within the process. What it cannot give: a node that crashes takes the others with it.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType, TracebackType

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from helmet_sim_ros.errors import HelmetSimError, NodeError, SetupError
from helmet_sim_ros.lasting import lasting
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.nodes.parameters import CONFIG_PATHS
from helmet_sim_ros.nodes.process import LEAVING, TEARDOWN, serve
from helmet_sim_ros.nodes.teardown import ending_anyway
from helmet_sim_ros.resources import restrict_reach

#: In the order of their start.
NAMES = ("simulation", "evaluator", "recorder", "scenario")
#: How long the nodes may take to finish a log after they were told to end [s].
PATIENCE = 10.0

Parameters = Mapping[str, Mapping[str, object]]


class NodeRefused(NodeError):
    """A node did not take its parameters."""


class _Composition:
    """The nodes and their executor, from :meth:`open` to :meth:`close`."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._executor: SingleThreadedExecutor | None = None

    def open(self, arguments: Sequence[str]) -> None:
        """Start the middleware and make the nodes.

        Raises:
            NodeRefused: a node does not take its parameters.
            NodeError: the middleware does not start.
        """
        name = "middleware"
        try:
            rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
            self._executor = SingleThreadedExecutor()
            paths: list[Path] = []
            with lasting():
                for name in NAMES:
                    module = import_module(f"helmet_sim_ros.nodes.{name}_node")
                    node = getattr(module, f"{name.capitalize()}Node")()
                    self.nodes.append(node)
                    self._executor.add_node(node)
                    paths += map(Path, node.get_parameter(CONFIG_PATHS.name).value or ())
            restrict_reach(paths)
        except SetupError as error:
            raise NodeRefused(f"the {name} node: {error}") from error
        except (HelmetSimError, RuntimeError) as error:  # RCLError is a RuntimeError
            raise NodeError(f"the {name} node: {error}") from error

    def serve(self) -> None:
        """One round."""
        serve(self._executor, self.nodes[0])

    def leave(self) -> None:
        """Serve what is on its way to a node that still waits for it."""
        patience = time.monotonic() + LEAVING
        while rclpy.ok() and time.monotonic() < patience:
            if not any(getattr(node, "leaving", bool)() for node in self.nodes):
                break
            self.serve()

    def wake(self) -> None:
        """End the present round."""
        if self._executor is not None:
            self._executor.wake()

    def close(self, code: int) -> None:
        """Finish what the nodes have open, and leave the network; end the process if that hangs."""
        for node in self.nodes:
            if hasattr(node, "close"):
                node.close()
        with ending_anyway(code, TEARDOWN):
            for node in self.nodes:
                node.destroy_node()
            self.nodes.clear()
            rclpy.try_shutdown()


class OneProcess:
    """Serves the nodes in a thread of this process, from entry to exit.

    Args:
        parameters: node name -> parameter name -> value.
        remaps: node name -> name in the node -> name outside.
        quiet: do not write what the nodes say to the terminal.

    Attributes:
        exit_code: of this process, if the middleware hangs while it ends.
    """

    def __init__(
        self,
        parameters: Parameters,
        remaps: Mapping[str, Mapping[str, str]] | None = None,
        quiet: bool = True,
    ) -> None:
        self.exit_code = 1
        self._arguments = ros_arguments(parameters, remaps or {}, quiet)
        self._composition = _Composition()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="nodes", daemon=True)

    def __enter__(self) -> OneProcess:
        try:
            self._composition.open(self._arguments)
            self._thread.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def check(self) -> None:
        """Raise a :class:`NodeError` if the nodes are no longer served."""
        if not self._thread.is_alive():
            raise NodeError("the nodes have ended")

    def stop(self) -> None:
        """End the nodes: the log gets finished; safe to call again."""
        self._stopping.set()
        if self._thread.is_alive():
            self._composition.wake()
            self._thread.join(PATIENCE)
            if self._thread.is_alive():
                raise NodeError(f"the nodes did not end within {PATIENCE:g} s")
        self._composition.close(self.exit_code)

    def _work(self) -> None:
        with suppress(ExternalShutdownException):
            while not self._stopping.is_set() and rclpy.ok():
                self._composition.serve()
            self._composition.leave()


def ros_arguments(
    parameters: Parameters, remaps: Mapping[str, Mapping[str, str]], quiet: bool
) -> list[str]:
    """Parameters and names of each node as arguments of the one process."""
    arguments = ["--ros-args"]
    for name, values in parameters.items():
        for key, value in values.items():
            arguments += ["-p", f"{name}:{key}:={json.dumps(value)}"]
    for name, names in remaps.items():
        for inside, outside in names.items():
            arguments += ["-r", f"{name}:{inside}:={outside}"]
    if quiet:
        # What is no warning costs a tenth of a second: rclpy looks for the line that says it.
        arguments += ["--disable-stdout-logs", "--log-level", "warn"]
    return arguments


def main(args: list[str] | None = None) -> int:
    """Entry point of ``one_process_node``; parameters and names of one node begin with its name,
    as in ``-p recorder:output_dir:=/data``.

    Returns:
        Exit code: 0 after a signal, 2 if a node refused its parameters, 1 for other errors.
    """
    prepare_environment()
    stopped: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        # Only a flag: a signal must not interrupt a log in the middle of a record.
        stopped.append(number)

    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, stop)
    composition, code = _Composition(), 0
    try:
        composition.open(sys.argv if args is None else args)
        while not stopped and rclpy.ok():
            composition.serve()
        composition.leave()
    except ExternalShutdownException:
        pass
    except NodeError as error:
        print(f"one_process: {error}", file=sys.stderr)
        code = 2 if isinstance(error, NodeRefused) else 1
    finally:
        composition.close(code)
    return code


if __name__ == "__main__":
    raise SystemExit(main())
