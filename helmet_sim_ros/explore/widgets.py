"""What viser's widgets lack."""

from __future__ import annotations

from typing import TypeVar

import viser

T = TypeVar("T")


def put(widget: viser.GuiInputHandle[T], value: T) -> None:
    """Let a widget hold a value; its callbacks hear of it with ``client_id`` None."""
    widget.value = value  # type: ignore[misc]  # a property whose setter mypy does not see
