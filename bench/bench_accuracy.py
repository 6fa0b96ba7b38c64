"""How exact the default step is: both ways of stepping against single rate at a tenth of it.

    python bench/bench_accuracy.py [RANDOM]

24 oblique impacts, 16 drops and RANDOM (100) drawn ones of a rider: all directions, 3 to 8 m/s,
some on a kerbstone or hemisphere; mean and worst error of each criterion, for both forms of the
helmet.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.errors import SetupError

FINE = 5e-6  # s
CRITERIA = ("peak_g", "hic", "force_ratio", "peak_angular_acceleration", "peak_neck_bending")
DIRECTIONS = ("front", "back", "left", "top")


def cases(count: int) -> Iterator[dict[str, Any]]:
    """What the impacts differ in."""
    for direction, normal, tangential in product(DIRECTIONS, (2.5, 5.0, 7.5), (5.0, 10.0)):
        yield {"direction": direction, "normal_velocity": normal, "tangential_velocity": tangential}
    for direction, normal in product(DIRECTIONS, (3.0, 4.5, 6.0, 7.5)):
        yield {"direction": direction, "normal_velocity": normal, "tangential_velocity": 0.0}
    rng = np.random.default_rng(0)
    for _ in range(count):
        yield {
            "direction": str(rng.choice(DIRECTIONS)),
            "normal_velocity": float(rng.uniform(3.0, 8.0)),
            "tangential_velocity": float(rng.uniform(0.0, 10.0)),
            "tangential_heading_deg": float(rng.uniform(-180.0, 180.0)),
            "surface": str(rng.choice(["ground", "ground", "ground", "kerbstone", "hemisphere"])),
        }


def values(case: dict[str, Any], form: str, rates: str, step: float) -> np.ndarray:
    """Of the criteria."""
    overrides = {"helmet.coupling": form}
    setup = ImpactSetup(**case, rates=rates, time_step=step, overrides=overrides)
    results = evaluate(simulate(setup)).criteria
    return np.array([results[name].value for name in CRITERIA], dtype=float)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for form in ("spring", "foam"):
        errors: dict[str, list[np.ndarray]] = {"single": [], "several": []}
        for case in cases(count):
            try:
                exact = values(case, form, "single", FINE)
            except SetupError as error:
                print(f"left out: {error}")
                continue
            for rates, found in errors.items():
                found.append(np.abs(values(case, form, rates, 5e-5) / exact - 1.0))
        for rates, found in errors.items():
            every = 100.0 * np.array(found)
            print(f"{form}, {rates}, {len(every)} impacts, mean / worst error:")
            for name, of_one in zip(CRITERIA, every.T, strict=True):
                worst = of_one[np.isfinite(of_one)]
                print(f"  {name:26} {worst.mean():.2f} / {worst.max():.1f} %")


if __name__ == "__main__":
    main()
