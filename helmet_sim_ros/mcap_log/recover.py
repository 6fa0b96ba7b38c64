"""Make a valid log of one that was never finished, up to its last complete impact."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from helmet_sim_ros.errors import IncompleteError, LogError
from helmet_sim_ros.mcap_log.blocks import Assembler, Block, parse_block
from helmet_sim_ros.mcap_log.decode import Decoder
from helmet_sim_ros.mcap_log.layout import (
    CRITERIA_TOPIC,
    CRITERIA_TYPE,
    IMPACT,
    RECOVERED,
    RUN,
    SAMPLES_TOPIC,
    SAMPLES_TYPE,
)
from helmet_sim_ros.mcap_log.records import (
    BROKEN,
    MESSAGE,
    RECORD,
    RECORD_LIMIT,
    check_magic,
    read_chunk,
    records_of,
    unreadable,
)
from helmet_sim_ros.mcap_log.source import McapSource
from helmet_sim_ros.mcap_log.writer import PART

SUFFIX = ".mcap"

_CLASSES: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


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
        complete: ids of the complete impacts.
        first: first block of the last complete impact.
        last: number of the record that completes it; later ones belong to what is lost.
        noted: impacts that have a metadata record, and whether it says that they are complete.
        samples, criteria: ids of their channels.
        lost: what is lost, in words.
    """

    complete: set[str] = field(default_factory=set)
    first: Block | None = None
    last: int = -1
    noted: dict[str, bool] = field(default_factory=dict)
    has_run: bool = False
    samples: set[int] = field(default_factory=set)
    criteria: set[int] = field(default_factory=set)
    lost: list[str] = field(default_factory=list)


class _Sound:
    """The sound records of a damaged file, also those inside chunks, in order.

    Attributes:
        problems: what is damaged, known once the iteration has ended.
        finished: whether the file has an end mark.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self.problems: list[str] = []
        self.finished = False

    def __iter__(self) -> Iterator[Any]:
        offset = 8
        while not self.finished:
            self._stream.seek(offset)
            head = self._stream.read(RECORD.size)
            opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
            end = offset + RECORD.size + length
            if not 0 < opcode <= Opcode.DATA_END or end > self._size or length > RECORD_LIMIT:
                left = self._size - offset
                self.problems.append(
                    f"the last {left} bytes are cut off" if left else "the file was never finished"
                )
                return
            self.finished = opcode in (Opcode.DATA_END, Opcode.FOOTER)
            try:
                found = list(self._records(offset, opcode, length))
            except BROKEN as error:
                self.problems.append(f"{length} bytes at offset {offset} are damaged ({error})")
                found = []
            yield from found
            offset = end

    def _records(self, offset: int, opcode: int, length: int) -> Iterator[Any]:
        if opcode == Opcode.CHUNK:
            _, data = read_chunk(self._stream, offset)
            for kind, begin, end in records_of(data):
                yield from _parsed(kind, data[begin:end])
        else:
            yield from _parsed(opcode, self._stream.read(length))


def _parsed(opcode: int, content: bytes) -> Iterator[Any]:
    if opcode == Opcode.MESSAGE:
        channel, sequence, log_time, publish_time = MESSAGE.unpack_from(content)
        yield Message(channel, log_time, content[MESSAGE.size :], publish_time, sequence)
    elif opcode in _CLASSES:
        yield _CLASSES[opcode].read(ReadDataStream(BytesIO(content)))


class _Definitions:
    """Schemas and channels met so far, as a source of a :class:`Decoder`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}


