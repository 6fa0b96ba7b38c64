"""Messages of a log by the definitions that the log itself carries, without ROS."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Protocol

from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.layout import TYPE_HASHES


class Definitions(Protocol):
    """The channels and schemas of a file, by id."""

    path: Path
    channels: dict[int, Channel]
    schemas: dict[int, Schema]


class Decoder:
    """Decodes the messages of a file."""

    def __init__(self, source: Definitions) -> None:
        self._source = source
        self._stores: dict[int, tuple[Any, str]] = {}

    def channels(self, topic: str, type_name: str) -> list[int]:
        """Ids of the channels of a topic, in any namespace.

        Raises:
            LogError: such a channel has another type, encoding or no schema.
        """
        found = []
        for number, channel in self._source.channels.items():
            if f"/{channel.topic}".endswith(topic):
                self._check(channel, type_name)
                found.append(number)
        return found

    def decode(self, channel: int, data: bytes) -> Any:
        """One message.

        Raises:
            LogError: it does not agree with its schema.
        """
        if channel not in self._stores:
            schema = self._source.schemas[self._source.channels[channel].schema_id]
            self._stores[channel] = _store(schema.data, schema.name), schema.name
        store, name = self._stores[channel]
        try:
            return store.deserialize_cdr(data, name)
        except Exception as error:  # whatever a generated parser stumbles over in foreign bytes
            topic = self._source.channels[channel].topic
            raise LogError(
                f"{self._source.path}: {topic}: a message does not agree with its schema {name}"
            ) from error

    def _check(self, channel: Channel, type_name: str) -> None:
        where = f"{self._source.path}: {channel.topic}"
        schema = self._source.schemas.get(channel.schema_id)
        if schema is None:
            raise LogError(f"{where}: the message definition (schema) is missing")
        if schema.name != type_name:
            raise LogError(f"{where}: is of type {schema.name}, expected {type_name}")
        encodings = schema.encoding, channel.message_encoding
        if encodings != (SchemaEncoding.ROS2, MessageEncoding.CDR):
            raise LogError(
                f"{where}: encoded as {' and '.join(encodings)}, expected ros2msg and cdr"
            )
        try:
            _store(schema.data, schema.name)
        except LogError as error:
            raise LogError(f"{where}: {error}") from error


@cache
def _store(definition: bytes, name: str) -> Any:
    """A type store with a message type and all that it uses."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(definition.decode(), name))
        store.get_msgdef(name)
        found = store.hash_rihs01(name)
    except Exception as error:  # a text that is no message definition can fail in many ways
        raise LogError(f"the message definition of {name} cannot be understood") from error
    if found != TYPE_HASHES.get(name, found):
        raise LogError(f"the message definition of {name} has other fields than that of ROS 2")
    return store
