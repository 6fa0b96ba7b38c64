"""Setups to begin with: every case of the shipped scenarios, and of the user's own files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_scenario


@dataclass(frozen=True)
class Preset:
    """One case of a scenario; ``changes`` by dotted names."""

    name: str
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Collection:
    """The cases of one scenario."""

    name: str
    description: str
    presets: tuple[Preset, ...]

    def __getitem__(self, name: str) -> Preset:
        """The preset of this name."""
        return next(preset for preset in self.presets if preset.name == name)


def collections(files: Sequence[str] = ()) -> tuple[list[Collection], list[str]]:
    """The user's scenarios first, then the shipped ones; and what cannot be read, in words.

    Args:
        files: names in ``config/scenarios``, or paths to scenario files.
    """
    folder = share_directory() / "config" / "scenarios"
    names = [*files, *(path.stem for path in sorted(folder.glob("*.yaml")))]
    found: list[Collection] = []
    problems: list[str] = []
    for name in dict.fromkeys(names):
        try:
            scenario = load_scenario(name)
        except HelmetSimError as error:
            problems.append(str(error))
            continue
        presets = tuple(Preset(case.name, case.values) for case in scenario.cases)
        title = scenario.name
        while any(other.name == title for other in found):
            title += " (file)"
        found.append(Collection(title, scenario.description, presets))
    return found, problems
