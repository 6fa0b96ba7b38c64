"""The index at the end of an MCAP file, checked, or made anew where the file has none."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader
from mcap.summary import Summary

from helmet_sim_ros.mcap_log.records import (
    MAGIC,
    RECORD,
    RECORD_LIMIT,
    read_attachment,
    read_chunk,
    read_metadata,
    read_record,
    records_of,
    walk,
)

#: The whole footer: opcode, length, start of the summary, of its offsets, checksum.
FOOTER = struct.Struct("<BQQQI")
#: The whole record that ends the data: opcode, length, checksum.
DATA_END = struct.Struct("<BQI")


@dataclass(frozen=True)
class Index:
    """What a file says about itself.

    Attributes:
        summary: schemas, channels, and where everything is.
        checked: whether a checksum covers it.
        data_end: offset of the record that ends the data.
    """

    summary: Summary
    checked: bool
    data_end: int


def read_index(stream: IO[bytes]) -> Index:
    """The index of a finished file.

    Raises:
        McapError, ...: it is damaged (see ``BROKEN``).
    """
    end = stream.seek(0, 2) - len(MAGIC) - FOOTER.size
    stream.seek(end)
    footer = stream.read(FOOTER.size)
    opcode, length, start, _, crc = FOOTER.unpack(footer)
    if (opcode, length) != (Opcode.FOOTER, FOOTER.size - RECORD.size):
        raise McapError("no footer at its end")
    begin = start or end
    if not len(MAGIC) + DATA_END.size <= begin <= end or end - begin > RECORD_LIMIT:
        raise McapError("no index where its footer has one")
    data_end = begin - DATA_END.size
    stream.seek(data_end)
    opcode, length, data_crc = DATA_END.unpack(stream.read(DATA_END.size))
    if (opcode, length) != (Opcode.DATA_END, DATA_END.size - RECORD.size):
        raise McapError("no index where its footer has one")
    data = stream.read(end - begin)
    if crc not in (0, zlib.crc32(footer[:-4], zlib.crc32(data))):
        raise McapError("the checksum of its index is wrong")
    if start:
        summary = _parsed(data + footer + MAGIC)
        if _is_whole(summary):
            return Index(summary, crc != 0, data_end)
    if data_crc not in (0, checksum(stream, data_end)):
        raise McapError("the checksum over all of its data is wrong")
    return Index(scan(stream, data_end), data_crc != 0, data_end)


def _parsed(data: bytes) -> Summary:
    summary = Summary()
    reader = StreamReader(BytesIO(data), skip_magic=True, record_size_limit=RECORD_LIMIT)
    for record in reader.records:
        if isinstance(record, Statistics):
            summary.statistics = record
        elif isinstance(record, Schema):
            summary.schemas[record.id] = record
        elif isinstance(record, Channel):
            summary.channels[record.id] = record
        elif isinstance(record, AttachmentIndex):
            summary.attachment_indexes.append(record)
        elif isinstance(record, ChunkIndex):
            summary.chunk_indexes.append(record)
        elif isinstance(record, MetadataIndex):
            summary.metadata_indexes.append(record)
    return summary


def _is_whole(summary: Summary) -> bool:
    """Whether everything that the statistics count is indexed; writers may leave indexes out."""
    counts = summary.statistics
    if counts is None:
        return bool(summary.channels)
    return (
        counts.channel_count == len(summary.channels)
        and counts.chunk_count == len(summary.chunk_indexes)
        and counts.metadata_count == len(summary.metadata_indexes)
        and counts.attachment_count == len(summary.attachment_indexes)
    )


def checksum(stream: IO[bytes], end: int) -> int:
    """The CRC-32 of a file up to an offset."""
    crc, left = 0, end
    stream.seek(0)
    while left > 0:
        data = stream.read(min(left, 2**20))
        if not data:
            raise EOFError("cut off")
        crc, left = zlib.crc32(data, crc), left - len(data)
    return crc


def scan(stream: IO[bytes], end: int) -> Summary:
    """The index of a file that was written without one, by reading its data up to ``end``."""
    summary = Summary()
    for offset, opcode in walk(stream, end):
        stream.seek(offset)
        size = RECORD.size + RECORD.unpack(stream.read(RECORD.size))[1]
        if opcode == Opcode.CHUNK:
            chunk, data = read_chunk(stream, offset)
            summary.chunk_indexes.append(
                ChunkIndex(
                    chunk_start_offset=offset,
                    chunk_length=size,
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
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            _note(summary, opcode, read_record(stream, offset, opcode))
        elif opcode == Opcode.METADATA:
            name = read_metadata(stream, offset).name
            summary.metadata_indexes.append(MetadataIndex(offset, size, name))
        elif opcode == Opcode.ATTACHMENT:
            found = read_attachment(stream, offset)
            summary.attachment_indexes.append(
                AttachmentIndex(
                    offset=offset,
                    length=size,
                    log_time=found.log_time,
                    create_time=found.create_time,
                    data_size=len(found.data),
                    name=found.name,
                    media_type=found.media_type,
                )
            )
    return summary


def _note(summary: Summary, opcode: int, content: bytes) -> None:
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(ReadDataStream(BytesIO(content)))
        summary.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(ReadDataStream(BytesIO(content)))
        summary.channels[channel.id] = channel
