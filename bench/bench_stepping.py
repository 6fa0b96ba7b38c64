"""Stepping cost as ratios measured in one run.

    python bench/bench_stepping.py

Prints, for either form of the helmet, the stepping loop over a bare ``mj_step`` loop on the same
model and motion (without any of our forces), the loop at several rates over both, and a whole
impact (set-up, stepping, record, all criteria) over its stepping alone. CPU time of one process;
median of interleaved rounds.
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
    for form in ("spring", "foam"):
        measure(form)


def measure(form: str) -> None:
    """Print the ratios of one impact on the side, of a helmet of this form."""
    setup, coarse = (
        ImpactSetup(
            normal_velocity=7.5, tangential_velocity=5.0,
            overrides={"helmet.coupling": form, "sim.rates": rates},
        )
        for rates in ("single", "several")
    )  # fmt: skip
    for kind in (setup, coarse):
        first = Impact(kind)
        first.advance(first.total)  # compile once
    substeps = round(setup.time_step / first.model.opt.timestep)
    steps = setup.samples * substeps
    loop, several, bare, whole = [], [], [], []
    for _ in range(ROUNDS):
        impact = Impact(setup)
        loop.append(cpu(lambda impact=impact: impact.advance(impact.total)))
        other = Impact(coarse)
        several.append(cpu(lambda impact=other: impact.advance(impact.total)))

        twin = Impact(setup)
        twin.advance(1)
        model, data = twin.model, mujoco.MjData(twin.model)
        data.qpos[:], data.qvel[:] = next(twin.states())
        # The same work without our forces: nstep in C, no Python in between.
        bare.append(cpu(lambda m=model, d=data: mujoco.mj_step(m, d, nstep=steps)))

        whole.append(cpu(lambda: evaluate(_simulated(setup))))
    stepping, rates, plain, total = (statistics.median(x) for x in (loop, several, bare, whole))
    print(f"{form}: {setup.samples} samples, {substeps} integration steps each")
    print(f"  stepping loop / bare mj_step           {stepping / plain:.3f}")
    print(f"  several rates / bare mj_step           {rates / plain:.3f}")
    print(f"  several rates / stepping loop          {rates / stepping:.3f}")
    print(f"  whole impact with evaluation / stepping {total / stepping:.3f}")
    print(f"  stepping of one impact                 {stepping * 1e3:.1f} ms CPU")
    riders = [
        ImpactSetup(overrides={"helmet.coupling": form, "rider.height": 1.6 + 0.01 * i})
        for i in range(ROUNDS)
    ]
    new = statistics.median(cpu(lambda s=s: Impact(s)) for s in riders)
    again = statistics.median(cpu(lambda: Impact(setup)) for _ in riders)
    print(f"  set-up of a new rider, of a known one  {new * 1e3:.1f}, {again * 1e3:.1f} ms CPU")


def _simulated(setup: ImpactSetup) -> object:
    impact = Impact(setup)
    impact.advance(impact.total)
    return impact.record()


if __name__ == "__main__":
    main()
