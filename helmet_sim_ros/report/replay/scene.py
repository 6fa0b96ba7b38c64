"""The scene behind a logged record, rebuilt from the record's setup alone."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from helmet_sim_ros.biomech.record import ImpactRecord, is_fall
from helmet_sim_ros.errors import LogError, SetupError
from helmet_sim_ros.model.fall.setup import Fall, fall_from_names
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_log
from helmet_sim_ros.model.state import read_state
from helmet_sim_ros.model.surface.drawing import Primitive, drawn

#: What of a setup names a file, or belongs to its content.
FILES = (
    "helmet.name", "helmet.geometry", "helmet.liner.columns", "helmet.liner.foam",
    "helmet.liner.foam_digest",
)  # fmt: skip


def scene_of(record: ImpactRecord) -> Scene:
    """The scene of a record, also where its helmet file is not on this machine.

    Raises:
        LogError: this version's model cannot show the record.
    """
    values = dict(record.setup)
    try:
        try:
            setup, notes = _setup_of(values)
        except SetupError:
            # A log carries every value of its helmet, so any helmet can stand in for the file.
            # Its files of geometry and foam may be gone too: the shell's ellipsoid is shown.
            for name in FILES:
                values.pop(name, None)
            setup, notes = _setup_of(values)
        scene = Scene(setup)
        scene.pose(record, 0)
    except (SetupError, KeyError, ValueError, IndexError) as error:
        raise LogError(f"this version cannot show the impact: {error}") from error
    for note in notes:
        logging.getLogger(__name__).warning(note)
    return scene


def surroundings(scene: Scene, time: float) -> list[Primitive]:
    """The solids around the rider at a time of the record [s]."""
    setup = scene.setup
    began = 0.0
    if isinstance(setup, ImpactSetup) and setup.state is not None:
        began = read_state(setup.state).time
    return drawn(setup.surface_config, began + time)


def _setup_of(values: Mapping[str, Any]) -> tuple[ImpactSetup | Fall, tuple[str, ...]]:
    return (fall_from_names(values), ()) if is_fall(values) else setup_from_log(values)
