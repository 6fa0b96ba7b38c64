"""What the optional extras install, imported when it is needed; rooms of every ring ask here."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from helmet_sim_ros.errors import HelmetSimError


class MissingExtraError(HelmetSimError, ImportError):
    """A library of an optional extra is not installed; the text says how to install it."""


def need(module: str, extra: str) -> Any:
    """A module that an extra brings.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{module.partition('.')[0]} is not installed; the extra {extra!r} brings it: "
            f"pip install 'helmet_sim_ros[{extra}]', or in the source tree '.[{extra}]'"
        ) from error