def _plan(stream: IO[bytes], path: Path) -> _Plan:
    """Read everything once and see which impacts are complete."""
    plan, known, sound = _Plan(), _Definitions(path), _Sound(stream)
    decoder = Decoder(known)
    assemblers: dict[int, Assembler] = {}
    firsts: dict[str, Block] = {}
    for number, record in enumerate(sound):
        if isinstance(record, Schema):
            known.schemas[record.id] = record
        elif isinstance(record, Channel):
            known.channels[record.id] = record
            plan.samples = set(decoder.channels(SAMPLES_TOPIC, SAMPLES_TYPE))
            plan.criteria = set(decoder.channels(CRITERIA_TOPIC, CRITERIA_TYPE))
        elif isinstance(record, Metadata):
            plan.has_run |= record.name == RUN
            if record.name.startswith(IMPACT):
                complete = record.metadata.get("complete") == "true"
                plan.noted[record.name.removeprefix(IMPACT)] = complete
        elif isinstance(record, Message) and record.channel_id in plan.samples:
            block = _block(decoder, record, path)
            if block.first == 0:
                firsts[block.impact_id] = block
            assembler = assemblers.setdefault(record.channel_id, Assembler())
            for done in assembler.feed(block):
                if done.record is None:
                    plan.lost.append(done.problem)
                    continue
                plan.complete.add(done.impact_id)
                plan.first, plan.last = firsts.pop(done.impact_id), number
    for assembler in assemblers.values():
        plan.lost += [done.problem for done in assembler.abandon("the log ends")]
    if sound.finished and not sound.problems:
        try:
            McapSource(path)
        except LogError:
            sound.problems.append("the index at the end of the file is damaged")
    # One that was killed before it had its final name is complete, and yet no finished log.
    if not sound.problems and not path.name.endswith(PART):
        raise LogError(f"{path}: is finished and sound, there is nothing to recover")
    for impact_id, complete in plan.noted.items():
        if complete and impact_id not in plan.complete:
            plan.lost.append(f"impact {impact_id}: its samples are damaged")
    plan.lost += sound.problems
    if not plan.complete:
        what = "; ".join(plan.lost) or "no samples were written"
        raise LogError(f"{path}: nothing to recover, no impact in it is complete ({what})")
    return plan


def _block(decoder: Decoder, record: Message, path: Path) -> Block:
    message = decoder.decode(record.channel_id, record.data)
    try:
        header, labels = (dimension.label for dimension in message.layout.dim)
        return parse_block(header, labels, message.data)
    except (IncompleteError, ValueError) as error:
        raise LogError(f"{path}: {SAMPLES_TOPIC}: {error}") from error


def _copy(stream: IO[bytes], plan: _Plan, target: Path) -> None:
    """Write what the plan keeps; the target appears only when it is complete."""
    unfinished = target.with_name(target.name + ".recovering")
    try:
        with open(unfinished, "wb") as output:
            writer = Writer(output, compression=CompressionType.ZSTD)
            copier = _Copier(writer, plan, unfinished)
            for number, record in enumerate(_Sound(stream)):
                copier.add(record, number <= plan.last)
            copier.add_missing_notes()
            writer.add_metadata(RECOVERED, {"lost": json.dumps(plan.lost)})
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
        self._writer, self._plan = writer, plan
        self._known = _Definitions(path)
        self._decoder = Decoder(self._known)
        self._schemas = {0: 0}
        self._channels: dict[int, int] = {}
        self._models: set[str] = set()
        self._end = 0

    def add(self, record: Any, keep: bool) -> None:
        """Write a record; of those not to be kept, only what belongs to a complete impact."""
        writer = self._writer
        if isinstance(record, Header):
            writer.start(record.profile, record.library)
        elif isinstance(record, Schema) and record.id not in self._schemas:
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
            self._end = max(self._end, record.log_time)
            writer.add_message(
                self._channels[record.channel_id], record.log_time, record.data,
                record.publish_time, record.sequence,
            )  # fmt: skip
        elif isinstance(record, Attachment):
            self._models.add(record.name)
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            self._add_metadata(record, keep)

    def _add_metadata(self, record: Metadata, keep: bool) -> None:
        impact = record.name.removeprefix(IMPACT)
        values = dict(record.metadata)
        if record.name != impact and impact not in self._plan.complete:
            if not keep:
                return
            if values.get("complete") == "true":  # it was, but samples of it are damaged
                values |= {
                    "complete": "false",
                    "problem": f"impact {impact}: its samples are damaged",
                }
        self._writer.flush()  # type: ignore[no-untyped-call] # stays behind what was before it
        self._writer.add_metadata(record.name, values)

    def add_missing_notes(self) -> None:
        """The metadata of a complete impact that the recorder had no time for."""
        first = self._plan.first
        if first is None or first.impact_id in self._plan.noted or not self._plan.has_run:
            return
        values = {
            "start_time": repr(first.start_time),
            "samples": str(first.total),
            "complete": "true",
            "problem": "",
            "setup": json.dumps(first.setup),
        }
        if first.model is not None:
            digest = hashlib.sha256(first.model.encode()).hexdigest()[:12]
            values["model"] = f"model_{digest}.xml"
            if values["model"] not in self._models:
                self._writer.add_attachment(
                    self._end, self._end, values["model"], "application/xml", first.model.encode()
                )
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._writer.add_metadata(IMPACT + first.impact_id, values)

    def _judges_complete(self, record: Message) -> bool:
        """Whether a message holds the criteria of a complete impact."""
        if record.channel_id not in self._plan.criteria:
            return False
        status = self._decoder.decode(record.channel_id, record.data).status
        return bool(status) and status[0].hardware_id in self._plan.complete
