"""Speed of the criteria on one core: HIC alone, and evaluations of all criteria and of a few.

    python bench/bench_criteria.py

Prints each time beside what it must stay below, and HIC's beside a plain loop over all window
lengths. Random records are the worst case for HIC; those of impacts are what a study evaluates.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.biomech import ImpactRecord, evaluate, hic
from helmet_sim_ros.biomech.record import CHANNELS

STEP = 5e-5
G = 9.80665


def pulses(samples: int, random: np.random.Generator, noise: float = 2.0) -> NDArray[np.float64]:
    """A head acceleration of several random pulses and noise, shape (samples, 3) [g]."""
    stamps = np.arange(samples) * STEP
    signal = random.normal(size=(samples, 3)) * noise
    for _ in range(3):
        centre, width = random.uniform(0, stamps[-1]), random.uniform(1e-3, 8e-3)
        shape = np.exp(-(((stamps - centre) / width) ** 2))
        signal += np.outer(shape, random.normal(size=3) * random.uniform(20, 120))
    return signal


def record(samples: int, random: np.random.Generator) -> ImpactRecord:
    """A record with a signal on every channel."""
    arrays = {
        name: np.cumsum(random.normal(size=(samples, len(labels))), axis=0)
        for name, (labels, _) in CHANNELS.items()
    }
    acceleration = pulses(samples, random) * G
    arrays["head_acceleration"] = acceleration
    arrays["head_velocity"] = np.cumsum(acceleration, axis=0) * STEP
    arrays["head_angular_acceleration"] *= 100.0
    for name in ("head_orientation", "helmet_orientation"):
        arrays[name] /= np.linalg.norm(arrays[name], axis=1)[:, None]
    return ImpactRecord(time=np.arange(samples) * STEP, **arrays)


def loop_over_lags(values: NDArray[np.float64]) -> float:
    """HIC, unlimited, one vector operation per window length."""
    speed = np.concatenate(([0.0], np.cumsum((values[1:] + values[:-1]) / 2)))
    lags = range(1, len(speed))
    return float(max((speed[k:] - speed[:-k]).max() / k**0.6 for k in lags) ** 2.5 * STEP)


def milliseconds(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def each(records: Sequence[ImpactRecord], criteria: Sequence[str] | None) -> float:
    """Median time of evaluating one of the records, in turn."""
    turn = itertools.cycle(records)
    return milliseconds(lambda: evaluate(next(turn), None, criteria), 10 * len(records))


def main() -> None:
    random = np.random.default_rng(1)
    signals = {
        "pulses": np.linalg.norm(pulses(4001, random), axis=1),
        "noise": np.abs(random.normal(size=4001)) * 5.0,
        "constant": np.full(4001, 30.0),
    }
    print("HIC of 4001 samples [ms]      unlimited (<= 25)   15 ms (<= 2)   loop over lags")
    for name, values in signals.items():
        assert np.isclose(hic(values, STEP).value, loop_over_lags(values))
        unlimited = milliseconds(lambda v=values: hic(v, STEP), 50)  # type: ignore[misc]
        short = milliseconds(lambda v=values: hic(v, STEP, 0.015), 50)  # type: ignore[misc]
        plain = milliseconds(lambda v=values: loop_over_lags(v), 5)  # type: ignore[misc]
        print(f"  {name:<26} {unlimited:>12.2f} {short:>18.2f} {plain:>16.1f}")

    random_ones = [record(801, random) for _ in range(100)]
    impacts = [
        simulate(ImpactSetup(rig=rig, direction=direction, normal_velocity=speed))
        for rig in ("rider", "headform")
        for direction in ("front", "back", "left", "top")
        for speed in (4.0, 7.5)
    ]
    few = ("peak_g", "hic", "bric")
    count = len(evaluate(impacts[0]).criteria)
    print(f"evaluation of 801 samples [ms]  all {count} (<= 3)   {', '.join(few)} (<= 0.5)")
    for name, records in (("random records", random_ones), ("impacts", impacts)):
        every, some = (each(records, criteria) for criteria in (None, few))
        print(f"  {name:<26} {every:>12.2f} {some:>20.2f}")


if __name__ == "__main__":
    main()
