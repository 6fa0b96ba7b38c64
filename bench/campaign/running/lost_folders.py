"""Output folders that are removed, moved, replaced by a file or read-only while impacts run."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from bench.campaign.attack import Outcome
from bench.campaign.running import Rig
from bench.campaign.running.mounts import read_only, unmount
from bench.campaign.running.on_nodes import (
    OnNodes,
    compare_told,
    logged,
    random_setups,
    recorded,
    run_setups,
)

IMPACTS = 3


class LostFolders(OnNodes):
    """What is told as on disk after the folder is gone is on disk; else an error tells of it."""

    name = "lost folders"
    what = "the folder of the logs is removed, moved away, a file, or read-only; and there again"
    cases = (6, 100)

    def prepare(self, folder: Path) -> None:
        super().prepare(folder)
        trial = folder / "trial"
        trial.mkdir()
        with _read_only(trial):
            pass

    def attacked(self, rig: Rig, rng: random.Random) -> Outcome:
        spoil = rng.choice(SPOILS)
        before = run_setups(rig, random_setups(rng, rng.randrange(1, IMPACTS)))
        if rng.random() < 0.5:  # else the recorder may be in the middle of it
            rig.until(lambda: rig.status["recorder"]["impact_id"] == list(before)[-1])
        with spoil(self.logs) as elsewhere:
            ran, told = recorded(rig, random_setups(rng, IMPACTS))
            rig.call("recorder/finish")  # refused if none is open
        found = logged(self.logs)
        compare_told(found, ran, told)
        if elsewhere.exists():
            found |= logged(elsewhere)
        compare_told(found, before | ran, set())
        shutil.rmtree(elsewhere, ignore_errors=True)
        self.goes_on(rig, rng)
        return Outcome(
            "held" if len(told) == IMPACTS else "refused",
            f"{spoil.__name__}: {len(told)} of {IMPACTS} impacts on disk, else told as errors",
        )


@contextmanager
def _removed(folder: Path) -> Iterator[Path]:
    shutil.rmtree(folder)
    yield folder.with_name("none")
    folder.mkdir(exist_ok=True)


@contextmanager
def _moved(folder: Path) -> Iterator[Path]:
    elsewhere = folder.with_name("elsewhere")
    folder.rename(elsewhere)
    yield elsewhere
    folder.mkdir(exist_ok=True)


@contextmanager
def _a_file(folder: Path) -> Iterator[Path]:
    shutil.rmtree(folder)
    folder.write_bytes(b"")
    yield folder.with_name("none")
    folder.unlink()
    folder.mkdir()


@contextmanager
def _read_only(folder: Path) -> Iterator[Path]:
    read_only(folder)
    try:
        yield folder.with_name("none")
    finally:
        unmount(folder)


SPOILS: tuple[Callable[[Path], AbstractContextManager[Path]], ...] = (
    _removed, _moved, _a_file, _read_only,
)  # fmt: skip
