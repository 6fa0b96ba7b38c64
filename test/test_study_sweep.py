"""Sweeps: right rows, kept through any interruption, bit-identical however they are computed."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pyarrow.parquet as parquet
import pytest

from helmet_sim_ros import evaluate, simulate
from helmet_sim_ros.errors import SetupError, StudyError
from helmet_sim_ros.model.setup import setup_from_names
from helmet_sim_ros.study import load_study, sweep
from helmet_sim_ros.study.sweeps.engine import CHUNKS_PER_WORKER, Chunk, open_engine
from helmet_sim_ros.study.sweeps.worker import Job, Outcome, run_chunk

SHORT = "impact.rig: headform, sim.duration: 0.008"
STUDY = f"""
common: {{{SHORT}}}
product: {{impact.direction: [front, left]}}
draw:
  count: 16
  values: {{impact.normal_velocity: {{uniform: [3.0, 8.0]}}}}
"""
#: The middle case fails: samples of 1 ms are too coarse for the filter that this standard needs.
FAILING = """
common: {impact.rig: headform, sim.duration: 0.012}
cases: [{}, {sim.time_step: 1.0e-3}, {impact.direction: top}]
standard: STANDARD
"""
FILTERED = "title: mine\nlimits: {peak_g_cfc1000: {max: 275.0, source: mine, verified: false}}\n"


@pytest.fixture
def study(tmp_path: Path):
    """A study from its YAML text."""

    def load(text: str = STUDY):
        path, standard = tmp_path / "mine.yaml", tmp_path / "filtered.yaml"
        standard.write_text(FILTERED, encoding="utf-8")
        text = text.replace("STANDARD", str(standard))
        path.write_text(text, encoding="utf-8")
        return load_study(path)

    return load


def files(folder: Path) -> list[bytes]:
    return [(folder / name).read_bytes() for name in ("results.parquet", "results.csv")]


class Interruption(Exception):
    """What ends a sweep in these tests."""


def stop_after(rows: int):
    """A progress callback that interrupts the sweep."""

    def progress(done: int, total: int, failed: int) -> None:
        if done >= rows:
            raise Interruption

    return progress


def test_every_row_is_what_the_simulation_gives(study, tmp_path):
    plan = study()
    result = sweep(plan, tmp_path / "out", workers=0)
    rows = result.table.to_pylist()
    assert [row["index"] for row in rows] == list(range(32))
    for row in (rows[0], rows[13], rows[31]):
        mine = plan.row(row["index"])
        assert row["impact.normal_velocity"] == mine.values["impact.normal_velocity"]
        expected = evaluate(simulate(setup_from_names(mine.values)))
        assert row["verdict"] == expected.verdict
        for name, criterion in expected.criteria.items():
            assert row[name] == criterion.value, name


def test_parquet_and_csv_hold_the_same_numbers_exactly(study, tmp_path):
    result = sweep(study(), tmp_path / "out", workers=0)
    csv = pytest.importorskip("pyarrow.csv").read_csv(tmp_path / "out" / "results.csv")
    assert csv.column_names == result.table.column_names
    for name in ("impact.normal_velocity", "peak_g", "hic", "force_ratio"):
        assert csv[name].to_pylist() == result.table[name].to_pylist()
    assert result.table.equals(parquet.read_table(tmp_path / "out" / "results.parquet"))


def test_a_row_has_the_notes_of_its_evaluation(study, tmp_path):
    fast = SHORT.replace("0.008", "0.02") + ", helmet: {name: fullface, coupling: foam}"
    plan = study(f"common: {{{fast}}}\nproduct: {{impact.normal_velocity: [3.0, 14.0]}}")
    result = sweep(plan, tmp_path / "out", workers=0)
    expected = [evaluate(simulate(setup_from_names(row.values))).warnings for row in plan.rows()]
    assert result.table["notes"].to_pylist() == [list(notes) for notes in expected]
    assert not expected[0] and "the liner is crushed" in expected[1][0]
    [(kind, count)] = result.notes.items()
    assert count == 1 and kind.startswith("the liner is crushed by … % at (…, …, …) mm")
    csv = (tmp_path / "out" / "results.csv").read_text(encoding="utf-8")
    assert expected[1][0] in csv and "[" not in csv


def test_an_interrupted_sweep_goes_on_without_repeating_or_losing_a_row(study, tmp_path):
    whole = sweep(study(), tmp_path / "whole", workers=0)
    out = tmp_path / "out"
    with pytest.raises(Interruption):
        sweep(study(), out, workers=0, chunk=5, progress=stop_after(10))
    with pytest.raises(Interruption):
        sweep(study(), out, workers=0, chunk=3, progress=stop_after(19))
    result = sweep(study(), out, workers=0, chunk=7)
    assert result.computed == 32 - 19
    assert result.table.equals(whole.table)
    assert files(out) == files(tmp_path / "whole")
    assert sweep(study(), out, workers=0).computed == 0


def test_a_failed_case_is_a_row_with_its_error_and_the_others_are_there(study, tmp_path):
    result = sweep(study(FAILING), tmp_path / "out", workers=0)
    rows = result.table.to_pylist()
    assert [row["status"] for row in rows] == ["ok", "failed", "ok"]
    assert result.failed == 1
    assert "too coarse" in rows[1]["error"]
    assert rows[1]["peak_g"] is None and rows[1]["verdict"] is None
    assert rows[0]["peak_g"] > 0.0 and rows[2]["peak_g"] > 0.0


def test_failed_rows_are_computed_again_on_request_only(study, tmp_path):
    plan = study(FAILING)
    sweep(plan, tmp_path / "out", workers=0)
    assert sweep(plan, tmp_path / "out", workers=0).computed == 0
    again = sweep(plan, tmp_path / "out", workers=0, retry_failed=True)
    assert again.computed == 1
    assert len(again.table) == 3


def test_results_of_another_study_are_refused_and_left_alone(study, tmp_path):
    sweep(study(), tmp_path / "out", workers=0)
    before = files(tmp_path / "out")
    with pytest.raises(SetupError, match="another study: other drawn values"):
        sweep(study(STUDY.replace("8.0]", "7.0]")), tmp_path / "out", workers=0)
    assert files(tmp_path / "out") == before


def test_two_sweeps_cannot_write_to_one_place(study, tmp_path):
    def second(*_: int) -> None:
        with pytest.raises(SetupError, match="another process"):
            sweep(study(), tmp_path / "out", workers=0)

    sweep(study(), tmp_path / "out", workers=0, chunk=32, progress=second)


def test_a_folder_that_cannot_be_made_is_refused(study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SetupError, match="cannot be written"):
        sweep(study(), tmp_path / "file" / "out", workers=0)


def test_a_study_that_the_disk_cannot_hold_is_refused(study, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=100_000))
    with pytest.raises(SetupError, match=r"32 impacts need up to .* MB, 0 MB are free"):
        sweep(study(), tmp_path / "out", workers=0)


def test_a_part_of_the_results_that_is_broken_is_named(study, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(Interruption):
        sweep(study(), out, workers=0, chunk=5, progress=stop_after(10))
    part = min((out / "rows").iterdir())
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(StudyError, match=f"{part.name}.*computed again"):
        sweep(study(), out, workers=0)
    part.unlink()
    assert sweep(study(), out, workers=0).computed == 32 - 5


def test_a_full_disk_stops_the_sweep_and_keeps_what_is_finished(tmp_path):
    (tmp_path / "mine.yaml").write_text(STUDY.replace("16", "64"))
    # A limit on the size of a file fails like a full disk: chunks fit, the whole table does not.
    code = (
        "import resource, sys; from helmet_sim_ros.study import sweep\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, [int(sys.argv[1])] * 2)\n"
        "sweep('mine.yaml', 'out', workers=0, chunk=16)"
    )

    command = [sys.executable, "-c", code, "70000"]
    limited = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert "StudyError" in limited.stderr and "is kept" in limited.stderr, limited.stderr
    assert not list((tmp_path / "out").rglob("*.part"))
    assert sweep(tmp_path / "mine.yaml", tmp_path / "out", workers=0).computed == 0


def test_the_worst_rows_are_those_with_the_largest_criterion(study, tmp_path):
    result = sweep(study(), tmp_path / "out", workers=0)
    worst = result.worst("hic", 3)
    values = sorted(result.table["hic"].to_pylist(), reverse=True)
    assert [result.table["hic"][row.index].as_py() for row in worst] == values[:3]


@pytest.fixture(scope="module")
def cluster():
    """An engine of two worker processes."""
    with open_engine(workers=2) as engine:
        yield engine


def worker_pids(engine) -> dict[str, int]:
    return dict(engine._client.run(os.getpid))


def test_one_two_and_no_workers_give_the_same_bits_even_if_one_is_killed(study, tmp_path):
    alone = sweep(study(), tmp_path / "alone", workers=0)
    one = sweep(study(), tmp_path / "one", workers=1, chunk=9)
    killed: list[int] = []

    def kill(done: int, total: int, failed: int) -> None:
        if done > 4 and not killed:
            from distributed import default_client

            killed.append(next(iter(default_client().run(os.getpid).values())))
            os.kill(killed[0], signal.SIGKILL)

    two = sweep(study(), tmp_path / "two", workers=2, chunk=2, progress=kill)
    assert killed
    assert two.failed == 0
    assert alone.table.equals(one.table) and alone.table.equals(two.table)
    assert files(tmp_path / "alone") == files(tmp_path / "one") == files(tmp_path / "two")


def test_a_killed_worker_costs_its_chunk_only(cluster, study):
    rows = list(study().rows())
    setups = tuple(row.values for row in rows)
    chunks = [Chunk(i, setups[i : i + 2]) for i in range(0, len(setups), 2)] * 2
    chunks = [Chunk(i, chunk.setups) for i, chunk in enumerate(chunks)]
    job = Job("ece_r22_05", ("peak_g",))
    found: dict[int, list[Outcome]] = {}
    for chunk, outcomes in cluster.run(job, chunks):
        found[chunk.tag] = outcomes
        if len(found) == 3:
            os.kill(min(worker_pids(cluster).values()), signal.SIGKILL)
    assert sorted(found) == list(range(len(chunks)))
    for chunk in (chunks[0], chunks[-1]):
        assert found[chunk.tag] == run_chunk(job, chunk.setups)
    # What the scheduler says it sent out: each chunk once, and again only what was with the killed
    # worker: running, waiting there, or finished and not yet handed over.
    log = cluster._client.cluster.scheduler.transition_log
    started = [entry[0] for entry in log if entry[2] == "processing" and "run_chunk" in entry[0]]
    repeated = len(started) - len(set(started))
    assert repeated <= 2 * CHUNKS_PER_WORKER


def test_an_impact_that_kills_its_worker_fails_and_spares_the_others(cluster, study):
    row = study().row(0)
    chunks = [
        Chunk(0, (row.values,)),
        Chunk(1, (row.values, {"impact.friction": Deadly()}, row.values)),
        Chunk(2, (row.values,)),
    ]
    job = Job("ece_r22_05", ("peak_g",))
    scheduler = cluster._client.cluster.scheduler
    before, scheduler.allowed_failures = scheduler.allowed_failures, 0
    try:
        found = {chunk.tag: outcomes for chunk, outcomes in cluster.run(job, chunks)}
    finally:
        scheduler.allowed_failures = before
    (good,) = run_chunk(job, [row.values])
    assert found[0] == found[2] == [good]
    assert [outcome.status for outcome in found[1]] == ["ok", "failed", "ok"]
    assert "worker process dies" in (found[1][1].error or "")


class Deadly:
    """Ends every process that unpickles it, but this one."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        here = f"__import__('os').getpid() == {os.getpid()}"
        again = f"__import__('sys').modules[{__name__!r}].Deadly()"
        return eval, (f"{again} if {here} else __import__('os')._exit(9)",)


