"""The sound records of a damaged MCAP file, also past what is damaged."""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Iterator
from io import BytesIO
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.summary import Summary

from helmet_sim_ros.mcap_log.blocks import check_impact_id
from helmet_sim_ros.mcap_log.layout import FORMAT_KEY, IMPACT
from helmet_sim_ros.mcap_log.records import (
    BROKEN,
    MAGIC,
    MESSAGE,
    RECORD,
    RECORD_LIMIT,
    read_attachment,
    read_chunk,
    read_metadata,
    read_record,
    records_of,
)
from helmet_sim_ros.mcap_log.seal import unsealed
from helmet_sim_ros.mcap_log.summary import DATA_END, checksum, read_index

#: How a chunk, a metadata record and an attachment of a log begin: where to go on after damage.
_LANDMARK = re.compile(
    rb"\x06.{7}\0.{28}\x04\0\0\0zstd|\x0c.{7}\0.\0\0\0(?:impact/|run)|"
    rb"\x09.{7}\0.{16}.\0\0\0(?:model_|scenario|geometry|foam_)",
    re.DOTALL,
)
#: What may stand in the data of a file; records of others (0x80 and more) are skipped.
_DATA: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.MESSAGE: Message,
    Opcode.CHUNK: None,
    Opcode.MESSAGE_INDEX: None,
    Opcode.ATTACHMENT: None,
    Opcode.METADATA: None,
}
_FOREIGN = 0x80


