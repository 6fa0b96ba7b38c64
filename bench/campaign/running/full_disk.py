"""Recorders whose disk fills up, and has room again later."""

from __future__ import annotations

import random
from pathlib import Path

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.mounts import small_disk, unmount
from bench.campaign.running.on_nodes import (
    OnNodes,
    compare,
    compare_all,
    logged,
    random_setups,
    recorded,
    run_setups,
)
from helmet_sim_ros.mcap_log.writer import PART

#: Size of the disk: some dozen impacts.
SIZE = 2_000_000
IMPACTS = 12


class FullDisk(OnNodes):
    """Told as on disk is on disk, all else is told as an error, and no empty files pile up."""

    name = "full disk"
    what = "impacts are recorded on a small tmpfs until it is full, and after it was emptied"
    cases = (3, 100)

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        self._disk = folder / "disk"
        self._disk.mkdir()
        small_disk(self._disk, SIZE)

    def place(self, home: Path) -> Path:
        return self._disk / home.name

    def close(self) -> None:
        super().close()
        unmount(self._disk)

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        ballast = self.logs / "ballast"
        ballast.write_bytes(bytes(rng.randrange(SIZE // 2, SIZE - 50_000)))
        ran, told = {}, set()
        for setup in random_setups(rng, IMPACTS):
            impact_id, on_disk = recorded(rig, setup)
            ran[impact_id] = setup
            told |= {impact_id} if on_disk else set()
        empty = [path for path in self.logs.glob("*" + PART) if not path.stat().st_size]
        if len(empty) > 1:
            return Outcome("lost", f"{len(empty)} empty files are left")
        ballast.unlink()
        rig.call("recorder/finish")  # refused if none is open
        found = logged(self.logs)
        if gone := told - set(found):
            return Outcome("lost", f"told as on disk, but not there: {gone}")
        for impact_id in set(found) & set(ran):
            compare(found[impact_id], ran[impact_id], judged=impact_id in told)
        self.cleared()
        again = run_setups(rig, random_setups(rng, 1))
        compare_all(self.finished(rig), again)
        self.cleared()
        detail = f"{len(told)} of {IMPACTS} impacts on disk, the others told as errors"
        return Outcome("held" if len(told) == IMPACTS else "refused", detail)
