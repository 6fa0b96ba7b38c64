"""Messages that no reader may miss: sent no faster than the slowest of them takes them."""

from __future__ import annotations

import time
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future

from helmet_sim_ros.nodes.process import wait

#: How long a reader may take to acknowledge messages before the sender goes on without it [s]. DDS
#: itself forgets a participant that died after 20 s, so a slow one alone is waited for this long.
ACKNOWLEDGE_TIMEOUT = 30.0
#: How often that is looked at [s].
ACKNOWLEDGE_POLL = 1e-3


class Outgoing:
    """A reliable publisher that waits before its history would overwrite what is not yet read.

    Args:
        node: serves others meanwhile.
        publisher: its history is deeper than ``in_flight``.
        in_flight: how many messages may be on their way.
    """

    def __init__(self, node: Node, publisher: Publisher[Any], in_flight: int) -> None:
        self._node, self._publisher, self._in_flight = node, publisher, in_flight
        self._sent = 0
        self._given_up = False

    async def send(self, message: Any) -> None:
        """Publish a message once there is room for it."""
        if self._sent >= self._in_flight:
            await self.acknowledged()
        self._publisher.publish(message)
        self._sent += 1

    async def acknowledged(self) -> None:
        """Wait until every reader has every message; go on without one that hangs."""
        deadline = time.monotonic() + ACKNOWLEDGE_TIMEOUT
        while not self._publisher.wait_for_all_acked(Duration(seconds=0)):
            if self._given_up:
                break
            if time.monotonic() > deadline:
                self._given_up = True
                self._node.get_logger().warning(
                    f"a reader of {self._publisher.topic_name} has not taken all messages within "
                    f"{ACKNOWLEDGE_TIMEOUT:g} s; it will miss some"
                )
            await wait(self._node, Future(), ACKNOWLEDGE_POLL)
        else:
            self._given_up = False
        self._sent = 0
