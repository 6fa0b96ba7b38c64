"""Where the impacts of a log are, and how their samples and criteria are read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import IncompleteError, LogError
from helmet_sim_ros.mcap_log.blocks import (
    LATEST_START,
    MOST_SAMPLES,
    Assembled,
    Assembler,
    Block,
    check_impact_id,
    parse_block,
)
from helmet_sim_ros.mcap_log.criteria import evaluation_of
from helmet_sim_ros.mcap_log.decode import Decoder
from helmet_sim_ros.mcap_log.layout import (
    CRITERIA_TOPIC,
    CRITERIA_TYPE,
    IMPACT,
    SAMPLES_TOPIC,
    SAMPLES_TYPE,
    STRIKES_TOPIC,
)
from helmet_sim_ros.mcap_log.source import McapSource
from helmet_sim_ros.mcap_log.strikes import JudgedStrike, strikes_of


@dataclass(frozen=True, eq=False)  # equal only to itself: usable as a key
class Entry:
    """One impact in the index of a log.

    Attributes:
        impact_id: unique over all impacts of all processes.
        start_time: simulation time of its first sample [s].
        samples: how many the whole impact has.
        problem: why it is not complete; empty for a complete impact.
        begin, end: its sample blocks stand between these offsets of the file.
        notes: the values of its metadata record, where there is one.
    """

    impact_id: str
    start_time: float
    samples: int
    problem: str
    begin: int
    end: int
    notes: Mapping[str, str]


class ImpactIndex:
    """The impacts of a source.

    Attributes:
        entries: every impact, complete or not, in the order of the file.
    """

    def __init__(self, source: McapSource) -> None:
        """Find them: by the recorder's metadata, else by reading every block once.

        Raises:
            LogError: no samples of impacts, or damaged.
        """
        self._path, self._source = source.path, source
        self._decoder = Decoder(source)
        self._samples = self._decoder.channels(SAMPLES_TOPIC, SAMPLES_TYPE)
        if not self._samples:
            topics = ", ".join(sorted(c.topic for c in source.channels.values())) or "none"
            raise LogError(f"{self._path}: no topic {SAMPLES_TOPIC}; topics in it: {topics}")
        noted = any(is_impact(index.name) for index in source.metadata_index)
        self.entries = self._noted() if noted else self._found()
        if not self.entries:
            raise LogError(f"{self._path}: no samples of impacts in this log")
        self._results: dict[str, dict[str, Any]] = {CRITERIA_TOPIC: {}, STRIKES_TOPIC: {}}

    def _noted(self) -> list[Entry]:
        """The impacts of a log of the recorder: a metadata record follows each one's samples."""
        entries, begin = [], 0
        for index in self._source.metadata_index:
            if not is_impact(index.name):
                continue
            notes = self._source.metadata(index)
            try:
                start, samples = float(notes["start_time"]), int(notes["samples"])
                complete, problem = bool(json.loads(notes["complete"])), notes["problem"]
                if not 0.0 <= start <= LATEST_START or not 0 <= samples <= MOST_SAMPLES:
                    raise ValueError("out of range")
                name = check_impact_id(index.name.removeprefix(IMPACT))
            except (KeyError, ValueError, RecursionError) as error:
                raise LogError(f"{self._path}: metadata {index.name}: damaged: {error!r}") from None
            problem = "" if complete else problem or "incomplete"
            entries.append(Entry(name, start, samples, problem, begin, index.offset, notes))
            begin = index.offset
        return entries

    def _found(self) -> list[Entry]:
        """The impacts of any other log, found by reading every block once."""
        entries: list[Entry] = []
        begins: dict[str, int] = {}
        position = 0
        for position, block, ended in self._assembled(0, None):
            if block is not None:
                begins.setdefault(block.impact_id, position)
            for done in ended:
                entries.append(
                    Entry(
                        impact_id=done.impact_id,
                        start_time=done.start_time,
                        samples=done.total,
                        problem=done.problem,
                        begin=begins.pop(done.impact_id, position),
                        end=position + 1,
                        notes={},
                    )
                )
        return entries

    def _assembled(
        self, begin: int, end: int | None
    ) -> Iterator[tuple[int, Block | None, list[Assembled]]]:
        """Offset in the file, block, and what ended with it; at last what was left open."""
        assemblers = {channel: Assembler() for channel in self._samples}
        position = begin
        for message in self._source.messages(self._samples, begin, end):
            position = message.position
            block = self._block(message.channel, message.data)
            yield position, block, assemblers[message.channel].feed(block)
        for assembler in assemblers.values():
            yield position, None, assembler.abandon("the log ends")

    def _block(self, channel: int, data: bytes) -> Block:
        topic = self._source.channels[channel].topic
        message = self._decoder.decode(channel, data)
        try:
            if len(message.layout.dim) != 2:
                raise IncompleteError(f"{len(message.layout.dim)} dimensions, expected 2")
            header, labels = (dimension.label for dimension in message.layout.dim)
            return parse_block(header, labels, message.data)
        except IncompleteError as error:
            raise LogError(f"{self._path}: {topic}: {error}") from error

    def read(self, entry: Entry) -> tuple[ImpactRecord, str | None]:
        """Samples and compiled model of an impact.

        Raises:
            LogError: they are damaged.
        """
        model, problem = None, "no samples of it are where the index says"
        for _, block, ended in self._assembled(entry.begin, entry.end):
            if block is not None and block.impact_id == entry.impact_id and block.model:
                model = block.model
            for done in ended:
                if done.impact_id == entry.impact_id:
                    if done.record is not None:
                        self._compare(entry, done.record)
                        return done.record, model
                    problem = done.problem
        raise LogError(f"{self._path}: impact {entry.impact_id}: {problem}")

    def _compare(self, entry: Entry, record: ImpactRecord) -> None:
        """Refuse samples of another impact than the one that the metadata tells of."""
        given = entry.notes.get("setup")
        if given is not None and parsed_setup(given, self._path) != record.setup:
            raise LogError(
                f"{self._path}: impact {entry.impact_id}: the setup in the metadata is not that of "
                "the samples"
            )
        if len(record) != entry.samples:
            raise LogError(
                f"{self._path}: impact {entry.impact_id}: {len(record)} samples, the metadata has "
                f"{entry.samples}"
            )

    def logged(self, entry: Entry) -> Evaluation | None:
        """The criteria in the log; None if it has none for this impact, or if it is a fall.

        Raises:
            LogError: what was logged is no result, in words.
        """
        found: Evaluation | None = self._result(entry, CRITERIA_TOPIC, evaluation_of)
        return found

    def strikes(self, entry: Entry) -> tuple[JudgedStrike, ...] | None:
        """The head strikes in the log; None if it has none for this fall, or if it is an impact.

        Raises:
            LogError: what was logged is no result, in words.
        """
        found: tuple[JudgedStrike, ...] | None = self._result(entry, STRIKES_TOPIC, strikes_of)
        return found

    def _result(
        self, entry: Entry, topic: str, parse: Callable[[Any], tuple[str, Any]]
    ) -> Any | None:
        known = self._results[topic]
        if entry.impact_id not in known:
            self._look_for(entry, topic, parse)
        found = known.get(entry.impact_id)
        if isinstance(found, LogError):
            raise found
        return found

    def _look_for(self, entry: Entry, topic: str, parse: Callable[[Any], tuple[str, Any]]) -> None:
        """Read results from the impact's samples on, until those of the impact were met."""
        known = self._results[topic]
        channels = self._decoder.channels(topic, CRITERIA_TYPE)
        for message in self._source.messages(channels, entry.begin):
            array = self._decoder.decode(message.channel, message.data)
            impact_id = array.status[0].hardware_id if array.status else ""
            if impact_id not in known:
                try:
                    known[impact_id] = parse(array)[1]
                except LogError as error:
                    text = f"{self._path}: impact {impact_id}: {error}"
                    known[impact_id] = LogError(text)
            if impact_id == entry.impact_id:
                return


def parsed_setup(text: str, path: Path) -> dict[str, Any]:
    """The setup in the metadata of an impact.

    Raises:
        LogError: it is none.
    """
    try:
        setup = json.loads(text)
        if isinstance(setup, dict):
            return setup
    except (ValueError, RecursionError):
        pass
    raise LogError(f"{path}: damaged: a setup that is no JSON object")


def is_impact(name: str) -> bool:
    """Whether a metadata record of this name is about an impact."""
    return name.startswith(IMPACT)


def clock_warnings(entries: list[Entry]) -> Iterator[str]:
    """Where simulation time does not grow from impact to impact."""
    for before, after in pairwise(entries):
        if after.start_time <= before.start_time:
            yield (
                f"simulation time runs backwards from impact {before.impact_id} "
                f"({before.start_time:g} s) to {after.impact_id} ({after.start_time:g} s): "
                "this log holds more than one simulation"
            )
