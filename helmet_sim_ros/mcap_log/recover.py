"""Make a valid log of one that was never finished, up to its last complete impact."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from helmet_sim_ros.errors import IncompleteError, LogError
from helmet_sim_ros.mcap_log.blocks import Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.decode import Decoder
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST
from helmet_sim_ros.mcap_log.layout import (
    CRITERIA_TOPIC,
    CRITERIA_TYPE,
    FORMAT_KEY,
    IMPACT,
    NO_CRITERIA,
    RECOVERED,
    RUN,
    SAMPLES_TOPIC,
    SAMPLES_TYPE,
    STRIKES_TOPIC,
)
from helmet_sim_ros.mcap_log.records import BROKEN, check_magic, unreadable
from helmet_sim_ros.mcap_log.salvage import Salvage
from helmet_sim_ros.mcap_log.seal import sealed
from helmet_sim_ros.mcap_log.source import McapSource
from helmet_sim_ros.mcap_log.writer import PART

SUFFIX = ".mcap"


@dataclass(frozen=True)
class Recovery:
    """What a recovery gave.

    Attributes:
        path: the valid log.
        impacts: complete impacts in it.
        lost: what is not in it, in words.
    """

    path: Path
    impacts: int
    lost: tuple[str, ...]


def recovered_path(path: Path) -> Path:
    """Where the recovery of a log goes: its name without ``.part``, or ``NAME_recovered.mcap``."""
    if path.name.endswith(SUFFIX + PART):
        return path.with_name(path.name.removesuffix(PART))
    return path.with_name(f"{path.name.removesuffix(PART).removesuffix(SUFFIX)}_recovered{SUFFIX}")


def recover(path: Path, target: Path | None = None) -> Recovery:
    """Write a valid log with everything up to the last complete impact; ``path`` stays as it is.

    Args:
        path: a log that was never finished, or that is cut off or damaged.
        target: where to write; None: :func:`recovered_path`. An existing file is never replaced.

    Raises:
        LogError: it cannot be read, holds no complete impact or is not damaged; the target exists
            or cannot be written.
    """
    target = recovered_path(path) if target is None else target
    if target.exists():
        raise LogError(f"{target}: exists already")
    try:
        with open(path, "rb") as stream:
            check_magic(stream, path)
            plan = _plan(stream, path)
            _copy(stream, plan, target)
    except LogError:
        raise
    except BROKEN as error:
        raise unreadable(path, error) from error
    return Recovery(target, len(plan.complete), tuple(plan.lost))


@dataclass
class _Plan:
    """What of a damaged file to keep.

    Attributes:
        complete: ids of the complete impacts, and the number of the record that completes each.
        last: number of the record that completes the last one; later ones belong to what is lost.
        notes: the values of the sound metadata record of each impact that has one.
        judged: impacts that have criteria.
        attached, described: names of the sound attachments and metadata records.
        sealed: whether its metadata has seals.
        recorded: whether the recorder wrote this file, so that impacts have metadata records.
        samples, criteria: ids of their channels; criteria with those of head strikes.
        lost: what is lost, in words.
    """

    complete: dict[str, int] = field(default_factory=dict)
    last: int = -1
    notes: dict[str, dict[str, str]] = field(default_factory=dict)
    judged: set[str] = field(default_factory=set)
    attached: set[str] = field(default_factory=set)
    described: set[str] = field(default_factory=set)
    sealed: bool = False
    recorded: bool = False
    samples: set[int] = field(default_factory=set)
    criteria: set[int] = field(default_factory=set)
    lost: list[str] = field(default_factory=list)


class _Definitions:
    """Schemas and channels met so far, as a source of a :class:`Decoder`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}


