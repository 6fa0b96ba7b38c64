"""A setup as text to take away: scenario file, Python, command line."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

import yaml

from helmet_sim_ros.explore.controls import HELMET
from helmet_sim_ros.model.setup import ImpactSetup

#: The shipped scenario of one impact with every value at its default.
SINGLE = "single"


def as_yaml(changes: Mapping[str, Any], name: str = "mine") -> str:
    """A scenario file with this one impact, for ``helmet-sim run FILE.yaml``."""
    values = {key: _plain(value) for key, value in changes.items()}
    file = {"description": "from the explorer", "cases": [{"name": name, **values}]}
    return yaml.safe_dump(file, sort_keys=False, allow_unicode=True, default_flow_style=None)


def as_python(changes: Mapping[str, Any]) -> str:
    """A program that simulates and evaluates this impact."""
    fields: dict[str, Any] = {}
    overrides: dict[str, Any] = {}
    for name, value in changes.items():
        group, _, rest = name.partition(".")
        if name == HELMET:
            fields["helmet"] = value
        elif group in ("impact", "sim") and rest in ImpactSetup.model_fields:
            fields[rest] = value
        else:
            overrides[name] = value
    if overrides:
        fields["overrides"] = overrides
    arguments = "".join(f"    {name}={value!r},\n" for name, value in fields.items())
    return (
        "from helmet_sim_ros import ImpactSetup, evaluate, simulate\n\n"
        f"setup = ImpactSetup(\n{arguments})\n"
        "result = evaluate(simulate(setup))\n"
        "print(result.peak_g)\n"
    )


def as_command(changes: Mapping[str, Any]) -> str:
    """The ``helmet-sim run`` line of this impact."""
    words = ["helmet-sim", "run", SINGLE]
    for name, value in changes.items():
        words += ["-o", f"{name}={_flow(value)}"]
    return shlex.join(words)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _flow(value: Any) -> str:
    """A value as YAML on one line."""
    text = yaml.safe_dump(_plain(value), default_flow_style=True, width=10_000)
    return text.removesuffix("\n").removesuffix("\n...")
