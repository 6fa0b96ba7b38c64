"""Sweeps whose processes are killed, and two sweeps into one place."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil

from bench.campaign.attack import Attack, Outcome
from bench.campaign.running.kills import ended_by
from helmet_sim_ros.study import sweep

ROWS = 512
STUDY = f"""
common: {{impact.rig: headform, sim.duration: 0.02}}
product: {{impact.direction: [front, left]}}
draw:
  count: {ROWS // 2}
  values: {{impact.normal_velocity: {{uniform: [3.0, 8.0]}}}}
"""
RESULTS = ("results.parquet", "results.csv")
#: Latest instant of a kill [s]: the workers need some seconds to come up.
LATEST = 8.0
#: Longest sweep on a busy machine, and how long its processes may take to end [s].
LONGEST = 300.0
ENDED = 60.0


class _Sweeps(Attack):
    """Sweeps of one study, against the same in this process."""

    bounded = False

    def prepare(self, folder: Path) -> None:
        self._folder = folder
        self._study = folder / "study.yaml"
        self._study.write_text(STUDY, encoding="utf-8")
        sweep(self._study, folder / "true", workers=0)
        self._true = [(folder / "true" / name).read_bytes() for name in RESULTS]

    def _begin(self, output: Path, workers: int) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "helmet_sim_ros", "sweep", str(self._study), "--output",
             str(output), "--workers", str(workers)],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=self._folder,
        )  # fmt: skip

    def _is_right(self, output: Path) -> bool:
        return [(output / name).read_bytes() for name in RESULTS] == self._true

    def _place(self) -> Path:
        output = self._folder / "output"
        shutil.rmtree(output, ignore_errors=True)
        return output


class KilledSweeps(_Sweeps):
    """The results are bit for bit those of a sweep that nobody disturbed."""

    name = "killed sweeps"
    what = "workers, or the sweep itself, get SIGKILL at a random instant; it is begun again"
    cases = (3, 100)

    def case(self, rng: random.Random) -> Outcome:
        output, delay = self._place(), rng.uniform(0.0, LATEST)
        process = self._begin(output, 2)
        try:
            time.sleep(delay)
            if rng.random() < 0.5:
                what = "the sweep"
                if left := ended_by(process, signal.SIGKILL, ENDED):
                    return Outcome("lost", f"still there after a kill: {left}")
            else:
                what = _kill_a_worker(process, rng)
                process.communicate(timeout=LONGEST)
        finally:
            process.kill()
            process.wait()
        code = process.returncode
        if code:  # the same command goes on
            again = self._begin(output, rng.choice([0, 2]))
            said, _ = again.communicate(timeout=LONGEST)
            if again.returncode:
                return Outcome("lost", f"{what} killed: it does not go on: {said[-300:]}")
        if not self._is_right(output):
            return Outcome("lost", f"{what} killed after {delay:.1f} s: other results")
        return Outcome("held", f"{what} killed after {delay:.1f} s, exit code {code}")


class TwoSweeps(_Sweeps):
    """One of them computes, the other says that the place is taken."""

    name = "two sweeps"
    what = "two sweeps into one folder, started at nearly the same time"
    cases = (2, 100)

    def case(self, rng: random.Random) -> Outcome:
        output = self._place()
        processes = [self._begin(output, rng.choice([0, 2]))]
        time.sleep(rng.uniform(0.0, 2.0))
        processes.append(self._begin(output, rng.choice([0, 2])))
        try:
            said = [process.communicate(timeout=LONGEST)[0] for process in processes]
        finally:
            for process in processes:
                process.kill()
        codes = [process.returncode for process in processes]
        if not self._is_right(output):
            return Outcome("lost", f"other results, exit codes {codes}")
        for code, text in zip(codes, said, strict=True):
            if code and (code != 2 or "another process" not in text):
                return Outcome("lost", f"exit code {code}: {text[-300:]}")
        return Outcome("refused" if any(codes) else "held", f"exit codes {codes}")


def _kill_a_worker(process: subprocess.Popen[Any], rng: random.Random) -> str:
    """Kill one of the processes that a sweep has started."""
    try:
        children = psutil.Process(process.pid).children(recursive=True)
        victim = rng.choice(children)
        # The tracker of multiprocessing is no worker.
        name = "tracker" if "tracker" in " ".join(victim.cmdline()) else "a worker"
        victim.kill()
    except (psutil.NoSuchProcess, IndexError):
        return "nothing"
    return name
