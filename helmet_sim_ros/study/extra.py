"""What the extras ``study`` and ``cad`` install, imported when it is needed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from helmet_sim_ros.errors import StudyError


def need(module: str, extra: str = "study") -> ModuleType:
    """A module of an extra.

    Raises:
        StudyError: it is not installed; says how to install it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise StudyError(
            f"{module.partition('.')[0]} is not installed ({error}); "
            f"install what this needs with: pip install helmet_sim_ros[{extra}]"
        ) from None
