"""``KEY=VALUE`` texts, as a command line or a ROS parameter gives them."""

from __future__ import annotations

from collections.abc import Iterable

import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.yaml_file import parse_yaml


def parse_overrides(texts: Iterable[str]) -> dict[str, object]:
    """Names and values of ``KEY=VALUE`` texts; a later one wins, empty ones are nothing.

    Raises:
        SetupError: a text of another form.
    """
    return dict(parse_override(text) for text in texts if text.strip())


def parse_override(text: str) -> tuple[str, object]:
    """Name and value of ``"impact.friction=0.3"``; the value is YAML, so ``2e-5`` is a number.

    Raises:
        SetupError: no ``=``, no name, or a value that is not YAML.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SetupError.of("override", text, "must be KEY=VALUE")
    try:
        return key.strip(), parse_yaml(value)
    except yaml.YAMLError:
        raise SetupError.of(key.strip(), value, "the value is not YAML") from None