class Salvage:
    """The sound records of a file, those inside chunks too, in order.

    Attributes:
        problems: what is damaged and where; known once the iteration has ended.
        summary: the index, where it is sound.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, 2)
        self._format: int | None = None
        self.problems: list[str] = []
        self.summary: Summary | None = None
        self._end: int | None = None
        try:
            index = read_index(stream)
            if index.checked:
                self.summary, self._end = index.summary, index.data_end
                self._format = max(map(_format, index.summary.channels.values()), default=None)
        except BROKEN:
            pass

    def __iter__(self) -> Iterator[Any]:
        """Records of :mod:`mcap.records`; those of the index first, where there is a sound one."""
        if self._format is None:  # what stands before the first channel is checked by it too
            self._format = next(
                (_format(record) for record in self._walk() if isinstance(record, Channel)), 1
            )
        self.problems = []
        if self.summary is not None:
            yield from self.summary.schemas.values()
            yield from self.summary.channels.values()
        yield from self._walk()

    def _walk(self) -> Iterator[Any]:
        offset: int | None = len(MAGIC)
        while offset is not None:
            try:
                opcode, end = self._head(offset)
                if opcode == Opcode.DATA_END:
                    self._finish(offset)
                    return
                found = list(self._records(offset, opcode))
            except BROKEN as error:
                offset = self._past(offset, error)
                continue
            yield from found
            offset = end

    def _head(self, offset: int) -> tuple[int, int]:
        """Opcode and end of the record at an offset."""
        self._stream.seek(offset)
        head = self._stream.read(RECORD.size)
        if len(head) < RECORD.size:
            raise EOFError("the file was never finished" if not head else "cut off")
        opcode, length = RECORD.unpack(head)
        end = offset + RECORD.size + length
        if opcode == Opcode.DATA_END:
            if length != DATA_END.size - RECORD.size or self._end not in (None, offset):
                raise ValueError("an end mark where none belongs")
        elif opcode not in _DATA and (opcode < _FOREIGN or self._format != 1):
            raise ValueError("no record begins there")
        elif opcode == Opcode.HEADER and offset != len(MAGIC):
            raise ValueError("a header where none belongs")
        if end > self._size:
            raise EOFError("cut off")
        return opcode, end

    def _records(self, offset: int, opcode: int) -> Iterator[Any]:
        if opcode == Opcode.CHUNK:
            _, data = read_chunk(self._stream, offset, bare=self._format == 1)
            for kind, begin, end in records_of(data):
                yield from self._parsed(kind, data[begin:end])
        elif opcode == Opcode.METADATA:
            record = read_metadata(self._stream, offset)
            values = record.metadata
            if self._format is None or self._format > 1:
                values = unsealed(record.name, values)
            if record.name.startswith(IMPACT):
                check_impact_id(record.name.removeprefix(IMPACT))
            yield Metadata(record.name, values)
        elif opcode == Opcode.ATTACHMENT:
            yield read_attachment(self._stream, offset, bare=self._format == 1)
        else:
            content = read_record(self._stream, offset, opcode)
            if opcode == Opcode.MESSAGE_INDEX:
                (size,) = struct.unpack_from("<I", content, 2)
                if size + 6 != len(content) or size % 16:  # or it would hide what it reaches over
                    raise ValueError("it contradicts itself")
            yield from self._parsed(opcode, content)

    def _parsed(self, opcode: int, content: bytes) -> Iterator[Any]:
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = MESSAGE.unpack_from(content)
            yield Message(channel, log_time, content[MESSAGE.size :], publish_time, sequence)
        elif kind := _DATA.get(opcode):
            stream = ReadDataStream(BytesIO(content))
            found = kind.read(stream)
            if stream.count != len(content):
                raise ValueError("longer than what is in it")
            yield found

    def _past(self, offset: int, error: BaseException) -> int | None:
        """Where the next sound record is, after damage at ``offset``."""
        left = self._size - offset
        target = self._next(offset)
        if target is not None:
            self.problems.append(
                f"{self._kind(offset)}: {target - offset} bytes at offset {offset} are damaged "
                f"({error})"
            )
        elif left:
            self.problems.append(
                f"{self._kind(offset)}: the last {left} bytes, from offset {offset}, are cut off "
                "or damaged"
            )
        else:
            self.problems.append("the file was never finished")
        return target

    def _next(self, offset: int) -> int | None:
        candidates = sorted({*self._landmarks(offset), *self._behind(offset)})
        for candidate in candidates:
            try:
                opcode, _ = self._head(candidate)
                if opcode != Opcode.DATA_END:
                    list(self._records(candidate, opcode))
            except BROKEN:
                continue
            return candidate
        return None

    def _behind(self, offset: int) -> Iterator[int]:
        """The end of the damaged record, if its length may be true; what the index knows."""
        self._stream.seek(offset)
        head = self._stream.read(RECORD.size)
        if len(head) == RECORD.size:
            _, length = RECORD.unpack(head)
            if length <= RECORD_LIMIT and offset + RECORD.size + length < self._size:
                yield offset + RECORD.size + length
        if self._end is not None and self._end > offset:
            yield self._end

    def _landmarks(self, offset: int) -> Iterator[int]:
        with mmap.mmap(self._stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            for match in _LANDMARK.finditer(data, offset + 1, self._end or self._size):
                yield match.start()

    def _kind(self, offset: int) -> str:
        """What the index, or the damaged record itself, says is there."""
        if self.summary is not None:
            for metadata in self.summary.metadata_indexes:
                if metadata.offset == offset:
                    return f"metadata {metadata.name}"
            for attachment in self.summary.attachment_indexes:
                if attachment.offset == offset:
                    return f"attachment {attachment.name}"
        self._stream.seek(offset)
        opcode = self._stream.read(1)
        known = opcode and opcode[0] in _DATA
        return Opcode(opcode[0]).name.lower().replace("_", " ") if known else "data"

    def _finish(self, offset: int) -> None:
        """The end mark was reached: is all before it as it was written?"""
        self._stream.seek(offset)
        _, _, expected = DATA_END.unpack(self._stream.read(DATA_END.size))
        if expected and not self.problems and checksum(self._stream, offset) != expected:
            self.problems.append("the checksum over all of the file is wrong")
        if self.summary is None:
            self.problems.append("the index at the end of the file is damaged")


def _format(channel: Channel) -> int:
    text = channel.metadata.get(FORMAT_KEY, "1")
    return int(text) if text.isdecimal() and len(text) < 7 else 1
