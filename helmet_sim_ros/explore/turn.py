"""The controls of a setup on the page, made from the schema."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import viser

from helmet_sim_ros.explore.controls import Control, control, controls

#: Groups that are open from the start.
_OPEN = ("impact",)

Changed = Callable[[str], None]


class TurnPanel:
    """A widget for every control, in folders like the names.

    Args:
        server: where the widgets go, inside the present container.
        changed: called with the dotted name when the user turns one; :meth:`content` tells more.
    """

    def __init__(self, server: viser.ViserServer, changed: Changed) -> None:
        self._gui, self._changed = server.gui, changed
        self._widgets: dict[str, Any] = {}
        self._told: dict[str, Any] = {}
        self._setting = False
        self._folders: dict[tuple[str, ...], viser.GuiFolderHandle] = {}
        for each in controls():
            with ExitStack() as stack:
                stack.enter_context(self._folder(each.group))
                self._widgets[each.name] = self._added(each)

    def content(self, name: str) -> Any:
        """What a widget holds now; events of a fast hand may overtake one another."""
        return self._widgets[name].value

    def set(self, values: dict[str, Any], but: str = "", whole: bool = False) -> None:
        """Show values without reporting them back.

        A widget is left alone while its value stays what it was told last: the user may be at it,
        and what he has just done may still wait to be heard.

        Args:
            values: of every control.
            but: what the user has turned.
            whole: write every widget, also over a text that was refused.
        """
        self._setting = True
        try:
            for name, value in values.items():
                content = control(name).shown(value)
                if name != but and (whole or self._told.get(name) != content):
                    self._put(name, content)
                self._told[name] = content
        finally:
            self._setting = False

    def _put(self, name: str, content: Any) -> None:
        widget, known = self._widgets[name], control(name)
        if known.kind == "menu" and content not in widget.options:
            widget.options = (*widget.options, content)
        if known.kind == "slider":
            widget.precision = max(_digits(known.step), _digits(content))
        if widget.value != content:
            widget.value = content

    def _folder(self, group: tuple[str, ...]) -> viser.GuiFolderHandle:
        if group not in self._folders:
            with ExitStack() as stack:
                if len(group) > 1:
                    stack.enter_context(self._folder(group[:-1]))
                title = group[-1].replace("_", " ").capitalize()
                self._folders[group] = self._gui.add_folder(
                    title, expand_by_default=group[0] in _OPEN
                )
        return self._folders[group]

    def _added(self, each: Control) -> Any:
        value = each.shown(each.initial)
        widget: Any
        if each.kind == "slider":
            whole = each.leaf.type is int
            low, high, step = (
                round(v) if whole else float(v) for v in (each.minimum, each.maximum, each.step)
            )
            widget = self._gui.add_slider(
                each.label, low, high, step, value, hint=each.hint
            )  # fmt: skip
        elif each.kind == "menu":
            choices = each.choices if value in each.choices else (*each.choices, value)
            widget = self._gui.add_dropdown(
                each.label, choices, initial_value=value, hint=each.hint
            )
        elif each.kind == "switch":
            widget = self._gui.add_checkbox(each.label, value, hint=each.hint)
        else:
            widget = self._gui.add_text(each.label, value, hint=each.hint)

        def turned(event: viser.GuiEvent[Any]) -> None:
            if not self._setting and event.client_id is not None:
                self._changed(each.name)

        widget.on_update(turned)
        return widget


def _digits(number: float) -> int:
    """Decimals that show a number exactly, up to 8."""
    text = f"{number:.8f}".rstrip("0")
    return len(text.partition(".")[2])
