"""The terminal as a place where text of others is shown: nothing in it is a command."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from helmet_sim_ros.errors import printable


class PlainConsole(Console):
    """Shows every text as it stands: no markup, no emoji names, no control characters."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """A text to be shown, also that of a cell of a table."""
        return super().render_str(printable(text), **options)