def _plan(stream: IO[bytes], path: Path) -> _Plan:
    """Read everything once and see which impacts are complete."""
    plan, known, sound = _Plan(), _Definitions(path), Salvage(stream)
    decoder = Decoder(known)
    assemblers: dict[int, Assembler] = {}
    for number, record in enumerate(sound):
        if isinstance(record, Schema):
            known.schemas[record.id] = record
        elif isinstance(record, Channel):
            known.channels[record.id] = record
            plan.samples = set(decoder.channels(SAMPLES_TOPIC, SAMPLES_TYPE))
            topics = (CRITERIA_TOPIC, STRIKES_TOPIC)
            plan.criteria = {c for name in topics for c in decoder.channels(name, CRITERIA_TYPE)}
            plan.sealed |= FORMAT_KEY in record.metadata
        elif isinstance(record, Attachment):
            plan.attached.add(record.name)
        elif isinstance(record, Metadata):
            plan.described.add(record.name)
            plan.recorded |= record.name == RUN
            if record.name.startswith(IMPACT):
                plan.notes[record.name.removeprefix(IMPACT)] = record.metadata
        elif isinstance(record, Message) and record.channel_id in plan.samples:
            block = _block(decoder, record, path)
            assembler = assemblers.setdefault(record.channel_id, Assembler())
            for done in assembler.feed(block):
                if done.record is None:
                    plan.lost.append(done.problem)
                else:
                    plan.complete.setdefault(done.impact_id, number)
                    plan.last = number
        elif isinstance(record, Message) and record.channel_id in plan.criteria:
            plan.judged.add(_judged(decoder, record))
    for assembler in assemblers.values():
        plan.lost += [done.problem for done in assembler.abandon("the log ends")]
    # One that was killed before it had its final name is complete, and yet no finished log.
    if not sound.problems and not path.name.endswith(PART):
        McapSource(path)  # whatever else is wrong with it is told
        raise LogError(f"{path}: is finished and sound, there is nothing to recover")
    plan.lost += _missing(plan, sound) + sound.problems
    if not plan.complete:
        what = "; ".join(plan.lost) or "no samples were written"
        raise LogError(f"{path}: nothing to recover, no impact in it is complete ({what})")
    return plan


def _missing(plan: _Plan, sound: Salvage) -> list[str]:
    """What is not there, by what the sound records and the index tell of."""
    lost = [
        f"impact {impact_id}: its samples are damaged"
        for impact_id, values in plan.notes.items()
        if values.get("complete") == "true" and impact_id not in plan.complete
    ]
    if sound.summary is not None:
        indexed = dict.fromkeys(index.name for index in sound.summary.metadata_indexes)
        for name in indexed:
            if name in plan.described:
                continue
            impact_id = name.removeprefix(IMPACT)
            if name == impact_id:
                lost.append(f"metadata {name}")
            elif impact_id not in plan.complete:
                lost.append(f"impact {impact_id}: it is damaged")
        names = {index.name: None for index in sound.summary.attachment_indexes}
        lost += [f"attachment {name}" for name in names if name not in plan.attached]
        counts = sound.summary.statistics
        logged = counts and sum(counts.channel_message_counts.get(c, 0) for c in plan.criteria)
        if logged == len(plan.judged):  # of as many impacts as there ever were criteria
            return lost
    silent = [
        impact_id
        for impact_id in plan.complete
        if impact_id not in plan.judged and NO_CRITERIA + impact_id not in plan.described
    ]
    if silent:
        lost.append(f"criteria, lost or never logged, of impacts {', '.join(silent)}")
    return lost


def _block(decoder: Decoder, record: Message, path: Path) -> Block:
    message = decoder.decode(record.channel_id, record.data)
    try:
        header, labels = (dimension.label for dimension in message.layout.dim)
        return parse_block(header, labels, message.data)
    except (IncompleteError, ValueError) as error:
        raise LogError(f"{path}: {SAMPLES_TOPIC}: {error}") from error


def _judged(decoder: Decoder, record: Message) -> str:
    """The impact that criteria belong to."""
    status = decoder.decode(record.channel_id, record.data).status
    return str(status[0].hardware_id) if status else ""


def _copy(stream: IO[bytes], plan: _Plan, target: Path) -> None:
    """Write what the plan keeps; the target appears only when it is complete."""
    unfinished = target.with_name(target.name + ".recovering")
    try:
        with open(unfinished, "wb") as output:
            writer = Writer(output, compression=CompressionType.ZSTD, enable_data_crcs=True)
            copier = _Copier(writer, plan, unfinished)
            for number, record in enumerate(Salvage(stream)):
                copier.add(record, number)
            copier.add_metadata(RECOVERED, {"lost": json.dumps(plan.lost)})
            writer.finish()  # type: ignore[no-untyped-call]
            output.flush()
            os.fsync(output.fileno())
        os.link(unfinished, target)  # unlike a rename, it never replaces a file
    except FileExistsError as error:
        raise LogError(f"{target}: exists already") from error
    except OSError as error:
        raise LogError(f"{target}: cannot be written: {error.strerror}") from error
    finally:
        unfinished.unlink(missing_ok=True)


