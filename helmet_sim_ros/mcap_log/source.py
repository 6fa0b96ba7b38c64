"""Random access to the messages, metadata and attachments of an MCAP file, without ROS."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, Header, MetadataIndex, Schema
from mcap.summary import Summary

from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.layout import FORMAT_KEY
from helmet_sim_ros.mcap_log.records import (
    BROKEN,
    MAGIC,
    MESSAGE,
    check_magic,
    read_attachment,
    read_chunk,
    read_metadata,
    read_record,
    records_of,
    unreadable,
    walk,
)
from helmet_sim_ros.mcap_log.seal import unsealed
from helmet_sim_ros.mcap_log.summary import read_index

#: Later times [ns] are wall-clock times: simulation time starts at 0, 10^17 ns is in 1973.
WALL_CLOCK = 10**17


class RawMessage(NamedTuple):
    """A message as it stands in the file.

    Attributes:
        position: offset in the file of the chunk, or of the record, that holds it.
        channel: id of its channel.
        log_time: [ns].
        data: serialised message.
    """

    position: int
    channel: int
    log_time: int
    data: bytes


class McapSource:
    """A finished MCAP file. Nothing but its index is read until it is asked for.

    Whatever is read is checked: the index, chunks and attachments by MCAP's checksums, metadata
    by its seal, and each against what the index says of it.

    Attributes:
        path: the file.
        library: what wrote the file.
        format: version of the log format that its channels state; 1 where they state none.
        checked: whether a checksum covers the index.
        channels: by id.
        schemas: by id.
        metadata_index: name and offset of each metadata record, in the order of the file.
        attachments: media type of each, by name, in the order of the file.
    """

    def __init__(self, path: Path) -> None:
        """Read the index.

        Raises:
            LogError: no such file, not an MCAP file, of another version, unfinished or damaged.
        """
        self.path = path
        with self._stream() as stream:
            _check_ends(stream, path)
            header = read_record(stream, len(MAGIC), Opcode.HEADER)
            index = read_index(stream)
            self.library = Header.read(ReadDataStream(BytesIO(header))).library
        summary, self.checked, self._end = index.summary, index.checked, index.data_end
        self.channels: dict[int, Channel] = summary.channels
        self.format = max(map(_format, self.channels.values()), default=1)
        self.schemas: dict[int, Schema] = summary.schemas
        self._chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
        self.metadata_index: list[MetadataIndex] = sorted(
            summary.metadata_indexes, key=lambda index: index.offset
        )
        self._attachments = sorted(summary.attachment_indexes, key=lambda index: index.offset)
        self.attachments = {index.name: index.media_type for index in self._attachments}
        self._refuse_mixed_clocks(summary)

    def metadata(self, index: MetadataIndex) -> dict[str, str]:
        """The values of one metadata record, without its seal.

        Raises:
            LogError: it is damaged.
        """
        with self._stream() as stream:
            record = read_metadata(stream, index.offset, index.length)
            if record.name != index.name:
                raise McapError(f"metadata {index.name}: its name is another one in the index")
            # Before format 2 there was no seal: nothing covers these values.
            return unsealed(record.name, record.metadata) if self.format > 1 else record.metadata

    def attachment(self, name: str) -> bytes:
        """The content of an attachment.

        Raises:
            LogError: there is none of this name, or it is damaged.
        """
        for index in self._attachments:
            if index.name == name:
                return self._attached(index)
        raise LogError(f"{self.path}: no attachment {name!r}")

    def _attached(self, index: AttachmentIndex) -> bytes:
        with self._stream() as stream:
            record = read_attachment(stream, index.offset, index.length, bare=self.format == 1)
            if (record.name, len(record.data)) != (index.name, index.data_size):
                raise McapError(f"the attachment {index.name} is not what the index says")
            return bytes(record.data)

    def messages(
        self, channels: Collection[int], begin: int = 0, end: int | None = None
    ) -> Iterator[RawMessage]:
        """The messages of some channels in the order of the file.

        Args:
            channels: their ids.
            begin: first offset in the file.
            end: offset in the file to stop before; None: read on to its end.

        Raises:
            LogError: what is read is damaged.
        """
        wanted = frozenset(channels)
        with self._stream() as stream:
            if not self._chunks:
                yield from self._loose_messages(stream, wanted, begin, end)
            for chunk in self._chunks:
                position = chunk.chunk_start_offset
                indexed = chunk.message_index_offsets
                if position < begin or (indexed and wanted.isdisjoint(indexed)):
                    continue
                if end is not None and position >= end:
                    break
                for channel, time, data in self._chunk_messages(stream, chunk, wanted):
                    yield RawMessage(position, channel, time, data)

    @contextmanager
    def _stream(self) -> Iterator[IO[bytes]]:
        try:
            with open(self.path, "rb") as stream:
                yield stream
        except LogError:
            raise
        except BROKEN as error:
            raise unreadable(self.path, error) from error

    def _chunk_messages(
        self, stream: IO[bytes], index: ChunkIndex, wanted: frozenset[int]
    ) -> Iterator[tuple[int, int, bytes]]:
        bare = self.format == 1
        _, data = read_chunk(stream, index.chunk_start_offset, index.chunk_length, bare)
        for opcode, begin, end in records_of(data):
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = MESSAGE.unpack_from(data, begin)
                if channel in wanted:
                    yield channel, time, data[begin + MESSAGE.size : end]

    def _loose_messages(
        self, stream: IO[bytes], wanted: frozenset[int], begin: int, end: int | None
    ) -> Iterator[RawMessage]:
        """Messages of a file without chunks."""
        for offset, opcode in walk(stream, self._end):
            if end is not None and offset >= end:
                return
            if opcode == Opcode.MESSAGE and offset >= begin:
                content = read_record(stream, offset, opcode)
                channel, _, time, _ = MESSAGE.unpack_from(content)
                if channel in wanted:
                    yield RawMessage(offset, channel, time, content[MESSAGE.size :])

    def _refuse_mixed_clocks(self, summary: Summary) -> None:
        first = [chunk.message_start_time for chunk in self._chunks]
        last = [chunk.message_end_time for chunk in self._chunks]
        if summary.statistics is not None and summary.statistics.message_count:
            first.append(summary.statistics.message_start_time)
            last.append(summary.statistics.message_end_time)
        if first and min(first) < WALL_CLOCK <= max(last):
            raise LogError(
                f"{self.path}: mixed clocks: some messages are stamped in simulation time "
                f"({min(first) * 1e-9:g} s), others with the time of day"
            )


def _check_ends(stream: IO[bytes], path: Path) -> None:
    check_magic(stream, path)
    stream.seek(0, 2)
    if stream.tell() >= 2 * len(MAGIC):
        stream.seek(-len(MAGIC), 2)
        if stream.read() == MAGIC:
            return
    raise LogError(
        f"{path}: never finished, or cut off; 'helmet-sim recover' saves its complete impacts"
    )


def _format(channel: Channel) -> int:
    text = channel.metadata.get(FORMAT_KEY, "1")
    if not text.isdecimal() or len(text) > 6:
        raise McapError(f"log format {text!r}")
    return int(text)
