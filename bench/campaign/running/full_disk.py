"""Recorders whose disk fills up, and has room again later."""

from __future__ import annotations

import random
from pathlib import Path

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.mounts import small_disk, unmount
from bench.campaign.running.on_nodes import (
    OnNodes,
    compare_told,
    logged,
    random_setups,
    recorded,
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
        ran, told = recorded(rig, random_setups(rng, IMPACTS))
        empty = [path for path in self.logs.glob("*" + PART) if not path.stat().st_size]
        if len(empty) > 1:
            return Outcome("lost", f"{len(empty)} empty files are left")
        ballast.unlink()
        rig.call("recorder/finish")  # refused if none is open
        compare_told(logged(self.logs), ran, told)
        self.goes_on(rig, rng)
        detail = f"{len(told)} of {IMPACTS} impacts on disk, the others told as errors"
        return Outcome("held" if len(told) == IMPACTS else "refused", detail)
