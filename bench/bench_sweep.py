"""Cost of studies, measured: overhead, workers, memory, client, scaling.

    python bench/bench_sweep.py [overhead] [workers] [memory] [client] [scaling] [--plot FILE]

Without names: all of them, some minutes. CPU times are of one process; wall times are medians of
interleaved rounds, so that other load on the machine hits both sides of a ratio.
"""

from __future__ import annotations

import argparse
import contextlib
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.model.force.contact import touch
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.study import sweep
from helmet_sim_ros.study.sweeps import engine as engines
from helmet_sim_ros.study.sweeps.engine import Chunk, Engine, open_engine
from helmet_sim_ros.study.sweeps.study import Study, StudyFile, build_study
from helmet_sim_ros.study.sweeps.worker import Job, run_chunk

IMPACTS = 1000
ROUNDS = 9
MOST_ROUNDS = 30
QUIET = 0.1
LONG_RUN = 10_000
JOB = Job("ece_r22_05", ("peak_g", "hic"))


def study(count: int, coupling: str, riders: bool = True, **file: Any) -> Study:
    """Rider impacts whose speed, friction and, if wanted, rider differ from one to the next."""
    draw = {
        "method": "random",
        "count": count,
        "values": {
            "impact.normal_velocity": {"uniform": [4.0, 8.0]},
            "impact.friction": {"uniform": [0.2, 0.6]},
        },
    }
    if riders:
        draw["population"] = {"name": "ansur_ii"}
    common = {"helmet.coupling": coupling, **file.pop("common", {})}
    return build_study(StudyFile(common=common, draw=draw, **file), Path("bench"))


def overhead() -> None:
    """CPU time of a whole sweep in one process, and what it was spent on."""
    print(f"a study of {IMPACTS} impacts in one process, CPU time")
    few = {"criteria": list(JOB.criteria), "riders": False}
    several = {"common": {"sim.rates": "several"}}
    for name, plan in (
        ("spring, a rider per impact, all criteria", study(IMPACTS, "spring")),
        ("foam, a rider per impact, all criteria", study(IMPACTS, "foam")),
        ("spring, several rates, a rider each, all", study(IMPACTS, "spring", **several)),
        ("foam, several rates, a rider each, all", study(IMPACTS, "foam", **several)),
        ("spring, one rider, peak g and HIC", study(IMPACTS, "spring", **few)),
        ("foam, one rider, peak g and HIC", study(IMPACTS, "foam", **few)),
    ):
        simulate(ImpactSetup(overrides=plan.row(0).values))
        with tempfile.TemporaryDirectory() as folder, timed() as spent:
            start = time.process_time()
            sweep(plan, folder, workers=0)
            whole = time.process_time() - start
        run = spent["run_chunk"]
        stepping, evaluating = spent["advance"], spent["evaluate"]
        print(f"  {name}: {whole / IMPACTS * 1e3:.2f} ms per impact")
        for part, seconds in (
            ("stepping", stepping),
            ("setup, model and record", run - stepping - evaluating),
            ("criteria", evaluating),
            ("study: rows, files, bookkeeping", whole - run),
        ):
            print(f"    {part:<34} {seconds / IMPACTS * 1e3:7.2f} ms {seconds / whole:7.1%}")
        print(f"    everything but stepping / stepping {whole / stepping - 1.0:7.1%}")
        print(f"    study / (simulate and evaluate)    {whole / run - 1.0:7.1%}")


@contextlib.contextmanager
def timed() -> Iterator[Counter[str]]:
    """CPU seconds spent in stepping, evaluation and whole rows while it is open."""
    import helmet_sim_ros.biomech.evaluation as evaluation

    spent: Counter[str] = Counter()

    def watch(owner: Any, name: str) -> Callable[[], None]:
        inner = getattr(owner, name)

        def timed_call(*args: Any, **kwargs: Any) -> Any:
            start = time.process_time()
            try:
                return inner(*args, **kwargs)
            finally:
                spent[name] += time.process_time() - start

        setattr(owner, name, timed_call)
        return lambda: setattr(owner, name, inner)

    undo = [watch(Impact, "advance"), watch(evaluation, "evaluate"), watch(engines, "run_chunk")]
    try:
        yield spent
    finally:
        for restore in undo:
            restore()


