"""Recorders that are killed, or whose disk fills up, at any instant."""

from __future__ import annotations

import os
import random
import re
import resource
import signal
import sys
import time
from pathlib import Path
from typing import NoReturn

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.recover import recover

#: Impacts that a recorder writes if nothing comes between.
IMPACTS = 40
#: Most bytes of a file when the disk is full: some ten impacts.
FULL = 400_000


class InterruptedLogs(Attack):
    """Every impact that was told as written is read back: samples, setup, model and criteria."""

    name = "interrupted logs"
    what = "the process that writes a log gets SIGKILL, or its disk is full; then recovery"
    cases = (20, 300)
    bounded = False  # a process of its own for each

    def prepare(self, folder: Path) -> None:
        sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
        from logs import simulated

        setup = ImpactSetup(duration=0.004, time_step=1e-4, normal_velocity=5.0)
        self._impact, self._record = simulated(setup)
        self._model = self._impact.model_xml()
        self._verdict = evaluate(self._record)
        self._folder = folder

    def case(self, rng: random.Random) -> Outcome:
        for path in self._folder.iterdir():
            path.unlink()
        path = self._folder / "a.mcap"
        limit = rng.randrange(100, FULL) if rng.random() < 0.3 else None
        after, delay = rng.randrange(IMPACTS // 2), rng.uniform(0.0, 0.03)
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            self._write(path, writer, limit)
        os.close(writer)
        with open(reader, "rb") as pipe:
            told = len(pipe.read(after if limit is None else -1))
            time.sleep(delay)
            if limit is None:
                os.kill(child, signal.SIGKILL)
            told += len(pipe.read())
        os.waitpid(child, 0)
        what = f"full at {limit}" if limit else f"killed after {told}"
        return self._checked(path, told, what)

    def _write(self, path: Path, pipe: int, limit: int | None) -> NoReturn:
        """What the other process does: it tells of each impact that is on the disk."""
        from logs import add_impact, session

        try:
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            log = session(path)
            for number in range(IMPACTS):
                add_impact(log, self._impact, f"i{number}", 1.0 + 0.1 * number)
                os.write(pipe, b"x")
            log.close()
        except LogError:
            os._exit(2)
        finally:
            os._exit(1)

    def _checked(self, path: Path, told: int, what: str) -> Outcome:
        part = path.with_name(path.name + ".part")
        lost = ""
        if not path.exists():
            if not part.exists():
                return Outcome("lost" if told else "refused", f"{what}: no file")
            try:
                lost = "; ".join(recover(part).lost)
            except LogError as error:
                return Outcome("lost" if told else "refused", f"{what}: {error}")
        log = open_log(path)
        if [impact.impact_id for impact in log] != [f"i{k}" for k in range(len(log))]:
            return Outcome("lost", f"{what}: {[impact.impact_id for impact in log]}")
        if len(log) < told:
            return Outcome("lost", f"{what}: {told} were told, {len(log)} are there; {lost}")
        for number, impact in enumerate(log):
            same = same_samples(impact.record, self._record)
            if not same or impact.setup != self._record.setup or impact.model != self._model:
                return Outcome("lost", f"{what}: another impact {impact.impact_id}")
            if impact.logged != self._verdict and (number < told or impact.logged is not None):
                return Outcome("lost", f"{what}: other criteria of {impact.impact_id}")
            if impact.logged is None and not re.search(rf"\b{impact.impact_id}\b", lost):
                return Outcome("lost", f"{what}: no criteria of {impact.impact_id}: {lost}")
        return Outcome("refused" if lost else "held", f"{what}: {len(log)} there; {lost}")
