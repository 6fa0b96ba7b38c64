"""Logs with flipped bits, zeroed, repeated and missing blocks: opened and recovered."""

from __future__ import annotations

import json
import random
import shutil
import sys
from pathlib import Path

from bench.campaign.attack import Attack, Outcome
from bench.campaign.shown import PARTS, shown
from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.recover import recover

#: What storage writes and loses at once [byte].
SECTOR = 512
SETUPS = [
    ImpactSetup(duration=0.004, normal_velocity=5.0, tangential_velocity=3.0),
    ImpactSetup(duration=0.003, direction="front", normal_velocity=7.0, rig="headform"),
    ImpactSetup(duration=0.003, normal_velocity=6.0, overrides={"helmet.coupling": "foam"}),
]


class DamagedLogs(Attack):
    """Every part that a damaged log shows is the original, or an error or warning tells of it."""

    name = "damaged logs"
    what = "bits flipped, blocks zeroed, repeated, shifted or cut off; opened, and recovered"
    cases = (500, 10_000)

    def prepare(self, folder: Path) -> None:
        sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
        from logs import FIRST_START, SPACING, add_impact, session, simulated

        self._folder = folder
        log = session(folder / "whole.mcap", scenario="cases: []\n")
        for number, setup in enumerate(SETUPS):
            start = FIRST_START + number * SPACING
            add_impact(log, simulated(setup)[0], f"test-{number}", start)
        shutil.copy(folder / "whole.mcap.part", folder / "killed.part")
        path = log.close()
        self._files = [path.read_bytes(), (folder / "killed.part").read_bytes()]
        opened, self._truth = shown(path)
        assert len(opened) == len(SETUPS)
        assert not opened.warnings
        # Half of the damage goes where the least is: between and behind the chunks.
        index = opened._source
        spots = [m.offset for m in index.metadata_index] + [a.offset for a in index._attachments]
        self._spots = [*spots, len(self._files[0]) - 3000]

    def case(self, rng: random.Random) -> Outcome:
        how = rng.choice(["opened", "finished, recovered", "killed, recovered"])
        data, what = self._damaged(self._files[how.startswith("killed")], rng)
        place = self._folder / "damaged.mcap"
        place.write_bytes(data)
        outcome = self._opened(place) if how == "opened" else self._recovered(place)
        return Outcome(outcome.verdict, f"{how}, {what}: {outcome.detail}")

    def _damaged(self, data: bytes, rng: random.Random) -> tuple[bytes, str]:
        size = len(data)
        at = rng.randrange(size)
        if rng.random() < 0.5:
            at = min(max(0, rng.choice(self._spots) + rng.randrange(-200, 3000)), size - 1)
        length = min(rng.choice([1, 2, 8, SECTOR, 8 * SECTOR, 64 * SECTOR]), size - at)
        if length >= SECTOR and rng.random() < 0.5:
            at -= at % SECTOR
        source = rng.randrange(size - length + 1)
        kind = rng.choice(["flip", "flips", "zero", "copy", "insert", "remove", "cut", "noise"])
        what = f"{kind} {length} at {at} of {size}"
        if kind == "flip":
            return _replaced(data, at, bytes([data[at] ^ 1 << rng.randrange(8)])), what
        if kind == "flips":
            for _ in range(rng.randrange(2, 9)):
                spot = rng.randrange(at, at + length)
                data = _replaced(data, spot, bytes([rng.randrange(256)]))
            return data, what
        if kind == "zero":
            return _replaced(data, at, bytes(length)), what
        if kind == "noise":
            return _replaced(data, at, rng.randbytes(length)), what
        if kind == "copy":
            return _replaced(data, at, data[source : source + length]), what + f" from {source}"
        if kind == "insert":
            return data[:at] + data[source : source + length] + data[at:], what + f" from {source}"
        if kind == "remove":
            return data[:at] + data[at + length :], what
        return data[:at], what

    def _opened(self, path: Path) -> Outcome:
        try:
            log, found = shown(path)
        except LogError as error:
            return Outcome("refused", str(error))
        told = " ".join([*log.warnings, *log.problems, *(i.model_problem for i in log)]).strip()
        return self._compared(found, told)

    def _recovered(self, path: Path) -> Outcome:
        target = self._folder / "saved.mcap"
        target.unlink(missing_ok=True)
        try:
            result = recover(path, target)
            log, found = shown(target)
        except LogError as error:
            return Outcome("refused", str(error))
        told = json.dumps(result.lost)
        if json.loads(log.metadata["recovered"]["lost"]) != list(result.lost):
            return Outcome("lost", "the log says other losses than the recovery")
        return self._compared(found, told, recovered=True)

    def _compared(
        self, found: dict[str, str | LogError], told: str, recovered: bool = False
    ) -> Outcome:
        """Whether all that differs from the original is told of."""
        ids = json.loads(str(found["ids"]))
        true_ids = json.loads(str(self._truth["ids"]))
        if len(set(ids)) < len(ids) or not set(ids) <= set(true_ids):
            return Outcome("lost", f"impacts {ids}")
        refused = ""
        for impact in true_ids:
            if impact not in ids:
                if not _is_told(impact, told):
                    return Outcome("lost", f"impact {impact} is gone, told: {told}")
                refused = f"{impact} is gone: {told}"
        for name, true in self._truth.items():
            impact, _, part = name.partition(" ")
            if name == "ids" or (part in PARTS and impact not in ids):
                continue
            value = found.get(name)
            if isinstance(value, LogError):
                if recovered:
                    return Outcome("lost", f"{name} of a recovered log: {value}")
                refused = str(value)
            elif value == true:
                continue
            elif value in (None, "", "{}") and _is_told(_told_as(name), told):
                refused = f"{name} is gone: {told}"
            else:
                return Outcome("lost", f"{name} is {str(value)[:80]!r}, told: {told}")
        return Outcome("refused" if refused or told not in ("", "[]") else "held", refused)


def _told_as(name: str) -> str:
    """How a loss of this part must be named."""
    impact, _, part = name.partition(" ")
    if part in PARTS:
        return impact
    return {"run": "metadata run", "library": "metadata run"}.get(name, part)


def _is_told(name: str, told: str) -> bool:
    """By its name, or by the place in a file whose index, with the names, is gone."""
    unnamed = "index at the end" in told or "never finished" in told or "cut off" in told
    return name in told or (unnamed and ("at offset" in told or "from offset" in told))


def _replaced(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]
