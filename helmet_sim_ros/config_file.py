"""Configuration records from their files; each file is read once, as long as it stays as it is."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config
from helmet_sim_ros.yaml_file import read_yaml

Record = TypeVar("Record", bound=Config)


def load_config(kind: type[Record], folder: str, name_or_path: str, key: str) -> Record:
    """The record of ``config/FOLDER/NAME.yaml``, or of any YAML file by path.

    Args:
        kind: of the record.
        folder: below ``config/``.
        name_or_path: see :func:`.resources.find_config`.
        key: the configuration key to name in an error.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    path = find_config(folder, name_or_path, key)
    record: Record = _read(kind, path, path.stat().st_mtime_ns, key)
    return record


@lru_cache(maxsize=256)
def _read(kind: type[Config], path: Path, _mtime_ns: int, key: str) -> Any:
    return kind.from_mapping(read_yaml(path, key), str(path))
