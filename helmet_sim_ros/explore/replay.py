"""Slow-motion replay: the time that is shown, moved by hand or by itself."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

import viser

from helmet_sim_ros.explore.curves import at_time
from helmet_sim_ros.explore.markup import STYLE
from helmet_sim_ros.explore.session import Shown, Side
from helmet_sim_ros.explore.widgets import put

_PLAY, _PAUSE, _PEAK = "play", "pause", "to the peak"
_RATE = 30.0  # pictures per second
#: How many times slower than the impact.
_SLOWER = {"50x slower": 50.0, "100x slower": 100.0, "300x slower": 300.0, "1000x slower": 1000.0}


class Replay:
    """Time slider, play and pause.

    Args:
        server: where the widgets go, inside the present container.
        lock: held while anything is drawn.
        draw: draws the scene at a time [s].
    """

    def __init__(
        self, server: viser.ViserServer, lock: threading.RLock, draw: Callable[[float], None]
    ) -> None:
        self._lock, self._draw = lock, draw
        self._impacts: Mapping[Side, Shown] = {}
        self._setting = False
        self._playing, self._closed = threading.Event(), threading.Event()
        gui = server.gui
        self._text = gui.add_html("")
        self._time = gui.add_slider("time [ms]", 0.0, 40.0, 0.05, 0.0)
        self._buttons = gui.add_button_group("", (_PLAY, _PAUSE, _PEAK))
        self._speed = gui.add_dropdown("speed", tuple(_SLOWER), initial_value="100x slower")

        @self._time.on_update
        def _(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client_id is not None and not self._setting:
                self.pause()
                with self._lock:
                    self._show_time()

        @self._buttons.on_click
        def _(_event: object) -> None:
            if self._buttons.value == _PLAY:
                self._playing.set()
                return
            self.pause()
            if self._buttons.value == _PEAK:
                with self._lock:
                    self.to_peak()

        self._thread = threading.Thread(target=self._run, name="explorer-replay", daemon=True)
        self._thread.start()

    @property
    def time(self) -> float:
        """What is shown [s]."""
        return 1e-3 * float(self._time.value)

    def show(self, impacts: Mapping[Side, Shown]) -> None:
        """Take other impacts; the time stays, as far as they reach."""
        self._impacts = impacts
        ends = [i.record.time[-1] for i in impacts.values() if i.record is not None]
        if ends:
            end = 1e3 * float(max(ends))
            if abs(end - self._time.max) > 1e-9:
                self._time.max, self._time.step = end, end / 800.0
            if self._time.value > end:
                self._set(end)
        self._show_time()

    def to_peak(self) -> None:
        """Go to the peak of the head's acceleration of the first impact."""
        for impact in self._impacts.values():
            if impact.evaluation is not None and impact.evaluation.peak_g.time is not None:
                self._set(1e3 * impact.evaluation.peak_g.time)
                self._show_time()
                return

    def pause(self) -> None:
        """Stop playing."""
        self._playing.clear()

    def close(self) -> None:
        """End the thread that plays."""
        self._closed.set()
        self._playing.set()
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._playing.wait()
            if self._closed.is_set():
                return
            before = time.monotonic()
            time.sleep(1.0 / _RATE)
            with self._lock:
                if not self._playing.is_set():
                    continue
                elapsed = time.monotonic() - before
                step = 1e3 * elapsed / _SLOWER[self._speed.value]
                now = float(self._time.value) + step
                self._set(0.0 if now > self._time.max else now)
                self._show_time()

    def _set(self, milliseconds: float) -> None:
        self._setting = True
        try:
            put(self._time, milliseconds)
        finally:
            self._setting = False

    def _show_time(self) -> None:
        self._draw(self.time)
        parts = [f'{STYLE}<div class="hs">']
        for side, impact in self._impacts.items():
            if impact.record is None:
                continue
            now = at_time(impact.record, sample_at(impact, self.time))
            parts.append(
                f'<div class="hs-line" data-now="{side}"><b>{side}</b>'
                f"<span>{now['time']:.2f} ms</span><span><b>{now['acceleration']:.0f}</b> g</span>"
                f"<span>F<sub>n</sub> {now['normal']:.2f} kN</span>"
                f"<span>F<sub>t</sub> {now['tangential']:.2f} kN</span>"
                f"<span>{now['rate']:.1f} rad/s</span></div>"
            )
        self._text.content = "".join([*parts, "</div>"])


def sample_at(impact: Shown, seconds: float) -> int:
    """The sample nearest to a time [s]."""
    assert impact.record is not None
    index = round((seconds - float(impact.record.time[0])) / impact.record.time_step)
    return min(max(index, 0), len(impact.record) - 1)
