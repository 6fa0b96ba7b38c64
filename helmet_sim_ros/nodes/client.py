"""A short-lived ROS client for those outside: calls with a deadline, never a hang."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.signals import SignalHandlerOptions

from helmet_sim_ros.errors import NodeError

#: How often a waiting client looks at its processes and redraws [s].
TICK = 0.1


@contextmanager
def ros_client() -> Iterator[Any]:
    """A node for calls and subscriptions; it is gone when the block ends.

    Raises:
        RuntimeError: the middleware does not start.
    """
    shared = rclpy.ok()  # with nodes in this process
    if not shared:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(f"helmet_sim_cli_{os.getpid()}")
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        if not shared:
            rclpy.try_shutdown()


def wait_for_service(
    node: Any, client: Any, seconds: float, tick: Callable[[], None] = lambda: None
) -> None:
    """Wait until a service is there; ``tick`` is called meanwhile and may raise.

    Raises:
        NodeError: it does not appear in time.
    """
    deadline = time.monotonic() + seconds
    while not client.service_is_ready():
        tick()
        if time.monotonic() > deadline:
            domain = os.environ.get("ROS_DOMAIN_ID", "0")
            raise NodeError(
                f"no node answers {client.srv_name} in ROS domain {domain} after {seconds:g} s; "
                "is it running (helmet-sim up)?"
            )
        time.sleep(0.02)  # rclpy tells of no such event; its own wait polls as well


def call(
    node: Any, client: Any, request: Any, seconds: float, tick: Callable[[], None] = lambda: None
) -> Any:
    """Call a service and wait for the answer; ``tick`` is called meanwhile and may raise.

    Raises:
        NodeError: no answer in time.
    """
    future = client.call_async(request)
    deadline = time.monotonic() + seconds
    while not future.done():
        rclpy.spin_once(node, timeout_sec=TICK)
        tick()
        if time.monotonic() > deadline:
            raise NodeError(f"{client.srv_name} did not answer within {seconds:g} s")
    return future.result()
