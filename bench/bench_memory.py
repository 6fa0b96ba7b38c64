"""Memory of each node over many impacts, no two of them alike: its slope per impact.

    python -m bench.bench_memory [--impacts 1500] [--per-file 100]

The first third is left out: there code is loaded and histories and caches fill up.
"""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import click
import numpy as np
import psutil

from bench.campaign.running import Rig
from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.nodes.setup_parameters import parameter_values

NODES = ("simulation", "evaluator", "recorder")
SETUP = ImpactSetup(rig="headform", duration=2e-3, time_step=1e-4)
#: Impacts between two looks.
PERIOD = 10


def memory(rig: Rig) -> list[int]:
    """What each node has of its own [byte]; pages shared with other processes do not count."""
    return [psutil.Process(rig.processes[name].pid).memory_full_info().uss for name in NODES]


def measured(impacts: int, per_file: int, folder: Path) -> tuple[list[int], np.ndarray]:
    """Run impacts: how many had been run at each look, and the memory of each node [byte]."""
    rng, counts, rows = random.Random(1), [], []
    with Rig(folder, ["simulation", "evaluator"]) as rig:
        rig.start("recorder", max_impacts=per_file)
        rig.until(lambda: rig.status["simulation"]["readers"] == "2")
        assert rig.set(**parameter_values(SETUP)) == ""
        for number in range(1, impacts + 1):
            changed = {
                "impact__normal_velocity": rng.uniform(3.0, 8.0),
                "impact__friction": rng.uniform(0.1, 0.6),
            }
            assert rig.set(**changed) == ""
            result = rig.impact()
            rig.recorded(result["impact_id"])
            rig.criteria.clear()
            for log in folder.glob("*.mcap"):
                log.unlink()
            if number % PERIOD == 0:
                counts.append(number)
                rows.append(memory(rig))
    return counts, np.array(rows)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--impacts", default=1500, show_default=True, type=click.IntRange(100))
@click.option("--per-file", default=100, show_default=True, type=click.IntRange(0),
              help="Impacts per log; 0: all in one.")  # fmt: skip
def main(impacts: int, per_file: int) -> None:
    """Run impacts and print, for each node, its memory and the slope of it."""
    with tempfile.TemporaryDirectory() as folder:
        counts, rows = measured(impacts, per_file, Path(folder))
    late = len(counts) // 3
    for name, column in zip(NODES, rows.T, strict=True):
        slope = np.polyfit(counts[late:], column[late:], 1)[0]
        looks = [column[i] / 1e6 for i in np.linspace(0, len(counts) - 1, 6).astype(int)]
        steps = " ".join(f"{look:.1f}" for look in looks)
        click.echo(f"{name}: {slope / 1e3:+.2f} kB per impact; {steps} MB")


if __name__ == "__main__":
    main()
