"""The records of an MCAP file one by one, each with its checksum."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Metadata

from helmet_sim_ros.errors import LogError

_Record = TypeVar("_Record")

MAGIC = b"\x89MCAP0\r\n"
#: No record of a sound log is larger, packed or unpacked [byte]: chunks have about 1 MB.
RECORD_LIMIT = 2**26
#: Opcode and length before each record.
RECORD = struct.Struct("<BQ")
#: Channel, sequence, log time and publish time before the data of a message.
MESSAGE = struct.Struct("<HIQQ")

#: What a damaged file makes the MCAP library raise.
BROKEN = (
    McapError, OSError, ValueError, KeyError, IndexError, EOFError, OverflowError, struct.error,
    MemoryError,
)  # fmt: skip


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


def walk(stream: IO[bytes], end: int) -> Iterator[tuple[int, int]]:
    """Offset and opcode of each record of the data, which ends at ``end``.

    Raises:
        EOFError: a record reaches beyond the end, or an end mark stands before it.
    """
    offset = len(MAGIC)
    while offset < end:
        stream.seek(offset)
        opcode, length = RECORD.unpack(stream.read(RECORD.size))
        if opcode in (Opcode.DATA_END, Opcode.FOOTER) or offset + RECORD.size + length > end:
            raise EOFError(f"the record at offset {offset} does not end where the data does")
        yield offset, opcode
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


def read_record(stream: IO[bytes], offset: int, opcode: int, length: int | None = None) -> bytes:
    """The content of the record at an offset of the file.

    Args:
        stream: the file.
        offset: where the record begins.
        opcode: what it must be.
        length: what the index says of its length, prefix included; None: not known.

    Raises:
        McapError: another record, or cut off.
    """
    stream.seek(offset)
    found, size = RECORD.unpack(stream.read(RECORD.size))
    if found != opcode or (length is not None and size + RECORD.size != length):
        name = Opcode(opcode).name.lower()
        raise McapError(f"no {name} at offset {offset}, where the index has one")
    if size > RECORD_LIMIT:
        raise McapError(f"a record of {size} bytes at offset {offset}")
    content = stream.read(size)
    if len(content) < size:
        raise McapError(f"the record at offset {offset} is cut off")
    return content


def read_chunk(
    stream: IO[bytes], offset: int, length: int | None = None, bare: bool = True
) -> tuple[Chunk, bytes]:
    """The chunk at an offset of the file, and its content; its checksum is verified.

    Args: as for :func:`read_attachment`.
    """
    content = read_record(stream, offset, Opcode.CHUNK, length)
    try:
        chunk, read = _parsed(Chunk, content)
        data = _unpacked(chunk)
        crc = zlib.crc32(data)
        if read != len(content) or len(data) != chunk.uncompressed_size:
            raise ValueError("it contradicts itself")
        if chunk.uncompressed_crc != crc and not (bare and chunk.uncompressed_crc == 0):
            raise ValueError("its checksum is wrong")
    except Exception as error:  # each compression library has errors of its own
        raise McapError(f"the chunk at offset {offset} cannot be unpacked ({error})") from error
    return chunk, data


def read_metadata(stream: IO[bytes], offset: int, length: int | None = None) -> Metadata:
    """The metadata record at an offset of the file; it has no checksum."""
    content = read_record(stream, offset, Opcode.METADATA, length)
    record, read = _parsed(Metadata, content)
    if read != len(content):
        raise McapError(f"the metadata at offset {offset} contradicts itself")
    return record


def read_attachment(
    stream: IO[bytes], offset: int, length: int | None = None, bare: bool = True
) -> Attachment:
    """The attachment at an offset of the file; its checksum is verified.

    Args:
        stream: the file.
        offset: where it begins.
        length: what the index says of its length, prefix included; None: not known.
        bare: whether it may be without a checksum, as other writers leave it.
    """
    content = read_record(stream, offset, Opcode.ATTACHMENT, length)
    record, read = _parsed(Attachment, content)
    (crc,) = struct.unpack("<I", content[-4:])
    right = crc == zlib.crc32(content[:-4]) or (bare and crc == 0)
    if read != len(content) or not right:
        raise McapError(f"the checksum of the attachment at offset {offset} is wrong")
    return record


def _parsed(kind: type[_Record], content: bytes) -> tuple[_Record, int]:
    """A record and how many bytes it has taken."""
    stream = ReadDataStream(BytesIO(content))
    record: _Record = kind.read(stream)  # type: ignore[attr-defined]
    return record, stream.count


def _unpacked(chunk: Chunk) -> bytes:
    """The content of a chunk, never more than it says and than is allowed."""
    size = chunk.uncompressed_size
    if size > RECORD_LIMIT:
        raise ValueError(f"{size} bytes")
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) not in (-1, size):
            raise ValueError("it contradicts itself")
        return zstandard.decompress(chunk.data, size)
    if chunk.compression == "lz4":
        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size + 1)
        return unpacked
    if chunk.compression:
        raise ValueError(f"unknown compression {chunk.compression!r}")
    return chunk.data
