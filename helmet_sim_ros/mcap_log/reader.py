"""Read the impacts of a log back, exactly and without ROS."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import IncompleteError, LogError
from helmet_sim_ros.mcap_log.blocks import Assembled, Assembler, Block, parse_block

SAMPLES_TOPIC = "/impact/samples"
SAMPLES_TYPE = "std_msgs/msg/Float64MultiArray"

#: What a broken or foreign file makes the MCAP library raise.
BROKEN = (McapError, OSError, ValueError, KeyError, IndexError, EOFError)


@dataclass(frozen=True)
class LoggedImpact:
    """One complete impact of a log: its id, the simulation time of its start [s], its samples."""

    impact_id: str
    start_time: float
    record: ImpactRecord


@dataclass(frozen=True)
class ImpactLog:
    """A finished impact log.

    Attributes:
        path: the file.
        impacts: every complete impact, in order.
        problems: for every impact that is not complete, why.
        metadata: name -> values of each metadata record (``run``, ``impact/ID``).
        attachments: name -> text (``scenario.yaml``, models).
    """

    path: Path
    impacts: tuple[LoggedImpact, ...]
    problems: tuple[str, ...]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, str]

    def setup(self, impact_id: str) -> dict[str, Any]:
        """The setup of an impact, as recorded in the metadata.

        Raises:
            LogError: the log has no such impact.
        """
        try:
            values = json.loads(self.metadata[f"impact/{impact_id}"]["setup"])
        except (KeyError, ValueError):
            raise LogError(f"{self.path}: no setup of an impact {impact_id!r}") from None
        return dict(values)


def open_log(path: str | Path) -> ImpactLog:
    """Read a log with everything in it.

    Raises:
        LogError: no such file, not an MCAP file, unfinished, or without samples of impacts.
    """
    path = Path(path)
    ended = list(_assembled(path))
    try:
        with open(path, "rb") as stream:
            reader = make_reader(stream)
            metadata = {m.name: dict(m.metadata) for m in reader.iter_metadata()}
            attachments = {
                a.name: a.data.decode("utf-8", "replace") for a in reader.iter_attachments()
            }
    except BROKEN as error:
        raise _unreadable(path, error) from error
    impacts = tuple(
        LoggedImpact(e.impact_id, e.start_time, e.record) for e in ended if e.record is not None
    )
    problems = tuple(e.problem for e in ended if e.record is None)
    return ImpactLog(path, impacts, problems, metadata, attachments)


def read_impacts(path: str | Path) -> Iterator[LoggedImpact]:
    """Every complete impact of a log, one at a time, in order.

    Raises:
        LogError: as :func:`open_log`.
    """
    for ended in _assembled(Path(path)):
        if ended.record is not None:
            yield LoggedImpact(ended.impact_id, ended.start_time, ended.record)


def _assembled(path: Path) -> Iterator[Assembled]:
    assembler = Assembler()
    for block in _blocks(path):
        yield from assembler.feed(block)
    yield from assembler.abandon("the log ends")


def _blocks(path: Path) -> Iterator[Block]:
    store = get_typestore(Stores.EMPTY)
    known = False
    try:
        with open(path, "rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None:
                raise LogError(f"{path}: the log was never finished")
            topics = [c.topic for c in summary.channels.values() if _holds_samples(c, summary)]
            if not topics:
                raise LogError(f"{path}: no samples of impacts in this file")
            for schema, _, message in reader.iter_messages(topics, log_time_order=False):
                if not known and schema is not None:
                    store.register(get_types_from_msg(schema.data.decode(), schema.name))
                    known = True
                decoded: Any = store.deserialize_cdr(message.data, SAMPLES_TYPE)
                header, labels = (dimension.label for dimension in decoded.layout.dim)
                yield parse_block(header, labels, decoded.data)
    except IncompleteError as error:
        raise LogError(f"{path}: {SAMPLES_TOPIC}: {error}") from error
    except BROKEN as error:
        raise _unreadable(path, error) from error


def _holds_samples(channel: Channel, summary: Any) -> bool:
    schema: Schema | None = summary.schemas.get(channel.schema_id)
    return (
        channel.topic.endswith(SAMPLES_TOPIC) and schema is not None and schema.name == SAMPLES_TYPE
    )


def _unreadable(path: Path, error: Exception) -> LogError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else repr(error)
    return LogError(f"{path}: cannot be read: {reason}")
