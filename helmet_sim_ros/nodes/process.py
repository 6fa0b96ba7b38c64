"""How every node process starts, answers and ends."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Awaitable, Callable, Generator
from functools import wraps
from types import FrameType
from typing import Any

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from helmet_sim_ros.errors import HelmetSimError, SetupError
from helmet_sim_ros.lasting import lasting
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.nodes.parameters import config_paths
from helmet_sim_ros.nodes.teardown import ending_anyway
from helmet_sim_ros.resources import restrict_reach

#: Wall clock for timers: a node may run with use_sim_time while simulation time stands still.
WALL = Clock(clock_type=ClockType.STEADY_TIME)

#: How long a signal may wait until an idle node notices it [s].
_POLL = 0.1
#: How long a node that was told to end may wait for what is on its way to it [s].
LEAVING = 3.0
#: How long the middleware may take to leave the network, everything of ours being done [s].
TEARDOWN = 5.0


def run_node(name: str, create: Callable[[], Node], args: list[str] | None = None) -> int:
    """Create a node and serve it until SIGINT or SIGTERM, then let it ``close()`` in peace.

    A node that has ``leaving()`` is served a little longer, while that gives true.

    Args:
        name: for messages.
        create: makes the node.
        args: command line; None: ``sys.argv``.

    Returns:
        Exit code: 0 after a signal, 2 if the node refused its parameters, 1 for other errors.
    """
    prepare_environment()
    stopped = []

    def stop(number: int, frame: FrameType | None) -> None:
        # Only a flag: a signal must not interrupt a log in the middle of a record.
        stopped.append(number)

    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, stop)
    node, code = None, 0
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        with lasting():
            node = create()
        restrict_reach(config_paths(node))
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not stopped and rclpy.ok():
            serve(executor, node)
        patience = time.monotonic() + LEAVING
        while getattr(node, "leaving", bool)() and rclpy.ok() and time.monotonic() < patience:
            serve(executor, node)
    except ExternalShutdownException:
        pass
    except SetupError as error:
        print(f"{name}: {error}", file=sys.stderr)
        code = 2
    except (HelmetSimError, RuntimeError) as error:  # RCLError is a RuntimeError
        print(f"{name}: {error}", file=sys.stderr)
        code = 1
    finally:
        if node is not None and hasattr(node, "close"):
            node.close()
        with ending_anyway(code, TEARDOWN):
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
    return code


def serve(executor: SingleThreadedExecutor, node: Node) -> None:
    """One round of the executor. A failed callback is reported and the node lives on."""
    try:
        executor.spin_once(timeout_sec=_POLL)
    except ExternalShutdownException:
        raise
    except Exception as error:
        node.get_logger().error(f"a callback failed: {type(error).__name__}: {error}")
        time.sleep(0.01)  # one that fails at every round must not fill the log


def answering(
    callback: Callable[..., Awaitable[str] | str],
) -> Callable[..., Awaitable[Any]]:
    """Make a method that returns a text into the callback of a Trigger or SetBool service.

    The text becomes ``message`` with ``success``; an error becomes its reason without. A callback
    that raised would leave the client waiting for ever.
    """

    @wraps(callback)
    async def answer(self: Node, request: Any, response: Any) -> Any:
        try:
            result = callback(self, request)
            response.message = result if isinstance(result, str) else await result
            response.success = True
        except HelmetSimError as error:
            response.success, response.message = False, str(error)
        except Exception as error:
            response.success = False
            response.message = f"unexpected {type(error).__name__}: {error}"
            self.get_logger().error(f"{callback.__name__}: {response.message}")
        return response

    return answer


class _Once:
    def __await__(self) -> Generator[None, None, None]:
        yield


async def next_round(node: Node) -> None:
    """Let the executor serve everything else that is ready, then go on."""
    node.executor.wake()
    await _Once()


async def wait(node: Node, future: Future, seconds: float) -> None:
    """Wait for a future, at most so many seconds of wall time."""
    if future.done():
        return

    def expire() -> None:
        if not future.done():
            future.set_result(None)

    # A group of its own: one that stays keeps a reference to each timer that ever was in it.
    group = ReentrantCallbackGroup()
    timer = node.create_timer(max(seconds, 1e-6), expire, callback_group=group, clock=WALL)
    try:
        await future
    finally:
        node.destroy_timer(timer)
