"""The scene behind a logged record, rebuilt from the record's setup alone."""

from __future__ import annotations

import logging

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import LogError, SetupError
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.setup import setup_from_log

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
            setup, notes = setup_from_log(values)
        except SetupError:
            # A log carries every value of its helmet, so any helmet can stand in for the file.
            # Its files of geometry and foam may be gone too: the shell's ellipsoid is shown.
            for name in FILES:
                values.pop(name, None)
            setup, notes = setup_from_log(values)
        scene = Scene(setup)
        scene.pose(record, 0)
    except (SetupError, KeyError, ValueError, IndexError) as error:
        raise LogError(f"this version cannot show the impact: {error}") from error
    for note in notes:
        logging.getLogger(__name__).warning(note)
    return scene
