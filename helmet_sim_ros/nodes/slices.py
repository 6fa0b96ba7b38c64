"""An impact or a fall in slices: as many samples as are computed between two rounds of the node."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import SAMPLED, FloatArray
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST, setup_digest
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import begun

#: Most samples in one block: a few milliseconds of computing, and about 90 kB.
BLOCK = 100
#: Simulated times closer than this are one [s]: rounding of summed steps.
SAME_TIME = 1e-9


class Slices:
    """What runs, and the blocks of its samples.

    Attributes:
        source: the impact or fall.
        setup: it as plain data; ``digest``: of that.
        done: finished samples.
    """

    def __init__(
        self, setup: ImpactSetup | Fall, impact_id: str, start_time: float, period: float
    ) -> None:
        """Args: ``start_time`` [s] of its first sample; ``period`` [s] of what is shown."""
        self.source = begun(setup)
        self.setup = setup.described()
        self.digest = setup_digest(self.setup)
        self.done = 0
        self._falls = isinstance(setup, Fall)
        self._name, self._start_time, self._period = impact_id, start_time, period
        self._stride = max(1, round(period / setup.time_step))

    @property
    def total(self) -> int | None:
        """Samples of the whole; None: not known before a fall is over."""
        return None if self._falls and not self.source.is_over else self.source.total

    def next(self, stepwise: bool) -> Block:
        """Compute the next samples.

        Args:
            stepwise: as many as lie in one period of what is shown, else a whole block.

        Raises:
            DivergedError: the state left physics.
        """
        first, source = self.done, self.source
        if not stepwise:
            source.advance(BLOCK)
        elif not self._falls:
            source.advance(min(self._stride, BLOCK))
        else:  # samples follow what happens
            until, last = source.time + self._period - SAME_TIME, first + BLOCK
            while source.advance(1) < last and source.time < until and not source.is_over:
                pass
        self.done = source.done_samples
        heading: dict[str, Any] = {}
        if first == 0:
            heading = {"setup": self.setup, "model": source.model_xml(), SETUP_DIGEST: self.digest}
        if source.is_over:
            heading["extras"] = self._extras()
        return self._block(first, source.block(first, self.done), **heading)

    def aborted(self, reason: str) -> Block:
        """The block that tells why it ends unfinished."""
        return self._block(self.done, self.source.block(self.done, self.done), aborted=reason)

    def _block(self, first: int, data: FloatArray, **heading: Any) -> Block:
        return Block(
            self._name, first, self.total, self._start_time, tuple(self.source.labels), data,
            uniform=not self._falls, **heading,
        )  # fmt: skip

    def _extras(self) -> Mapping[str, Any]:
        return {k: v for k, v in self.source.extras().items() if k not in SAMPLED}


class Thinning:
    """Which samples the live view shows: the first, then one per period of simulated time.

    Args:
        period: [s].
    """

    def __init__(self, period: float) -> None:
        self._period, self._due = period, 0.0

    def chosen(self, times: FloatArray) -> NDArray[np.int64]:
        """Indices of the next samples, whose times are given [s], (n,), that are shown."""
        found = []
        for index, time in enumerate(times.tolist()):
            if time >= self._due - SAME_TIME:
                found.append(index)
                self._due = time + self._period
        return np.array(found, dtype=np.int64)
