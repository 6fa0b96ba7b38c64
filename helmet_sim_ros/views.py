"""How records, evaluations and setups show themselves: by functions of outer rooms.

An inner room names what it wants shown; the package's facade, which may know every room, says
where that is done. Nothing is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

_homes: dict[str, str] = {}


def register_views(package: str, views: Mapping[str, Sequence[str]]) -> None:
    """Say where views are made.

    Args:
        package: ``__name__`` of the package.
        views: module below the package -> functions in it; each takes what it shows.
    """
    _homes.update({name: f"{package}.{home}" for home, names in views.items() for name in names})


def show(view: str, *what: Any) -> Any:
    """What the registered function gives.

    Raises:
        LookupError: there is no view of that name.
        MissingExtraError: it needs a library that is not installed.
    """
    return getattr(import_module(_homes[view]), view)(*what)