def workers() -> None:
    """Wall time with two workers over one, beside what the machine itself gives.

    The latter is the same impacts in one and in two bare processes, half of them each, without any
    scheduling: on a machine that others use it is far from 2. Only what is measured runs: an idle
    cluster takes a few percent of a core. A round counts as quiet if other processes used less
    than ``QUIET`` cores in all four parts.
    """
    rows = [row.values for row in study(480, "foam").rows()]
    size = len(rows) // 8  # what a sweep with two workers does
    chunks = [Chunk(i, tuple(rows[i : i + size])) for i in range(0, len(rows), size)]
    print(f"{len(rows)} foam impacts in chunks of {size}, two workers over one; two bare processes "
          "over one; quotient")  # fmt: skip
    quiet: list[tuple[float, float]] = []
    everything: list[tuple[float, float]] = []
    while len(quiet) < ROUNDS and len(everything) < MOST_ROUNDS:
        parts = [_clustered(1, chunks), _clustered(2, chunks)]
        with get_context("spawn").Pool(2) as pool:
            halves = [(JOB, rows[0::2]), (JOB, rows[1::2])]
            pool.starmap(run_chunk, [(JOB, half[:20]) for _, half in halves * 2], chunksize=1)
            parts += [
                wall(lambda split=split: pool.starmap(run_chunk, split, chunksize=1))
                for split in ([(JOB, rows)], halves)
            ]
        seconds, others = zip(*parts, strict=True)
        ratios = seconds[0] / seconds[1], seconds[2] / seconds[3]
        everything.append(ratios)
        if max(others) < QUIET:
            quiet.append(ratios)
        print(f"  {ratios[0]:.2f} {ratios[1]:.2f} {ratios[0] / ratios[1]:.2f}"
              + (" quiet" if max(others) < QUIET else ""))  # fmt: skip
    for name, found in (("quiet", quiet), ("all", everything)):
        if found:
            medians = [statistics.median(column) for column in zip(*found, strict=True)]
            quotient = statistics.median(a / b for a, b in found)
            print(f"  medians of {len(found)} {name} rounds: {medians[0]:.2f} {medians[1]:.2f} "
                  f"{quotient:.2f}")  # fmt: skip


def _clustered(workers: int, chunks: list[Chunk[int]]) -> tuple[float, float]:
    """:func:`wall` of all chunks on a local cluster that is ready to go."""
    with open_engine(workers) as engine:
        run_all(engine, [Chunk(i, chunks[0].setups[:20]) for i in range(2 * workers)])
        return wall(lambda: run_all(engine, chunks))


def run_all(engine: Engine, chunks: list[Chunk[int]]) -> None:
    """Compute all chunks."""
    for _ in engine.run(JOB, chunks):
        pass


def wall(action: Callable[[], object]) -> tuple[float, float]:
    """Seconds of a call, and how many cores other processes used meanwhile."""
    busy, mine, start = _busy(), _mine(), time.perf_counter()
    action()
    seconds = time.perf_counter() - start
    return seconds, (_busy() - busy - (_mine() - mine)) / seconds


