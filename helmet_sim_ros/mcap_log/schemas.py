"""Message definitions for a log, read from the installed ``.msg`` files."""

from __future__ import annotations

import json
import os
import re
import sys
from functools import cache
from pathlib import Path

from helmet_sim_ros.errors import LogError

_SEPARATOR = "=" * 80
_BUILTIN = {
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16",
    "int32", "uint32", "int64", "uint64", "string", "wstring",
}  # fmt: skip
#: The type of a field: ``geometry_msgs/Point[]``, ``string<=8``, ``float64[36]``.
_FIELD_TYPE = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*")


@cache
def message_definition(name: str) -> str:
    """The text of a message type and of every type it uses, as the ``ros2msg`` encoding wants it.

    Args:
        name: full type name, ``geometry_msgs/msg/AccelStamped``.

    Raises:
        LogError: no such ``.msg`` file is installed.
    """
    texts: dict[str, str] = {}
    waiting = [name]
    while waiting:
        current = waiting.pop(0)
        if current not in texts:
            texts[current] = _file(current, ".msg").read_text(encoding="utf-8")
            waiting += _used_types(current, texts[current])
    parts = [texts.pop(name)]
    parts += [f"MSG: {key.replace('/msg/', '/')}\n{text}" for key, text in texts.items()]
    return f"\n{_SEPARATOR}\n".join(part.rstrip("\n") for part in parts) + "\n"


@cache
def type_hash(name: str) -> str:
    """The hash of a message type (REP-2016), ``""`` where its description is not installed."""
    try:
        description = json.loads(_file(name, ".json").read_text(encoding="utf-8"))
        hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    except (LogError, ValueError, KeyError):
        return ""
    return str(hashes.get(name, ""))


def _file(name: str, suffix: str) -> Path:
    package, _, short = name.partition("/msg/")
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        path = Path(prefix, "share", package, "msg", short + suffix)
        if path.is_file():
            return path
    raise LogError(f"no definition of message type {name} is installed ({package}/msg/{short}.msg)")


def _used_types(name: str, text: str) -> list[str]:
    package = name.split("/", 1)[0]
    found = []
    for line in text.splitlines():
        match = _FIELD_TYPE.match(line.split("#", 1)[0])
        if match and match[1] not in _BUILTIN:
            owner, _, short = match[1].rpartition("/")
            found.append(f"{owner.removesuffix('/msg') or package}/msg/{short}")
    return found
