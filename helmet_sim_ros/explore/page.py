"""The page: a setup to turn on the left, the scene in the middle, results on the right."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import viser

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.biomech.standards import standard_names
from helmet_sim_ros.errors import HelmetSimError, LogError
from helmet_sim_ros.explore import markup
from helmet_sim_ros.explore.charts import Charts
from helmet_sim_ros.explore.presets import collections
from helmet_sim_ros.explore.replay import Replay, sample_at
from helmet_sim_ros.explore.session import SIDES, Session, Shown, Side
from helmet_sim_ros.explore.stage import BESIDE, Stage, axes
from helmet_sim_ros.explore.take import LogPanel, PresetPanel, TakePanel
from helmet_sim_ros.explore.turn import TurnPanel
from helmet_sim_ros.explore.widgets import put
from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.report.replay.scene import scene_of

_LEFT_WIDTH, _RIGHT_WIDTH, _REPLAY_WIDTH = 330, 430, 380  # px
_VIEWS = ("rider", "helmet", "from above")


class Page:
    """Everything on the page, and the session behind it.

    Args:
        server: viser's, without anything on it.
        files: scenario files whose cases are offered first.

    Attributes:
        session: the state behind the page.
        problems: what could not be read at the start, in words.
    """

    def __init__(self, server: viser.ViserServer, files: Sequence[str] = ()) -> None:
        self._server = server
        self._lock = threading.RLock()
        self._impacts: dict[Side, Shown] = {}
        self._offset: dict[Side, FloatArray] = {side: np.zeros(3) for side in SIDES}
        self._seen = False
        self.session = Session(self._show)
        found, self.problems = collections(files)
        self._ground = _dress(server)
        self._stages = {side: Stage(server, side) for side in SIDES}
        gui = server.gui
        gui.main_panel.dock_left()
        gui.main_panel.set_width(_LEFT_WIDTH)
        self._problem = gui.add_html("")
        self._compare = gui.add_checkbox(
            "compare A | B", False, hint="Hold a second setup against the first"
        )
        self._turning = gui.add_dropdown("turn", SIDES, visible=False, hint="Which setup you turn")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Setup", viser.Icon.ADJUSTMENTS):
            self._turn = TurnPanel(server, self._changed)
        with tabs.add_tab("Presets", viser.Icon.LIST):
            self._presets = PresetPanel(server, found, self._load)
        with tabs.add_tab("Log", viser.Icon.DATABASE):
            self.log = LogPanel(server, self.session, self._side, self._told)
        with tabs.add_tab("Export", viser.Icon.SHARE):
            self._take = TakePanel(server, self.session, self._side)
        self._add_results()
        self._add_replay()
        self._connect()
        if self.problems:
            self.session.say("; ".join(self.problems))
        self._told()

    def start(self, log: Path | None = None) -> None:
        """Compute and show the first impact, or show the first one of a log."""
        if log is not None:
            self.log.open(str(log))
        if log is None or self.session.refusal:
            self.session.start()

    def close(self) -> None:
        """End the threads of the page."""
        self.session.close()
        self._replay.close()

    def _add_results(self) -> None:
        gui = self._server.gui
        results = gui.add_panel()
        with results.add_tab("Impact", viser.Icon.ACTIVITY):
            self._headline = gui.add_html(markup.headline(self.session, {}))
            names = standard_names()
            self._standard = gui.add_dropdown(
                "standard", tuple(names), initial_value=self.session.standard,
                hint="Whose limits the criteria are held against",
            )  # fmt: skip
            self._charts = Charts(self._server)
        with results.add_tab("Criteria", viser.Icon.TABLE):
            self._criteria = gui.add_html("")
        results.dock_right()
        results.set_width(_RIGHT_WIDTH)

    def _add_replay(self) -> None:
        gui = self._server.gui
        panel = gui.add_panel()
        with panel.add_tab("Replay", viser.Icon.MOVIE):
            self._replay = Replay(self._server, self._lock, self._draw)
            self._view = gui.add_button_group("look at", _VIEWS)
        panel.float(x=15, y=-15, width=_REPLAY_WIDTH)

    def _connect(self) -> None:
        @self._compare.on_update
        def _(event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
            with self._lock:
                if self._compare.value:
                    self.session.open_b()
                    self._turning.visible = True
                    put(self._turning, "B")
                else:
                    self._turning.visible = False
                    put(self._turning, "A")
                    self.session.close_b()
                self._told()

        @self._turning.on_update
        def _(_event: object) -> None:
            self._told()

        @self._standard.on_update
        def _(_event: object) -> None:
            self.session.judge_by(self._standard.value)
            self._told()

        @self._view.on_click
        def _(_event: object) -> None:
            with self._lock:
                self._look(self._view.value)

    def _side(self) -> Side:
        return "B" if self._turning.value == "B" and self.session.has("B") else "A"

    def _changed(self, name: str) -> None:
        with self._lock:
            self.session.change(self._side(), name, self._turn.content(name))
            self._told(name)

    def _load(self, changes: dict[str, object]) -> None:
        with self._lock:
            self.session.load(self._side(), changes)
            self._told()

    def _told(self, turned: str = "") -> None:
        """Write the setup as it is now: after one control was turned, or all of it."""
        with self._lock, self._server.atomic():
            self._problem.content = markup.STYLE + markup.problem(self.session.refusal)
            self._turn.set(self.session.slot(self._side()).values(), turned, whole=not turned)
            self._take.show()

    def _show(self, side: Side, shown: Shown | None) -> None:
        """Show an impact: all of it, in one go."""
        with self._lock:
            if shown is None:
                self._impacts.pop(side, None)
                scene = None
            elif not self.session.has(side):
                return
            else:
                self._impacts[side] = shown
                self._impacts = {s: self._impacts[s] for s in SIDES if s in self._impacts}
                scene = _scene(shown)
            with self._server.atomic():
                if shown is None:
                    self._stages[side].clear()
                else:
                    self._place(side, shown, scene)
                floors = [self._stages[each].floor for each in self._impacts]
                self._ground.position = (0.0, 0.0, min(floors, default=0.0))
                self._headline.content = markup.headline(self.session, self._impacts)
                self._charts.show(self._impacts)
                self._criteria.content = markup.criteria(self._impacts, self.session.differences())
                self._replay.show(self._impacts)
                if not self._seen and scene is not None:
                    self._seen = True
                    self._look(_VIEWS[0])
                    self._replay.to_peak()

    def _place(self, side: Side, shown: Shown, scene: Scene | None) -> None:
        sideways = self._sideways()  # across A: B moves along with it
        self._offset["B"] = BESIDE * sideways
        self._stages["B"].move(self._offset["B"])
        self._stages[side].show(shown, scene, self._offset[side], -sideways)

    def _draw(self, seconds: float) -> None:
        with self._server.atomic():
            for side, impact in self._impacts.items():
                if impact.record is not None:
                    self._stages[side].draw(sample_at(impact, seconds))

    def _sideways(self) -> FloatArray:
        """A horizontal direction across the first rider, away from his face, (3,)."""
        along, face = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
        impact = self._impacts.get("A")
        if impact is not None and impact.record is not None:
            along, face = axes(impact.record)
        across = np.cross([0.0, 0.0, 1.0], along)
        norm = float(np.linalg.norm(across))
        across = np.array([0.0, 1.0, 0.0]) if norm < 1e-6 else across / norm
        away: FloatArray = -across if float(across @ face) > 0.0 else across
        return away

    def _look(self, view: str) -> None:
        """Turn every camera to the rider or his helmet, from the side of his face."""
        center, extent = self._stages["A"].extent(helmet_only=view == "helmet")
        away = -self._sideways()
        if view == "from above":
            position = center + 3.0 * extent * np.array([0.0, 0.0, 1.0]) + 0.02 * away
        else:
            distance = max(2.9 * extent, 0.9)
            position = center + distance * (0.92 * away + np.array([0.0, 0.0, 0.38]))
        first = self._server.initial_camera
        first.position, first.look_at = position, center
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at = position, center


def _scene(shown: Shown) -> Scene | None:
    if shown.record is None:
        return None
    try:
        return scene_of(shown.record)
    except (LogError, HelmetSimError):
        return None


def _dress(server: viser.ViserServer) -> viser.GridHandle:
    """Colours and lights; the ground."""
    gui, scene = server.gui, server.scene
    gui.configure_theme(
        control_width="medium", dark_mode=False, show_logo=False, show_share_button=False,
        brand_color=(31, 98, 184),
    )  # fmt: skip
    gui.set_panel_label("helmet-sim explore")
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    scene.configure_environment_map("studio", environment_intensity=0.55)
    scene.configure_default_lights(enabled=True, cast_shadow=True)
    server.initial_camera.fov = float(np.radians(45.0))
    return scene.add_grid(
        "/ground", plane="xy", infinite_grid=True, cell_size=0.1, section_size=0.5,
        cell_color=(214, 218, 224), section_color=(184, 190, 198), fade_distance=14.0,
        plane_color=(236, 238, 241), plane_opacity=1.0, shadow_opacity=0.35,
    )  # fmt: skip
