"""Standards as data: each YAML file in ``config/standards`` is one set of limits."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from pydantic import Field, model_validator

from helmet_sim_ros.biomech.catalogue import entry
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.resources import find_config, share_directory
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.yaml_file import read_yaml

#: The limits that the coupling paper quotes, used when no standard is asked for.
DEFAULT_STANDARD = "ece_r22_05"


class Limit(Config):
    """The largest allowed value of one criterion."""

    max: float = quantity("largest allowed value, in the criterion's unit", "", ge=0.0)
    source: str = Field(description="where the limit stands: document and clause, or what cites it")
    verified: bool = Field(description="whether the limit was checked against the primary text")


class Standard(Config):
    """One test of a standard, or one set of limits of a user."""

    title: str = Field(description="full title of the document and of the test in it")
    notes: str = Field("", description="impact conditions and what is left out")
    normal_velocity: float | None = quantity(
        "prescribed speed of the test along its drop direction", "m/s", None, gt=0.0, le=30.0
    )
    limits: dict[str, Limit] = Field(description="limits by name of the criterion")

    @model_validator(mode="after")
    def _has_limits(self) -> Standard:
        if not self.limits:
            raise SetupError.of("limits", self.limits, "must hold at least one limit")
        for name in self.limits:
            try:
                entry(name)
            except PulseError as error:
                raise SetupError.of(f"limits.{name}", self.limits[name].max, str(error)) from None
        return self


def load_standard(name_or_path: str) -> Standard:
    """The standard of ``config/standards/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    try:
        path = _path(name_or_path)
        return _load(path, os.stat(path).st_mtime_ns)
    except FileNotFoundError:  # gone since it was found: say so as if it had never been there
        _path.cache_clear()
        return load_standard(name_or_path)


def standard_names() -> list[str]:
    """The names of the shipped standards."""
    return sorted(p.stem for p in (share_directory() / "config" / "standards").glob("*.yaml"))


@lru_cache(maxsize=64)
def _path(name_or_path: str) -> Path:
    return find_config("standards", name_or_path, "standard")


@lru_cache(maxsize=64)
def _load(path: Path, _mtime_ns: int) -> Standard:
    return Standard.from_mapping(read_yaml(path, "standard"), str(path))  # type: ignore[no-any-return]
