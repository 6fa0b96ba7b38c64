"""How exact the shell's plate is: blows on curved anvils against a finer grid, columns and steps.

    python bench/bench_shell.py

Headform J on four sites of either helmet; half the cell, twice the columns and half the time step
at once. Errors of peak and HIC, root mean square and worst, and the time that a blow takes.
"""

from __future__ import annotations

import time
from itertools import product

import numpy as np

from helmet_sim_ros import ImpactSetup, evaluate
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.impact import Impact

SITES = ("top", "front", "back", "left")
BLOWS = {
    "fullface": (
        ("kerbstone", 6.0), ("kerbstone", 7.5), ("hemisphere", 5.2), ("hemisphere", 7.0),
        ("edge_anvil", 5.0),
    ),
    "bicycle": (("kerbstone", 4.57), ("hemisphere", 4.8)),
}  # fmt: skip


def blow(helmet: str, site: str, anvil: str, speed: float, finer: bool) -> FloatArray:
    """Peak [g], HIC and processor time [ms] of one blow."""
    config = load_helmet(helmet)
    overrides: dict[str, object] = {"helmet.coupling": "foam", "head.form": "en960_j"}
    if finer:
        overrides |= {
            "helmet.shell.cell": 0.5 * config.shell.cell,
            "helmet.liner.columns": 2 * config.liner.columns,
            "sim.time_step": 2.5e-5,
        }
    impact = Impact(
        ImpactSetup(
            rig="headform", helmet=helmet, direction=site, surface=anvil, normal_velocity=speed,
            duration=0.025, overrides=overrides,
        )
    )  # fmt: skip
    start = time.thread_time()
    impact.run()
    took = 1e3 * (time.thread_time() - start)
    found = evaluate(impact.record(), criteria=["peak_g", "hic"])
    return np.array([found.peak_g.value, found.hic.value, took])


def main() -> None:
    blow("fullface", "top", "kerbstone", 5.0, False)  # loads machine code
    for helmet, blows in BLOWS.items():
        cases = [(helmet, site, *anvil) for site, anvil in product(SITES, blows)]
        found = np.array([blow(*case, False) for case in cases])
        exact = np.array([blow(*case, True) for case in cases])
        errors = 100.0 * (found / exact - 1.0)[:, :2]
        mean, worst = np.sqrt((errors**2).mean(axis=0)), np.abs(errors).max(axis=0)
        print(
            f"{helmet}, {len(cases)} blows, {np.median(found[:, 2]):.0f} ms each: "
            f"peak {mean[0]:.1f} / {worst[0]:.1f} %, HIC {mean[1]:.1f} / {worst[1]:.1f} %"
        )
        for case, (peak, hic) in zip(cases, errors, strict=True):
            print(f"  {case[1]:<6} {case[2]:<12} {case[3]:.2f} m/s {peak:6.1f} {hic:6.1f} %")


if __name__ == "__main__":
    main()
