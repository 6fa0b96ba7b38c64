"""The terminal as a place where text of others is shown: nothing in it is a command."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.errors import printable

#: Columns between the cells of a table, at most.
_GAP = 3


def print_table(console: Console, table: Table) -> None:
    """Print a table as wide as its numbers need: in a narrow terminal lines go on in the next one,
    and no digit is left out."""
    wide = console.options.update(max_width=10_000)
    cells = [[console.measure(cell, options=wide) for cell in (column.header, *column.cells)]
             for column in table.columns]  # fmt: skip
    longest = [max(cell.maximum for cell in column) for column in cells]
    wraps = [not column.no_wrap for column in table.columns]
    # What wraps is made narrower from the widest on, so none may get narrower than any word.
    word = max((cell.minimum for column, wrap in zip(cells, wraps, strict=True) if wrap
                for cell in column), default=0)  # fmt: skip
    needed = [min(w, word) if wrap else w for w, wrap in zip(longest, wraps, strict=True)]
    least, terminal = sum(needed) + _GAP * (len(needed) + 1), console.width
    console.width = max(terminal, least)
    console.print(table)
    console.width = terminal


class PlainConsole(Console):
    """Shows every text as it stands: no markup, no emoji names, no control characters."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """A text to be shown, also that of a cell of a table."""
        return super().render_str(printable(text), **options)
