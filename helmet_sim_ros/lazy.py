"""Package facades whose names load on first use (PEP 562).

Their types stand in a stub beside them, ``__init__.pyi``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module

#: ``__getattr__`` and ``__dir__`` of a package.
Facade = tuple[Callable[[str], object], Callable[[], list[str]]]


def lazy_names(package: str, homes: Mapping[str, Sequence[str]]) -> Facade:
    """``__getattr__`` and ``__dir__`` of a package that offers names of its modules.

    Nothing is imported before it is used. A module directly below the package must not have the
    name of something that the package offers: Python would give the module once it is loaded.

    Args:
        package: ``__name__`` of the package.
        homes: module below the package -> the names it is asked for.
    """
    home = {name: module for module, names in homes.items() for name in names}
    offered = vars(sys.modules[package])

    def __getattr__(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{home[name]}"), name)

    def __dir__() -> list[str]:
        """What the package offers, without what its own lines need."""
        inside = [name for name in offered if f"{package}.{name}" in sys.modules]
        special = [name for name in offered if name.startswith("__")]
        return sorted({*special, *offered["__all__"], *home, *inside})

    return __getattr__, __dir__
