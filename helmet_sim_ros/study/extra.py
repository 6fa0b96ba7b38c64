"""What the extra ``study`` installs, imported when it is needed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from helmet_sim_ros.errors import StudyError


def need(module: str) -> ModuleType:
    """A module of the extra ``study``.

    Raises:
        StudyError: it is not installed; says how to install it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise StudyError(
            f"{module.partition('.')[0]} is not installed ({error}); "
            "install what studies need with: pip install helmet_sim_ros[study]"
        ) from None
