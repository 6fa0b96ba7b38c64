"""The scene behind a logged record, rebuilt from the record's setup alone."""

from __future__ import annotations

import logging

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import LogError, SetupError
from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.model.geometry import NAME, admit
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_log

#: What of a setup names a file, or belongs to its content.
FILES = ("helmet.name", "helmet.liner.foam", "helmet.liner.foam_digest")
GEOMETRY = ("helmet.geometry", "helmet.liner.columns")


def admit_helmets(log: ImpactLog) -> None:
    """Let :func:`scene_of` know the helmets that a log carries, on a machine without their files.

    What of them is damaged is told; the shell's ellipsoid is shown then.
    """
    for name in log.files:
        if not NAME.search(name):
            continue
        try:
            admit(name, log.file(name))
        except (LogError, SetupError) as error:
            logging.getLogger(__name__).warning(error)


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
            # A log carries every value of its helmet, so any helmet can stand in for the file. Its
            # foam is not seen; without its geometry the shell's ellipsoid is shown.
            setup, notes = _without_files(values)
        scene = Scene(setup)
        scene.pose(record, 0)
    except (SetupError, KeyError, ValueError, IndexError) as error:
        raise LogError(f"this version cannot show the impact: {error}") from error
    for note in notes:
        logging.getLogger(__name__).warning(note)
    return scene


def _without_files(values: dict[str, object]) -> tuple[ImpactSetup, tuple[str, ...]]:
    """The setup with the shipped default in place of the helmet's file."""
    left = {name: value for name, value in values.items() if name not in FILES}
    try:
        return _effective(left)
    except SetupError:
        return _effective({k: v for k, v in left.items() if k not in GEOMETRY})


def _effective(values: dict[str, object]) -> tuple[ImpactSetup, tuple[str, ...]]:
    """The setup without the values that another helmet's form ignores."""
    try:
        return setup_from_log(values)
    except SetupError as error:
        idle = {problem.key for problem in error.problems if "no effect" in problem.allowed}
        if not idle:
            raise
        return setup_from_log({k: v for k, v in values.items() if k not in idle})
