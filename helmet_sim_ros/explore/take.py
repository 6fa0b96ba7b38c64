"""Where setups come from and go to: presets, logs, texts to copy, running nodes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

import viser

from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.explore import export, markup
from helmet_sim_ros.explore.presets import Collection
from helmet_sim_ros.explore.session import Session, Side
from helmet_sim_ros.explore.widgets import put
from helmet_sim_ros.mcap_log import ImpactLog, open_log
from helmet_sim_ros.report.replay.scene import admit_helmets
from helmet_sim_ros.report.review.summary import labels

#: How long the nodes may take for an impact [s].
_NODES_TIMEOUT = 60.0
_NONE = "(none)"


class PresetPanel:
    """Choose a scenario and a case of it."""

    def __init__(
        self,
        server: viser.ViserServer,
        found: Sequence[Collection],
        take: Callable[[dict[str, object]], None],
    ) -> None:
        self._found = {collection.name: collection for collection in found}
        self._take = take
        gui = server.gui
        first = found[0]
        self._scenario = gui.add_dropdown("scenario", tuple(self._found))
        self._case = gui.add_dropdown("case", tuple(p.name for p in first.presets))
        load = gui.add_button("Load", icon=viser.Icon.DOWNLOAD)
        self._about = gui.add_markdown(_plain(first.description))

        @self._scenario.on_update
        def _(event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
            chosen = self._found[self._scenario.value]
            self._case.options = tuple(p.name for p in chosen.presets)
            self._about.content = _plain(chosen.description)
            if event.client_id is not None:
                self._load()

        @self._case.on_update
        def _(event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
            if event.client_id is not None:
                self._load()

        @load.on_click
        def _(_event: object) -> None:
            self._load()

    def _load(self) -> None:
        self._take(dict(self._found[self._scenario.value][self._case.value].changes))


class LogPanel:
    """Open a log and step through its impacts.

    Args:
        server: where the widgets go, inside the present container.
        session: takes the impacts.
        side: which side shows them.
        told: called after something was shown or refused.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        side: Callable[[], Side],
        told: Callable[[], None],
    ) -> None:
        self._session, self._side, self._told = session, side, told
        self._log: ImpactLog | None = None
        gui = server.gui
        self._path = gui.add_text("file (.mcap)", "", hint="Path of a log on this machine")
        opened = gui.add_button("Open", icon=viser.Icon.FOLDER_OPEN)
        self._impact = gui.add_dropdown("impact", (_NONE,), visible=False)
        self._step = gui.add_button_group("step", ("previous", "next"), visible=False)
        self._about = gui.add_html("")

        @opened.on_click
        def _(_event: object) -> None:
            self.open(self._path.value)

        @self._impact.on_update
        def _(event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
            if event.client_id is not None:
                self._show()

        @self._step.on_click
        def _(_event: object) -> None:
            options = self._impact.options
            step = 1 if self._step.value == "next" else -1
            at = options.index(self._impact.value) + step
            put(self._impact, options[min(max(at, 0), len(options) - 1)])
            self._show()

    def open(self, path: str) -> None:
        """Open a log and show its first impact; a log that cannot be read is said on the page."""
        try:
            log = open_log(Path(path.strip()).expanduser())
            if not len(log):
                raise HelmetSimError(f"{log.path}: no complete impact; {'; '.join(log.problems)}")
            admit_helmets(log)
            names = labels([impact.setup for impact in log])
        except HelmetSimError as error:
            self._refuse(str(error))
            return
        self._log = log
        put(self._path, str(log.path))
        self._impact.options = tuple(f"{i}: {name}" for i, name in enumerate(names, 1))
        put(self._impact, self._impact.options[0])
        self._impact.visible = self._step.visible = True
        said = [f"{len(log)} impacts", *log.warnings, *log.problems]
        self._about.content = f'{markup.STYLE}<div class="hs">' + "".join(
            f"<div>{markup.escaped(text)}</div>" for text in said
        ) + "</div>"  # fmt: skip
        self._show()

    def _show(self) -> None:
        if self._log is None:
            return
        index = self._impact.options.index(self._impact.value)
        try:
            record = self._log[index].record
        except HelmetSimError as error:
            self._refuse(str(error))
            return
        origin = f"{self._log.path.name}, impact {index + 1} of {len(self._log)}"
        self._session.show_logged(self._side(), record, origin)
        self._told()

    def _refuse(self, text: str) -> None:
        self._session.say(text)
        self._about.content = ""
        self._told()


class TakePanel:
    """The setup as texts to copy, and a button that sends it to running nodes."""

    def __init__(self, server: viser.ViserServer, session: Session, side: Callable[[], Side]):
        self._session, self._side = session, side
        gui = server.gui
        self._texts = gui.add_html("")
        self._asking = threading.Lock()
        self._answer: viser.GuiHtmlHandle | None = None
        if find_spec("rclpy") is None:
            return
        self._namespace = gui.add_text("namespace", "", hint="Namespace of the nodes")
        send = gui.add_button("Send to the nodes and run", icon=viser.Icon.SEND)
        self._answer = gui.add_html("")

        @send.on_click
        def _(_event: object) -> None:
            if self._asking.acquire(blocking=False):
                try:
                    self._send()
                finally:
                    self._asking.release()

    def show(self) -> None:
        """Write the texts of the setup as it is now."""
        changes = self._session.slot(self._side()).changes
        texts = {
            "helmet-sim": export.as_command(changes),
            "Python": export.as_python(changes),
            "YAML": export.as_yaml(changes),
        }
        self._texts.content = markup.copies(texts)

    def _send(self) -> None:
        assert self._answer is not None
        self._answer.content = _said("asking the simulation node…")
        values = self._session.slot(self._side()).values()
        try:
            from helmet_sim_ros.nodes.asking import ask_for_impact  # where there is ROS

            answer = ask_for_impact(values, self._namespace.value, _NODES_TIMEOUT)
        except HelmetSimError as error:
            self._answer.content = markup.STYLE + markup.problem(str(error))
            return
        self._answer.content = _said(", ".join(f"{k}: {v}" for k, v in answer.items()))


def _said(text: str) -> str:
    return f'{markup.STYLE}<div class="hs" data-answer>{markup.escaped(text)}</div>'


def _plain(text: str) -> str:
    """A text as Markdown that shows it as it is."""
    return "".join("\\" + c if c in "\\`*_{}[]()<>#+!|" else c for c in text)
