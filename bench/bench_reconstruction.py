"""How often the truth lies in the intervals of a reconstruction: synthetic crash maps.

    python -m bench.bench_reconstruction --cases 40

Truths are drawn from the prior: speeds, place, direction of sliding. Each map is the simulated
residual crush of the cells within 110 mm of it, with normal noise of 0.5 mm. A 90 % interval should
hold 90 % of the truths; by chance, of 40 it holds 32 to 40 with a probability of 96 %.
"""

from __future__ import annotations

import argparse

import numpy as np

from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.study.reconstruction.crash import DURATION
from helmet_sim_ros.study.reconstruction.crush_map import CrushMap
from helmet_sim_ros.study.reconstruction.posterior import UNITS, reconstruct

NOISE = 0.5e-3  # m
SCANNED = 0.11  # m


def case(seed: int) -> dict[str, tuple[float, float, float]]:
    """The truth and the 90 % interval of each quantity."""
    random = np.random.default_rng(seed)
    setup = ImpactSetup(rig="headform", duration=DURATION, overrides={"helmet.coupling": "foam"})
    azimuth, elevation = random.uniform(-180.0, 180.0), random.uniform(-10.0, 80.0)
    normal = random.uniform(3.0, 9.0)
    x, y = random.uniform(-8.0, 8.0, 2)
    along = float(np.hypot(x, y))
    true = setup.replaced(
        {
            "normal_velocity": normal, "tangential_velocity": along,
            "tangential_heading_deg": float(np.degrees(np.arctan2(y, x))),
            "azimuth_deg": azimuth, "elevation_deg": elevation,
        }
    )  # fmt: skip
    impact = Impact(true)
    impact.advance(impact.total)
    cells, residual = columns(setup.helmet_config), impact.extras()["residual_crush"]
    middle = cells.point[residual > 2e-4].mean(axis=0)
    near = np.linalg.norm(cells.point - middle, axis=1) < SCANNED
    depth = residual[near] + NOISE * random.standard_normal(int(near.sum()))
    result = reconstruct(CrushMap(cells.point[near], depth), setup, NOISE, seed=seed)
    truth = {
        "normal_velocity": normal, "tangential_velocity": along,
        "speed": float(np.hypot(normal, along)),
        "angle": float(np.degrees(np.arctan2(normal, along))),
        "azimuth": azimuth, "elevation": elevation,
    }  # fmt: skip
    found = {}
    for name in UNITS:
        low, median, high = result.interval(name)
        value = truth[name]
        if name == "azimuth":
            value = median + (value - median + 180.0) % 360.0 - 180.0
        found[name] = (value, low, high)
    print(seed, f"{result.simulations} simulations, misfit {result.misfit:.2f};",
          "; ".join(f"{name} {v:.2f} in {lo:.2f}..{hi:.2f}" for name, (v, lo, hi) in found.items()),
          *result.notes, flush=True)  # fmt: skip
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    given = parser.parse_args()
    inside = dict.fromkeys(UNITS, 0)
    for seed in range(given.first, given.first + given.cases):
        for name, (value, low, high) in case(seed).items():
            inside[name] += low <= value <= high
    for name, count in inside.items():
        print(f"{name}: {count} of {given.cases} truths in the 90 % interval")


if __name__ == "__main__":
    main()
