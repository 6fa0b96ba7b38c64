"""A worker that computes the newest request only: the latest wins, nothing is mixed."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Request = TypeVar("Request")
Answer = TypeVar("Answer")


class Stale(Exception):
    """What was asked for is no longer wanted."""


class LatestWins(Generic[Key, Request, Answer]):
    """One thread that answers the newest request of each key and drops those before it.

    Args:
        compute: makes the answer; may call the function it is given now and then, which raises
            :class:`Stale` once a newer request of the same key is there.
        deliver: takes an answer, in the worker's thread, one at a time and in order. It is never
            called with the answer to a request that was dropped before it was computed.
    """

    def __init__(
        self,
        compute: Callable[[Request, Callable[[], None]], Answer],
        deliver: Callable[[Key, Answer], None],
    ) -> None:
        self._compute, self._deliver = compute, deliver
        self._waiting: dict[Key, Request] = {}
        self._changed = threading.Condition()
        self._busy = self._closed = False
        self._thread = threading.Thread(target=self._work, name="explorer-impacts", daemon=True)
        self._thread.start()

    def submit(self, key: Key, request: Request) -> None:
        """Ask for an answer, in place of what was asked for under this key before."""
        with self._changed:
            self._waiting.pop(key, None)  # a renewed request goes to the end: none starves
            self._waiting[key] = request
            self._changed.notify_all()

    def forget(self, key: Key) -> None:
        """Drop what waits under a key."""
        with self._changed:
            self._waiting.pop(key, None)

    def wait_idle(self, seconds: float) -> bool:
        """Wait until every request is answered; whether that came about in time."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._waiting and not self._busy, seconds)

    def close(self) -> None:
        """End the thread; what waits is dropped."""
        with self._changed:
            self._closed = True
            self._waiting.clear()
            self._changed.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                key = next(iter(self._waiting))
                request = self._waiting.pop(key)
                self._busy = True

            def check(key: Key = key) -> None:
                if self._closed or key in self._waiting:
                    raise Stale

            try:
                answer = self._compute(request, check)
            except Stale:
                continue
            try:
                self._deliver(key, answer)
            except Exception:  # the next answer must still be delivered
                logging.getLogger(__name__).exception("an answer could not be shown")
