"""Sample blocks: how the samples of an impact travel and how a reader proves it has them all.

An impact's samples are uniform and their number is known from the start. A fall's follow what
happens: dense where the head strikes, thinner elsewhere; their number is known at its end.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from helmet_sim_ros.biomech.pulse import increasing_time, uniform_time_step
from helmet_sim_ros.biomech.record import DENSE, FloatArray, ImpactRecord, from_block
from helmet_sim_ros.errors import IncompleteError, PulseError
from helmet_sim_ros.mcap_log.digest import setup_digest

#: Longest id of an impact, in characters.
ID_LENGTH = 200
#: Most samples of an impact; the longest that can be simulated has 2e6 (2 s in steps of 1e-6 s).
MOST_SAMPLES = 10**8
#: How far a dense sample may be from the time step, as a share of it: rounding of summed steps.
JITTER = 1e-6
#: Latest start [s]: the seconds of a ROS time stamp are a signed 32-bit integer.
LATEST_START = 2**31 - 1


@dataclass(frozen=True)
class Block:
    """A run of consecutive samples of one impact or fall.

    Attributes:
        impact_id: unique over all impacts of all processes.
        first: index of the first row in the impact.
        total: samples of the whole impact; None: not yet known, of a fall before its last block.
        start_time: simulation time of the impact's first sample [s].
        labels: column names, see :func:`helmet_sim_ros.biomech.record.block_labels`.
        data: shape (rows, len(labels)), SI units.
        setup: the impact setup as plain data; in the first block only.
        setup_digest: its :func:`~helmet_sim_ros.mcap_log.digest.setup_digest`, beside it.
        uniform: whether samples are one time step apart; of a fall they are so only in the
            stretches that its ``extras["dense"]`` names.
        model: the compiled model as MJCF text; in the first block only.
        extras: ``ImpactRecord.extras`` (notes, map of residual crush) but for what has a row per
            sample; in the last block only.
        aborted: why the impact ends here, unfinished; such a block has no rows.
    """

    impact_id: str
    first: int
    total: int | None
    start_time: float
    labels: tuple[str, ...]
    data: FloatArray
    setup: Mapping[str, Any] | None = None
    model: str | None = None
    extras: Mapping[str, Any] | None = None
    aborted: str | None = None
    setup_digest: str | None = None
    uniform: bool = True

    def header(self) -> str:
        """Everything but labels and data, as JSON; further values that are None are left out."""
        values = {
            "impact_id": self.impact_id, "first": self.first, "total": self.total,
            "start_time": self.start_time,
        }  # fmt: skip
        if not self.uniform:
            values["uniform"] = False
        for name in ("setup", "setup_digest", "model", "extras", "aborted"):
            if getattr(self, name) is not None:
                values[name] = getattr(self, name)
        return json.dumps(values, default=_listed)


def check_impact_id(impact_id: object) -> str:
    """The id of an impact: what a table, a page and a terminal show as it is.

    Raises:
        ValueError: not text of 1 to 200 printable characters.
    """
    if not isinstance(impact_id, str) or not impact_id.isprintable():
        raise ValueError(f"impact_id must be printable text, not {impact_id!r:.80}")
    if not 0 < len(impact_id) <= ID_LENGTH:
        raise ValueError(f"impact_id has {len(impact_id)} characters, 1 to {ID_LENGTH} are allowed")
    return impact_id


def parse_block(header: str, labels: str, data: Sequence[float] | FloatArray) -> Block:
    """The block of a message: JSON header, comma-joined labels, values row by row.

    Raises:
        IncompleteError: not a sample block, or one that contradicts itself.
    """
    try:
        fields = json.loads(header)
        names = tuple(labels.split(","))
        values = np.asarray(data, dtype=np.float64)
        block = Block(data=values.reshape(-1, len(names)), labels=names, **fields)
        _check(block)
        if block.setup_digest is not None and block.setup_digest != setup_digest(block.setup or {}):
            raise ValueError("the setup is not the one of its digest")
    except (TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise IncompleteError(f"not a block of samples: {error}") from None
    return block


def _check(block: Block) -> None:
    """Refuse a block whose header is of other types, or contradicts its data."""
    check_impact_id(block.impact_id)
    if type(block.uniform) is not bool:
        raise TypeError("uniform must be true or false")
    open_ended = block.total is None and not block.uniform
    if type(block.first) is not int or (type(block.total) is not int and not open_ended):
        raise TypeError("first and total must be integers")
    last = block.first + len(block.data)
    if not 0 <= block.first <= last <= (last if block.total is None else block.total):
        raise ValueError(f"rows {block.first} to {last} of {block.total}")
    if max(last, block.total or 0) > MOST_SAMPLES:
        raise ValueError(f"more than {MOST_SAMPLES} rows")
    if len(set(block.labels)) < len(block.labels):
        raise ValueError("two columns have the same name")
    number = type(block.start_time) in (int, float)
    if not number or not 0.0 <= block.start_time <= LATEST_START:
        raise ValueError(
            f"start_time = {block.start_time!r:.80}: must be a number from 0 to {LATEST_START} s"
        )
    for name in ("setup", "extras"):
        if not isinstance(getattr(block, name), Mapping | None):
            raise TypeError(f"{name} must be a JSON object")
    for name in ("model", "aborted"):
        if not isinstance(getattr(block, name), str | None):
            raise TypeError(f"{name} must be text")


@dataclass(frozen=True)
class Assembled:
    """What became of one impact: ``record`` if every sample arrived, else ``problem``.

    ``setup`` is that of its first block, where there was one.
    """

    impact_id: str
    start_time: float
    total: int
    record: ImpactRecord | None
    problem: str = ""
    setup: Mapping[str, Any] = field(default_factory=dict)


class Assembler:
    """Puts blocks together, one impact at a time, and refuses what is not complete and in order."""

    def __init__(self) -> None:
        self._blocks: list[Block] = []
        # Impacts already reported: what still arrives of them is ignored, unless it starts anew.
        self._ended: deque[str] = deque(maxlen=100)

    @property
    def pending(self) -> str | None:
        """The impact that is under way, if any."""
        return self._blocks[0].impact_id if self._blocks else None

    def feed(self, block: Block) -> list[Assembled]:
        """Take the next block; what ended with it, oldest first (usually nothing or one)."""
        ended = []
        if self._blocks and block.impact_id != self.pending:
            ended.append(self._give_up(f"followed by impact {block.impact_id}"))
        if not self._blocks and block.first > 0 and block.impact_id in self._ended:
            return ended
        expected = self._blocks[-1].first + len(self._blocks[-1].data) if self._blocks else 0
        self._blocks.append(block)
        if block.aborted is not None:
            ended.append(self._give_up(block.aborted))
        elif block.first != expected:
            ended.append(self._give_up(f"sample {expected} expected, {block.first} arrived"))
        elif self._changed(block):
            ended.append(self._give_up("channels or length changed on the way"))
        elif block.first + len(block.data) == block.total:
            ended.append(self._complete())
        return ended

    def _changed(self, block: Block) -> bool:
        """Whether the newest block contradicts the one before it."""
        before = self._blocks[max(len(self._blocks) - 2, 0)]
        length = before.total is not None and block.total != before.total
        return length or (block.labels, block.uniform) != (before.labels, before.uniform)

    def abandon(self, reason: str) -> list[Assembled]:
        """Give up the impact under way, if any: no more blocks will come."""
        return [self._give_up(reason)] if self._blocks else []

    def _complete(self) -> Assembled:
        first = self._blocks[0]
        try:
            record = from_block(
                list(first.labels),
                np.concatenate([b.data for b in self._blocks]),
                first.setup,
                _with_arrays(self._blocks[-1].extras or {}),
            )
            if first.uniform:
                uniform_time_step(record.time)
            else:
                _check_dense(record)
        except PulseError as error:
            return self._give_up(str(error))
        self._blocks = []
        self._ended.append(first.impact_id)
        return Assembled(
            first.impact_id, first.start_time, len(record), record, setup=record.setup
        )  # fmt: skip

    def _give_up(self, reason: str) -> Assembled:
        first, last = self._blocks[0], self._blocks[-1]
        self._blocks = []
        self._ended.append(first.impact_id)
        arrived = last.first if reason == last.aborted else last.first + len(last.data)
        total = arrived if last.total is None else last.total
        of = "an open number" if last.total is None else total
        problem = f"incomplete: {reason} (impact {first.impact_id}, {arrived} of {of})"
        setup = first.setup or {}
        return Assembled(first.impact_id, first.start_time, total, None, problem, setup)


def _check_dense(record: ImpactRecord) -> None:
    """Prove that the samples of a fall are where it says: their times increase, and its dense
    stretches have no gap.

    Raises:
        PulseError: they are not.
    """
    increasing_time(record.time)
    step, end = record.setup.get("sim.time_step"), 0
    if not isinstance(step, float) or DENSE not in record.extras:
        raise PulseError("samples are not uniform, and nothing says where they are dense")
    for first, last in record.extras[DENSE]:
        if not end <= first < last <= len(record):
            raise PulseError(f"{DENSE}: samples {first} to {last} of {len(record)} after {end}")
        steps = np.diff(record.time[first:last])
        if len(steps) and np.abs(steps - step).max() > JITTER * step:
            raise PulseError(f"{DENSE}: samples {first} to {last} are not {step:g} s apart")
        end = last


def _listed(value: object) -> object:
    """Arrays as lists, for JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _with_arrays(extras: Mapping[str, Any]) -> dict[str, Any]:
    """Lists of numbers as arrays again; what is not, as it is."""
    restored = {}
    for name, value in extras.items():
        restored[name] = value
        if name == DENSE:
            restored[name] = _stretches(value)
        elif name == "notes":
            restored[name] = _texts(value)
        elif isinstance(value, list) and value and isinstance(value[0], (float, list)):
            # What only begins like numbers stays what it is.
            with suppress(ValueError, TypeError, OverflowError):
                restored[name] = np.array(value, dtype=np.float64)
    return restored


def _texts(value: object) -> list[str]:
    """Notes.

    Raises:
        PulseError: not texts.
    """
    if not isinstance(value, list | tuple) or not all(isinstance(text, str) for text in value):
        raise PulseError(f"notes: must be a list of texts, not {value!r:.80}")
    return list(value)


def _stretches(value: object) -> tuple[tuple[int, int], ...]:
    """First and last (exclusive) sample of each dense stretch.

    Raises:
        PulseError: not pairs of integers.
    """
    pairs: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    for pair in pairs:
        if not isinstance(pair, list | tuple) or [type(number) for number in pair] != [int, int]:
            raise PulseError(f"{DENSE}: must be pairs of integers, not {pair!r:.80}")
    return tuple((pair[0], pair[1]) for pair in pairs)
