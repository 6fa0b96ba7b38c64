"""The records of an MCAP file one by one, for what its index does not reach."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Metadata, MetadataIndex, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary

from helmet_sim_ros.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
#: No record of a sound log is larger [byte].
RECORD_LIMIT = 2**30
#: Opcode and length before each record.
RECORD = struct.Struct("<BQ")
#: Channel, sequence, log time and publish time before the data of a message.
MESSAGE = struct.Struct("<HIQQ")

#: What a damaged file makes the MCAP library raise.
BROKEN = (McapError, OSError, ValueError, KeyError, IndexError, EOFError, struct.error, MemoryError)


def unreadable(path: Path, error: BaseException) -> LogError:
    """The error for a file that cannot be read."""
    if isinstance(error, OSError) and error.strerror:
        return LogError(f"{path}: cannot be read: {error.strerror}")
    return LogError(f"{path}: damaged: {str(error) or type(error).__name__}")


def check_magic(stream: IO[bytes], path: Path) -> None:
    """Refuse what does not begin like an MCAP file of the known version.

    Raises:
        LogError: says what it is instead, where that can be told.
    """
    stream.seek(0)
    head = stream.read(len(MAGIC))
    if head == MAGIC:
        return
    if not head:
        raise LogError(f"{path}: the file is empty")
    if len(head) == len(MAGIC) and head[:5] == MAGIC[:5] and head[6:] == MAGIC[6:]:
        raise LogError(f"{path}: MCAP version {head[5:6]!r}; this program knows version 0")
    if head.startswith(b"SQLite"):
        raise LogError(f"{path}: a bag in SQLite form; convert it: ros2 bag convert, storage mcap")
    raise LogError(f"{path}: not an MCAP file")


def walk(stream: IO[bytes], begin: int = len(MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Offset, opcode and length of each record, up to the end of the data section.

    Raises:
        EOFError: the file ends before.
    """
    offset = begin
    while True:
        stream.seek(offset)
        head = stream.read(RECORD.size)
        if len(head) < RECORD.size:
            raise EOFError("it ends without an end mark")
        opcode, length = RECORD.unpack(head)
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return
        yield offset, opcode, length
        offset += RECORD.size + length


def records_of(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record in a chunk."""
    offset = 0
    while offset < len(data):
        opcode, length = RECORD.unpack_from(data, offset)
        offset += RECORD.size
        if offset + length > len(data):
            raise EOFError("a record reaches beyond its chunk")
        yield opcode, offset, offset + length
        offset += length


def read_chunk(stream: IO[bytes], offset: int) -> tuple[Chunk, bytes]:
    """The chunk at an offset of the file, and its content; its checksum is verified."""
    stream.seek(offset)
    opcode, length = RECORD.unpack(stream.read(RECORD.size))
    if opcode != Opcode.CHUNK or length > RECORD_LIMIT:
        raise McapError("no chunk where the index has one")
    content = ReadDataStream(stream)
    chunk = Chunk.read(content)
    if content.count != length or chunk.uncompressed_size > RECORD_LIMIT:
        raise McapError("a chunk that is cut off or contradicts itself")
    try:
        records, size = get_chunk_data_stream(chunk, validate_crc=True)
    except Exception as error:  # each compression library has errors of its own
        raise McapError(f"a chunk that cannot be unpacked ({error})") from error
    return chunk, records.read(size)


def scan(stream: IO[bytes]) -> Summary:
    """The index of a finished file that was written without one."""
    summary = Summary()
    for offset, opcode, length in walk(stream):
        if opcode == Opcode.CHUNK:
            chunk, data = read_chunk(stream, offset)
            summary.chunk_indexes.append(
                ChunkIndex(
                    chunk_start_offset=offset,
                    chunk_length=RECORD.size + length,
                    compression=chunk.compression,
                    compressed_size=len(chunk.data),
                    uncompressed_size=chunk.uncompressed_size,
                    message_start_time=chunk.message_start_time,
                    message_end_time=chunk.message_end_time,
                    message_index_length=0,
                    message_index_offsets={},
                )
            )
            for kind, begin, end in records_of(data):
                _note(summary, kind, data[begin:end])
        else:
            stream.seek(offset + RECORD.size)
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                _note(summary, opcode, stream.read(length))
            elif opcode == Opcode.METADATA:
                name = Metadata.read(ReadDataStream(stream)).name
                summary.metadata_indexes.append(MetadataIndex(offset, length, name))
    return summary


def _note(summary: Summary, opcode: int, content: bytes) -> None:
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(ReadDataStream(BytesIO(content)))
        summary.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(ReadDataStream(BytesIO(content)))
        summary.channels[channel.id] = channel
