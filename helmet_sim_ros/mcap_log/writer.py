"""Write an impact log: one MCAP file, under a temporary name until it is complete."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap._chunk_builder import ChunkBuilder
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.layout import FORMAT_KEY, FORMAT_VERSION, RUN
from helmet_sim_ros.mcap_log.schemas import message_definition, type_hash
from helmet_sim_ros.mcap_log.seal import sealed

#: Suffix of a log that is still being written, or that was never finished.
PART = ".part"

#: What stands before the data of a message in a chunk (MCAP specification, "Message").
_HEAD = np.dtype(
    [
        ("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
        ("log_time", "<u8"), ("publish_time", "<u8"),
    ]
)  # fmt: skip
#: Bytes of it that do not count into the length.
_UNCOUNTED = 9


class LogWriter:
    """An MCAP file of the ``ros2`` profile. Every method may raise :class:`LogError`.

    The file is ``path`` plus ``.part`` until :meth:`close`; it never replaces an existing file.

    Attributes:
        path: the final name.
    """

    def __init__(self, path: Path, library: str = "helmet_sim_ros") -> None:
        """Create the file.

        Raises:
            LogError: it exists, or cannot be written.
        """
        self.path = path
        self._library = library
        self._part = path.with_name(path.name + PART)
        if path.exists():
            raise LogError(f"{path}: exists already")
        try:
            self._stream = open(self._part, "xb")  # noqa: SIM115 - closed by close()
        except OSError as error:
            raise LogError(f"{self._part}: cannot be created: {error.strerror}") from error
        self._writer: Any = Writer(
            self._stream, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        self._chunk = _Chunk()
        indices = ("chunk_indices", "metadata_indexes", "attachment_indexes")
        parts = {"chunk_builder": self._chunk} | {name: _Packed() for name in indices}
        for name, part in parts.items():
            setattr(self._writer, f"_Writer__{name}", part)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._guarded(self._writer.start, Profile.ROS2, library)

    @property
    def size(self) -> int:
        """Bytes written so far, without what is still buffered for compression."""
        return self._stream.tell()

    def add_channel(self, topic: str, type_name: str, qos: str) -> None:
        """Declare a topic once; declaring it again changes nothing.

        Args:
            topic: absolute topic name.
            type_name: full message type, ``geometry_msgs/msg/AccelStamped``.
            qos: YAML list of the QoS profiles that its publisher offers.
        """
        if topic in self._channels:
            return
        if type_name not in self._schemas:
            definition = message_definition(type_name).encode()
            self._schemas[type_name] = self._guarded(
                self._writer.register_schema, type_name, SchemaEncoding.ROS2, definition
            )
        metadata = {
            "offered_qos_profiles": qos,
            "topic_type_hash": type_hash(type_name),
            FORMAT_KEY: str(FORMAT_VERSION),
        }
        self._channels[topic] = self._guarded(
            self._writer.register_channel,
            topic, MessageEncoding.CDR, self._schemas[type_name], metadata,
        )  # fmt: skip

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        """Append one serialised message of a declared topic, at a simulation time [ns]."""
        try:
            self._writer.add_message(self._channels[topic], time_ns, data, time_ns)
        except OSError as error:
            raise self._failed(error) from error

    def write_rows(
        self, times: NDArray[np.int64], messages: Mapping[str, NDArray[np.uint8]]
    ) -> None:
        """Append a message of each of several topics at every one of some simulation times.

        Args:
            times: ascending, (n,) [ns].
            messages: topic -> its serialised messages, all of one length: (n, length) bytes.
        """
        by_channel = {self._channels[topic]: table for topic, table in messages.items()}
        self._chunk.add_rows(times, by_channel)
        counts = self._writer._Writer__statistics
        first, last = int(times[0]), int(times[-1])
        if counts.message_count:
            first = min(first, counts.message_start_time)
        counts.message_start_time = first
        counts.message_end_time = max(last, counts.message_end_time)
        counts.message_count += len(times) * len(messages)
        for channel in by_channel:
            counts.channel_message_counts[channel] += len(times)
        self._guarded(self._writer._Writer__maybe_finalize_chunk)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a named metadata record, sealed; all messages so far stand before it in the file.

        The record of the run also gets what wrote the file: MCAP's own header has no checksum.
        """
        self.flush()
        values = {**values, "library": self._library} if name == RUN else values
        self._guarded(self._writer.add_metadata, name, sealed(name, values))

    def attach(self, name: str, media_type: str, content: str | bytes, time_ns: int) -> None:
        """Append a file, text as UTF-8, as attachment, at a simulation time [ns]."""
        data = content.encode() if isinstance(content, str) else content
        self._guarded(self._writer.add_attachment, time_ns, time_ns, name, media_type, data)

    def flush(self) -> None:
        """Hand everything so far to the operating system: it survives the end of this process.

        Raises:
            LogError: it cannot be written, or the file is no longer under its name.
        """
        self._guarded(self._writer.flush)
        self._check_present()

    def _check_present(self) -> None:
        """What is written to a file that was removed meanwhile is nowhere."""
        try:
            there = os.stat(self._part)
        except OSError:
            there = None
        mine = os.fstat(self._stream.fileno())
        if there is None or (there.st_dev, there.st_ino) != (mine.st_dev, mine.st_ino):
            raise LogError(f"{self._part}: was removed while it was being written")

    def close(self) -> Path:
        """Write the index, and give the file its final name.

        Returns:
            The final name.

        Raises:
            LogError: the disk is full or gone; what could be written stays under ``.part``.
        """
        try:
            self._writer.finish()
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._check_present()
            self._stream.close()
            os.replace(self._part, self.path)
        except OSError as error:
            raise self._failed(error) from error
        return self.path

    def abandon(self, keep: bool = True) -> None:
        """Close the file as it is, under its temporary name.

        Args:
            keep: false: remove it, there is nothing in it that anybody was promised.
        """
        try:
            self._check_present()
        except (LogError, OSError, ValueError):  # gone, or another's, or closed already
            keep = True
        try:
            self._stream.close()
        except OSError:
            self._stream.raw.close()  # what was buffered cannot be written
        if not keep:
            self._part.unlink(missing_ok=True)

    def _guarded(self, action: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return action(*arguments)
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> LogError:
        return LogError(f"{self._part}: cannot be written: {error.strerror or error}")


class _Chunk(ChunkBuilder):
    """A chunk that also takes many messages at once: one by one, each as an object, the library
    needs most of the time that recording takes."""

    message_indices: dict[int, Any]

    def add_message(self, message: Message) -> None:
        """Append one message."""
        self.message_indices.setdefault(message.channel_id, _Index(message.channel_id))
        super().add_message(message)

    def add_rows(self, times: NDArray[np.int64], messages: Mapping[int, NDArray[np.uint8]]) -> None:
        """Append messages by channel, see :meth:`LogWriter.write_rows`."""
        fields: list[Any] = []
        for channel, table in messages.items():
            fields += [(f"head{channel}", _HEAD), (f"data{channel}", "u1", table.shape[1:])]
        rows = np.zeros(len(times), dtype=fields)
        places = self.count + np.arange(len(times)) * rows.itemsize
        for channel, table in messages.items():
            head = rows[f"head{channel}"]
            head["opcode"], head["channel"] = Opcode.MESSAGE, channel
            head["length"] = _HEAD.itemsize - _UNCOUNTED + table.shape[1]
            head["log_time"] = head["publish_time"] = times
            rows[f"data{channel}"] = table
            index = self.message_indices.setdefault(channel, _Index(channel))
            index.records.add(times, places)
            places = places + _HEAD.itemsize + table.shape[1]
        first, last = int(times[0]), int(times[-1])
        if self.num_messages:
            first = min(first, self.message_start_time)
        self.message_start_time = first
        self.message_end_time = max(last, self.message_end_time)
        self.num_messages += rows.size * len(messages)
        self.record_writer.write(rows.tobytes())


class _Index:
    """Where the messages of a channel are in a chunk; to the library its own ``MessageIndex``."""

    def __init__(self, channel: int) -> None:
        self._channel, self.records = channel, _Entries()

    def write(self, builder: Any) -> None:
        """Write the record."""
        builder.start_record(Opcode.MESSAGE_INDEX)
        builder.write2(self._channel)
        builder.write4(len(self.records))
        builder.write(self.records)
        builder.finish_record()


class _Entries(bytearray):
    """Times and places as the bytes that they become, not as objects."""

    def append(self, entry: tuple[int, int]) -> None:  # type: ignore[override]
        """Take the time and offset of a message."""
        self += struct.pack("<QQ", *entry)

    def add(self, times: NDArray[np.int64], places: NDArray[np.int64]) -> None:
        """Take those of several."""
        self += np.stack((times, places), axis=1).astype("<u8").tobytes()


class _Packed:
    """Index records as the bytes that they become in the end.

    The library keeps them as objects until the file is finished: 1.6 kB for each chunk, three
    chunks for each impact, for as long as a log goes on. Here it is a tenth of that.
    """

    def __init__(self) -> None:
        self._bytes = bytearray()

    def append(self, record: Any) -> None:
        """Take a record of the index."""
        builder = RecordBuilder()
        record.write(builder)
        self._bytes += builder.end()  # type: ignore[no-untyped-call]

    def __iter__(self) -> Iterator[_Packed]:
        yield self

    def write(self, builder: RecordBuilder) -> None:
        """Write all records, as a single one would write itself."""
        builder.write(self._bytes)
