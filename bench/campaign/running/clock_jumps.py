"""Wall clocks that jump while impacts run: by libfaketime, those of the nodes alone."""

from __future__ import annotations

import os
import random
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

from bench.campaign.attack import Impossible, Outcome
from bench.campaign.running import Rig
from bench.campaign.running.on_nodes import (
    Loss,
    OnNodes,
    compare_all,
    random_setups,
    run_setup,
    run_setups,
)

#: Where Debian's package libfaketime and a build of its sources put the library.
PLACES = ("/usr/lib/*/faketime", "/usr/lib/faketime", "/usr/local/lib/faketime")
LIBRARY = "libfaketimeMT.so.1"  # for processes with threads
IMPACTS = 4
#: Farthest jump [s]: ten years.
FARTHEST = 3.2e8
#: How long an impact may take until its log is opened and named [s].
SOON = timedelta(minutes=5)


class ClockJumps(OnNodes):
    """No result, message or log depends on the wall clock but a log's name and its start."""

    name = "clock jumps"
    what = "the wall clock of every node jumps by up to ten years, to and fro, while impacts run"
    cases = (4, 100)

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        found = [path for place in PLACES for path in Path("/").glob(f"{place[1:]}/{LIBRARY}")]
        if not found:
            raise Impossible(f"{LIBRARY} is not installed (Debian: libfaketime)")
        self._library, self._offset = found[0], folder / "offset"

    def _begun(self) -> Rig:
        self._jump(0.0)
        own = os.environ.copy()
        os.environ |= {
            "LD_PRELOAD": str(self._library), "FAKETIME_TIMESTAMP_FILE": str(self._offset),
            "FAKETIME_NO_CACHE": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1", "NO_FAKE_STAT": "1",
        }  # fmt: skip
        try:
            return super()._begun()
        finally:
            for name in set(os.environ) - set(own):
                del os.environ[name]

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        days = self._jumped(rng)
        first, *setups = random_setups(rng, IMPACTS)
        opened = datetime.now(UTC) + timedelta(days=days)
        ran = run_setups(rig, [first])

        def jump() -> None:
            rig.serve(rng.uniform(0.0, 0.05))
            self._jumped(rng)

        for setup in setups:
            ran[run_setup(rig, setup, jump)["impact_id"]] = setup
        compare_all(self.finished(rig), ran)
        self._check_name(opened)
        self.cleared()
        return Outcome("held", f"first by {days:+.0f} days, then {len(setups)} times")

    def _jumped(self, rng: random.Random) -> float:
        """A random jump; its length [days]."""
        seconds = rng.choice([1.0, 3600.0, 86400.0, FARTHEST]) * rng.uniform(-1.0, 1.0)
        self._jump(seconds)
        return seconds / 86400.0

    def _jump(self, seconds: float) -> None:
        fresh = self._offset.with_suffix(".new")
        fresh.write_text(f"{seconds:+.3f}\n", encoding="ascii")
        fresh.replace(self._offset)

    def _check_name(self, opened: datetime) -> None:
        """The clock did jump: the log has the false time in its name."""
        (log,) = self.logs.glob("*.mcap")
        (stamp,) = re.findall(r"\d{8}T\d{6}Z", log.name)
        told = datetime.strptime(stamp, "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
        if abs(told - opened) > SOON:
            raise Loss(
                f"{log.name}: the clock of the recorder showed about {opened:%Y%m%dT%H%M%SZ}"
            )
