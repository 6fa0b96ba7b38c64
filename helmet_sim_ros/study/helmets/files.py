"""The files that a helmet's values name: copied beside a helmet file that is written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.resources import is_path


def values_beside(helmet: Helmet, folder: Path) -> dict[str, Any]:
    """The values of a helmet as plain data, for a file in a folder.

    Its array file and a foam file of the user's are copied into the folder and named relative to
    it, so that the folder can be moved.

    Raises:
        SetupError: a file cannot be copied.
    """
    values: dict[str, Any] = helmet.model_dump(mode="json")
    foam = helmet.liner.foam
    if helmet.geometry is not None:
        values["geometry"] = _copied(Path(helmet.geometry), folder, Path(helmet.geometry).name)
    if foam is not None and is_path(foam):
        name = f"foam_{helmet.liner.foam_digest}.yaml"
        values["liner"]["foam"] = _copied(Path(foam), folder, name)
    return values


def _copied(source: Path, folder: Path, name: str) -> str:
    target = folder / name
    try:
        if not target.exists():  # the name tells the content
            target.write_bytes(source.expanduser().read_bytes())
    except OSError as error:
        raise SetupError.of("helmet", str(source), f"cannot be copied: {error.strerror}") from error
    return name
