"""Stepping cost as ratios measured in one run.

    python bench/bench_stepping.py

Prints the stepping loop over a bare ``mj_step`` loop on the same model and motion (without any
of our forces), with a sample at every step and at every second one, and a whole impact (set-up,
stepping, record, all criteria) over its stepping alone. CPU time of one process; median of
interleaved rounds.
"""

from __future__ import annotations

import statistics
import time

import mujoco

from helmet_sim_ros import ImpactSetup, evaluate
from helmet_sim_ros.model.impact import Impact

ROUNDS = 30


def cpu(action: object) -> float:
    """CPU seconds of a call."""
    start = time.process_time()
    action()  # type: ignore[operator]
    return time.process_time() - start


def main() -> None:
    for speed in (5.0, 6.0):  # the harder impact needs a smaller step
        measure(ImpactSetup(normal_velocity=speed, tangential_velocity=5.0))


def measure(setup: ImpactSetup) -> None:
    """Print the ratios of one impact."""
    first = Impact(setup)
    first.advance(setup.samples)  # compile once
    substeps = round(setup.time_step / first.model.opt.timestep)
    steps = setup.samples * substeps
    loop, bare, whole = [], [], []
    for _ in range(ROUNDS):
        impact = Impact(setup)
        loop.append(cpu(lambda impact=impact: impact.advance(impact.total)))

        twin = Impact(setup)
        twin.advance(1)
        model, data = twin.model, mujoco.MjData(twin.model)
        data.qpos[:], data.qvel[:] = next(twin.states())
        # The same work without our forces: nstep in C, no Python in between.
        bare.append(cpu(lambda m=model, d=data: mujoco.mj_step(m, d, nstep=steps)))

        whole.append(cpu(lambda: evaluate(_simulated(setup))))
    stepping, plain, total = (statistics.median(x) for x in (loop, bare, whole))
    print(f"{setup.samples} samples, {substeps} integration steps each")
    print(f"  stepping loop / bare mj_step           {stepping / plain:.3f}")
    print(f"  whole impact with evaluation / stepping {total / stepping:.3f}")
    print(f"  stepping of one impact                 {stepping * 1e3:.1f} ms CPU")


def _simulated(setup: ImpactSetup) -> object:
    impact = Impact(setup)
    impact.advance(impact.total)
    return impact.record()


if __name__ == "__main__":
    main()
