"""Pause, step and cancel of the impact that runs."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.task import Future

from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.nodes.process import next_round, wait


class Cancelled(HelmetSimError):
    """The impact was cancelled by a client."""


class RunControl:
    """What clients want of the running impact; the impact asks between its slices.

    Attributes:
        paused: whether simulation time stands still.
        running: whether an impact is under way.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._steps = 0
        self._cancelled = ""
        self._changed = Future()
        self.paused = False
        self.running = False

    @property
    def stepwise(self) -> bool:
        """Whether the next slice is shown as a single step."""
        return self.paused

    def begin(self) -> None:
        """An impact starts."""
        self.running, self._cancelled, self._steps = True, "", 0

    def end(self) -> None:
        """It has ended, however."""
        self.running, self._steps = False, 0
        self._notify()

    def pause(self, paused: bool) -> None:
        """Pause or go on; asking twice changes nothing."""
        self.paused = paused
        self._notify()

    def cancel(self, reason: str) -> None:
        """End the running impact at its next slice."""
        self._cancelled = reason
        self._notify()

    async def step(self) -> None:
        """Let a paused impact do one slice, and wait until that is done."""
        self._steps += 1
        self._notify()
        while self.running and self._steps:
            await next_round(self._node)

    async def idle(self) -> None:
        """Wait until no impact runs."""
        while self.running:
            await next_round(self._node)

    async def permit(self, seconds: float) -> None:
        """Wait ``seconds`` of wall time, and as long as the impact is paused.

        Raises:
            Cancelled: a client has cancelled the impact.
        """
        if seconds > 0.0 and not self._cancelled:
            await wait(self._node, self._changed, seconds)
        while self.paused and not self._steps and not self._cancelled:
            await self._changed
        if self._cancelled:
            raise Cancelled(self._cancelled)
        await next_round(self._node)

    def slice_done(self) -> None:
        """A slice is finished."""
        self._steps = max(0, self._steps - 1)

    def _notify(self) -> None:
        changed, self._changed = self._changed, Future()
        changed.set_result(None)