def _busy() -> float:
    """CPU seconds of the whole machine."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - getattr(times, "iowait", 0.0))


def _mine() -> float:
    """CPU seconds of this process and its children."""
    here = psutil.Process()
    times = [process.cpu_times() for process in (here, *here.children(recursive=True))]
    return float(sum(t.user + t.system for t in times))


def memory() -> None:
    """Memory of a worker over many impacts, each with a rider and helmet of its own."""
    print(f"memory of one worker over {LONG_RUN} impacts [MB]")
    print("    impacts   resident  its share   its own")
    plan = study(LONG_RUN, "foam", common={"sim.duration": 0.008})
    with open_engine(1) as engine:
        client = engine._client  # type: ignore[attr-defined]
        (pid,) = set(client.run(_pid).values())
        process = psutil.Process(pid)
        marks = [0, 100, 1000, 2500, 5000, 7500, LONG_RUN]
        for first, last in zip([0, *marks], marks, strict=False):
            rows = [plan.row(i).values for i in range(first, last)]
            for _ in engine.run(JOB, (Chunk(i, tuple(rows[i : i + 50]))
                                      for i in range(0, len(rows), 50))):  # fmt: skip
                pass
            info = process.memory_full_info()
            shares = (info.rss, info.pss, info.uss)
            print(f"  {last:>9}" + "".join(f" {share / 1e6:10.0f}" for share in shares))


def _pid() -> int:
    import os

    return os.getpid()


def client() -> None:
    """What one client and one scheduler can keep up with, and how large results get."""
    from helmet_sim_ros.study.sweeps.results import ResultStore

    start = time.process_time()
    plan = study(LONG_RUN * 10, "spring")
    loading = time.process_time() - start
    rows = len(plan)
    (outcome,) = run_chunk(Job("ece_r22_05", plan.criteria), [plan.row(0).values])
    random = np.random.default_rng(0)  # equal rows would compress too well
    noise = random.uniform(0.5, 1.5, (1000, len(outcome.values)))
    varied = [
        replace(outcome, values=tuple(None if v is None else v * f for v, f in
                                      zip(outcome.values, factors, strict=True)))
        for factors in noise.tolist()
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, ResultStore(Path(folder), plan) as store:
        start = time.process_time()
        for first in range(0, rows, 100):
            store.append([(plan.row(i), varied[i % 1000]) for i in range(first, first + 100)])
        keeping = time.process_time() - start
        size = sum(path.stat().st_size for path in Path(folder).rglob("*.parquet"))
        start = time.process_time()
        store.finish()
        finishing = time.process_time() - start
        final = {path.suffix: path.stat().st_size for path in Path(folder).glob("results.*")}
    print(f"client, {rows} rows of {len(plan.criteria)} criteria in chunks of 100")
    for name, seconds in (("draw and check", loading), ("keep", keeping), ("finish", finishing)):
        print(f"  {name:<15} {seconds / rows * 1e3:7.3f} ms per row")
    print(f"  bytes per row: chunks {size / rows:.0f}, "
          + ", ".join(f"{suffix} {n / rows:.0f}" for suffix, n in final.items()))  # fmt: skip
    nothing = {"impact.friction": -1.0}  # refused at once: what is left is the way there and back
    with open_engine(2) as engine:
        count = 2000
        for size in (1, 100):
            start = time.perf_counter()
            for _ in engine.run(JOB, (Chunk(i, (nothing,) * size) for i in range(count // size))):
                pass
            spent = (time.perf_counter() - start) / count * size
            print(f"  a chunk of {size} refused impacts: {spent * 1e3:.1f} ms")


def scaling(plot: Path | None) -> None:
    """CPU time per impact over columns, duration, rate and contacts."""
    foam = {"helmet.coupling": "foam"}
    cases: dict[str, tuple[str, list[tuple[float, dict[str, Any]]]]] = {
        "foam columns": (
            "columns",
            [(n, {**foam, "helmet.liner.columns": n}) for n in (100, 300, 600, 1200, 2400, 4800)],
        ),
        "duration": ("ms", [(t, {"sim.duration": t * 1e-3}) for t in (10, 20, 40, 80, 160)]),
        "sampling rate": (
            "kHz",
            [(1e-3 / step, {"sim.time_step": step}) for step in (1e-5, 2e-5, 5e-5, 1e-4, 2e-4)],
        ),
        "contacts": (
            "shapes on the ground",
            [
                (contacts(values), values)
                for values in (
                    {"impact.body_angle_deg": angle} for angle in (90.0, 45.0, 20.0, 6.0, 0.0)
                )
            ],
        ),
    }
    found = {
        name: (unit, [(x, cost(v)) for x, v in points]) for name, (unit, points) in cases.items()
    }
    print("CPU time of one impact, simulated and evaluated [ms]; spring unless it says foam")
    for name, (unit, points) in found.items():
        print(f"  {name:<15}" + ", ".join(f"{x:g} {unit}: {ms:.1f}" for x, ms in points))
    if plot is not None:
        _plot(plot, found)
        print(f"plot: {plot}")


def cost(values: dict[str, Any]) -> float:
    """CPU time of one impact [ms], the best of some: other load only ever adds."""
    setup = _setup(values)
    evaluate(simulate(setup))
    times = []
    for _ in range(15):
        start = time.process_time()
        evaluate(simulate(setup))
        times.append(time.process_time() - start)
    return min(times) * 1e3


def contacts(values: dict[str, Any]) -> int:
    """How many shapes of helmet and body touch the ground at the same time at most."""
    impact, most = Impact(_setup(values)), 0
    while impact.done_samples < impact.total:
        impact.advance(10)
        touching = [
            touch(impact.contact, impact.surface, 0, impact._simulation.motion, i)[0] > 0.0
            for i in range(len(impact.contact.body))
        ]
        most = max(most, sum(touching))
    return most


def _setup(values: dict[str, Any]) -> ImpactSetup:
    return ImpactSetup(normal_velocity=6.0, tangential_velocity=5.0, overrides=values)


def _plot(path: Path, found: dict[str, tuple[str, list[tuple[float, float]]]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.0), layout="constrained")
    for axis, (name, (unit, points)) in zip(
        figure.subplots(1, len(found)), found.items(), strict=True
    ):
        axis.plot(*zip(*points, strict=True), "o-")
        highest = max(ms for _, ms in points)
        axis.set(xlabel=f"{name} [{unit}]", ylim=(0.0, 1.1 * highest))
        axis.grid(alpha=0.3)
    figure.axes[0].set_ylabel("CPU time per impact [ms]")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    names = ("overhead", "workers", "memory", "client", "scaling")
    parser.add_argument("names", nargs="*", choices=[*names, []], help="default: all")
    parser.add_argument("--plot", type=Path, help="where the plot of the scaling goes")
    options = parser.parse_args()
    for name in options.names or names:
        if name == "scaling":
            scaling(options.plot)
        else:
            globals()[name]()


if __name__ == "__main__":
    main()