class _Copier:
    """Writes records again, under new ids, if they are to be kept."""

    def __init__(self, writer: Writer, plan: _Plan, path: Path) -> None:
        self._writer, self._plan, self._path = writer, plan, path
        self._known = _Definitions(path)
        self._decoder = Decoder(self._known)
        self._schemas = {0: 0}
        self._channels: dict[int, int] = {}
        self._attached: set[str] = set()
        self._noted: set[str] = set()
        self._first: Block | None = None
        self._end = 0
        self._started = False

    def add(self, record: Any, number: int) -> None:
        """Write a record; behind the last complete impact only what belongs to a complete one."""
        writer, keep = self._writer, number <= self._plan.last
        if not self._started:  # without a sound header, as what the recorder writes
            self._started = True
            header = record if isinstance(record, Header) else Header("ros2", "")
            writer.start(header.profile, header.library)
        if isinstance(record, Schema) and record.id not in self._schemas:
            self._known.schemas[record.id] = record
            new = writer.register_schema(record.name, record.encoding, record.data)
            self._schemas[record.id] = new
        elif isinstance(record, Channel) and record.id not in self._channels:
            self._known.channels[record.id] = record
            self._channels[record.id] = writer.register_channel(
                record.topic, record.message_encoding, self._schemas[record.schema_id],
                record.metadata,
            )  # fmt: skip
        elif isinstance(record, Message) and (keep or self._judges_complete(record)):
            self._copy_message(record, number)
        elif isinstance(record, Attachment) and record.name not in self._attached:
            self._attached.add(record.name)
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            self._copy_metadata(record, keep)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write a metadata record behind everything so far, sealed in a log that has seals."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._writer.add_metadata(name, sealed(name, values) if self._plan.sealed else values)

    def _copy_message(self, record: Message, number: int) -> None:
        self._end = max(self._end, record.log_time)
        self._writer.add_message(
            self._channels[record.channel_id], record.log_time, record.data, record.publish_time,
            record.sequence,
        )  # fmt: skip
        if record.channel_id in self._plan.samples:
            block = _block(self._decoder, record, self._path)
            if block.first == 0:
                self._first = block
            if self._plan.complete.get(block.impact_id) == number:
                self._note(block)

    def _copy_metadata(self, record: Metadata, keep: bool) -> None:
        """Copy what is not about a complete impact: that is written behind its samples."""
        impact, values = record.name.removeprefix(IMPACT), dict(record.metadata)
        if record.name != impact:
            if impact in self._plan.complete or impact in self._noted or not keep:
                return
            self._noted.add(impact)
            if values.get("complete") == "true":  # it was, but samples of it are damaged
                values |= {
                    "complete": "false",
                    "problem": f"impact {impact}: its samples are damaged",
                }
        self.add_metadata(record.name, values)

    def _note(self, last: Block) -> None:
        """Write the metadata of an impact that this block completes: its own, or made from its
        samples."""
        impact = last.impact_id
        first, values = self._first, self._plan.notes.get(impact)
        if first is None or first.impact_id != impact:
            return  # cannot be: the record that completes it follows its first block
        if values is None:
            if not (self._plan.recorded or self._plan.sealed):
                return
            values = {
                "start_time": repr(first.start_time),
                "samples": str(last.first + len(last.data)),
                "complete": "true",
                "problem": "",
                "setup": json.dumps(first.setup),
            }
            if first.setup_digest is not None:
                values[SETUP_DIGEST] = first.setup_digest
            if first.model is not None:
                digest = hashlib.sha256(first.model.encode()).hexdigest()[:12]
                values["model"] = f"model_{digest}.xml"
        name = values.get("model")
        if name and first.model is not None and name not in self._plan.attached | self._attached:
            self._attached.add(name)
            self._writer.add_attachment(
                self._end, self._end, name, "application/xml", first.model.encode()
            )
        self.add_metadata(IMPACT + impact, values)

    def _judges_complete(self, record: Message) -> bool:
        """Whether a message holds the criteria of a complete impact."""
        if record.channel_id not in self._plan.criteria:
            return False
        return _judged(self._decoder, record) in self._plan.complete