def test_a_running_scheduler_is_used_as_it_is(study, tmp_path):
    python = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    note = tmp_path / "scheduler.json"
    options = ["--no-dashboard", "--host", "127.0.0.1", "--port", "0"]
    scheduler = subprocess.Popen(
        [*python, *options, "--scheduler-file", str(note)], cwd=tmp_path,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    python = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(note)]
    worker = subprocess.Popen(
        [*python, "--no-dashboard", "--nthreads", "1"], cwd=tmp_path,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        import json
        import time

        deadline = time.monotonic() + 60.0
        address = None
        while address is None:
            assert scheduler.poll() is None and time.monotonic() < deadline
            time.sleep(0.1)
            with suppress(FileNotFoundError, json.JSONDecodeError):  # not there, or half written
                address = json.loads(note.read_text())["address"]
        result = sweep(study(), tmp_path / "out", scheduler=address)
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait(30)
    assert result.table.equals(sweep(study(), tmp_path / "alone", workers=0).table)


def test_an_unreachable_scheduler_is_refused(study, tmp_path, monkeypatch):
    monkeypatch.setattr("helmet_sim_ros.study.sweeps.engine.CONNECT_TIMEOUT", 1.0)
    for address in ("tcp://127.0.0.1:9", "nowhere", "tcp://"):
        with pytest.raises(SetupError, match="cannot be reached"):
            sweep(study(), tmp_path / "out", scheduler=address)
    assert not list((tmp_path / "out").rglob("*.parquet"))
