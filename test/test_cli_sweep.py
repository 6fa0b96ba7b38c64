"""The verbs sweep and optimise as a user meets them: exit codes, messages, files."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pyarrow.parquet as parquet
import pytest
from click.testing import CliRunner

from helmet_sim_ros.cli import main
from helmet_sim_ros.study import sweep

STUDY = """
common: {impact.rig: headform, sim.duration: 0.008}
product: {impact.direction: [front, left]}
draw:
  count: COUNT
  values: {impact.normal_velocity: {uniform: [3.0, 8.0]}}
percentiles: {criteria: [peak_g], at: [95.0], by: [impact.direction]}
"""
SEARCH = """
common:
  helmet: {name: fullface, coupling: foam, liner.columns: 150}
  impact: {rig: headform, normal_velocity: 6.0}
  sim.duration: 0.008
product: {impact.direction: [front]}
variables: {helmet.liner.density: [40.0, 80.0]}
objectives: [{minimise: helmet_mass}]
constraints: [{of: worst peak_g, at_most: LIMIT}]
trials: 8
batch: 8
"""


@pytest.fixture
def study(tmp_path: Path):
    """Write a study file."""

    def write(text: str = STUDY, count: int = 16) -> Path:
        path = tmp_path / "mine.yaml"
        path.write_text(text.replace("COUNT", str(count)), encoding="utf-8")
        return path

    return write


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Call the command line: exit code and everything it prints."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str]:
        result = CliRunner().invoke(main, list(map(str, arguments)))
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output

    return run


def test_a_sweep_tells_percentiles_and_results_and_ends_with_0(study, call, tmp_path):
    code, text = call("sweep", study(), "--workers", 0)
    assert code == 0, text
    assert "32 of 32 impacts evaluated" in text
    assert "front" in text and "left" in text and "95 % interval" in text
    assert len(parquet.read_table(tmp_path / "mine.results" / "results.parquet")) == 32


def test_a_failed_impact_gives_1_and_its_reason(study, call, tmp_path):
    (tmp_path / "filtered.yaml").write_text(
        "title: mine\nlimits: {peak_g_cfc1000: {max: 275.0, source: mine, verified: false}}\n"
    )
    # Samples of 1 ms are too coarse for the filter that this standard needs.
    text = STUDY.replace("front, left]", "front], sim.time_step: [5.0e-5, 1.0e-3]")
    text = text.replace("0.008", "0.02") + "standard: filtered.yaml\n"
    code, text = call("sweep", study(text), "--workers", 0)
    assert code == 1, text
    assert "too coarse" in text and "16 of 32 impacts evaluated" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing_like_it"], "population_oblique"),
        (["mine.yaml", "-o", "impact.fricton=0.3"], "impact.friction"),
        (["mine.yaml", "-o", "impact.friction=9"], "from 0 to 2"),
        (["mine.yaml", "--output", "mine.yaml/out"], "cannot be written"),
        (["mine.yaml", "--workers", "1", "--scheduler", "tcp://x:1"], "exclude each other"),
    ],
)
def test_bad_input_ends_with_2_before_the_first_impact(study, call, tmp_path, arguments, message):
    study()
    code, text = call("sweep", *arguments)
    assert code == 2, text
    assert message in text
    assert not list(tmp_path.rglob("*.parquet"))


def test_foreign_results_end_with_2(study, call, tmp_path):
    assert call("sweep", study(), "--workers", 0)[0] == 0
    code, text = call("sweep", study(count=32), "--workers", 0)
    assert code == 2, text
    assert "another study" in text


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, 1)])
def test_a_sweep_that_is_ended_goes_on_where_it_was(study, tmp_path, signum, code):
    total = 512  # a second or more of work, so that the signal comes in the middle
    path = study(count=total // 2)
    process = subprocess.Popen(
        [sys.executable, "-m", "helmet_sim_ros", "sweep", str(path), "--workers", "0"],
        cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    rows = tmp_path / "mine.results" / "rows"
    deadline = time.monotonic() + 60.0
    try:
        while len(list(rows.glob("*.parquet"))) < 2:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)  # another process writes them: nothing tells of it
        process.send_signal(signum)
        output, _ = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == code, output
    assert code < 0 or "the same command goes on" in output
    assert "Traceback" not in output
    kept = sum(len(parquet.read_table(part)) for part in rows.glob("*.parquet"))
    assert 0 < kept < total
    result = sweep(path, tmp_path / "mine.results", workers=0)
    assert result.computed == total - kept
    assert len(set(result.table["id"].to_pylist())) == total
    assert result.failed == 0


def test_ctrl_c_of_a_terminal_ends_workers_and_sweep_with_one_line(study, tmp_path):
    path = study(count=8192)
    process = subprocess.Popen(
        [sys.executable, "-m", "helmet_sim_ros", "sweep", str(path), "--workers", "1"],
        cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        start_new_session=True,
    )  # fmt: skip
    try:
        rows = tmp_path / "mine.results" / "rows"
        deadline = time.monotonic() + 120.0
        while not list(rows.glob("*.parquet")):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)  # another process writes them: nothing tells of it
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to workers, too
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 1, output
        assert re.search(r"\d+ of 16384 impacts are kept in mine.results, the same command", output)
        assert len([line for line in output.splitlines() if line.strip()]) == 3, output
        with pytest.raises(ProcessLookupError):  # the last of them end when the first is gone
            while time.monotonic() < deadline:
                os.killpg(process.pid, 0)
                time.sleep(0.02)  # they are not our children, whose end we would be told of
    finally:  # whatever did not end
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def test_what_a_helmet_suffered_is_told_with_the_number_of_impacts(study, call, tmp_path):
    text = """
    common: {impact.rig: headform, helmet: {name: fullface, coupling: foam}, sim.duration: 0.02}
    product: {impact.normal_velocity: [3.0, 14.0, 15.0]}
    """
    code, output = call("sweep", study(text), "--workers", 0)
    assert code == 0, output
    assert "2 of 3 impacts have notes" in output
    assert "  2: the liner is crushed by … % at (…, …, …) mm, more than foam has" in output
    rows = parquet.read_table(tmp_path / "mine.results" / "results.parquet")["notes"].to_pylist()
    assert [len(notes) for notes in rows] == [0, 1, 1]


def test_the_worst_impacts_are_a_log_that_review_reads(study, call, tmp_path):
    pytest.importorskip("rclpy")
    text = STUDY + "histories: {worst: 2, by: hic}\n"
    code, output = call("sweep", study(text), "--workers", 0)
    assert code == 0, output
    log = tmp_path / "mine.results" / "histories.mcap"
    code, output = call("review", log)
    assert code == 0, output
    assert "2 complete impacts" in output
    from helmet_sim_ros import evaluate, open_log

    logged = sorted(evaluate(impact.record).hic.value for impact in open_log(log))
    kept = parquet.read_table(tmp_path / "mine.results" / "results.parquet")["hic"].to_pylist()
    assert logged == sorted(kept)[-2:]


def test_a_search_writes_helmets_and_ends_with_0(study, call, tmp_path):
    path = study(SEARCH.replace("LIMIT", "1000.0"))
    code, text = call("optimise", path, "--workers", 0)
    assert code == 0, text
    assert "8 of 8 designs meet every limit" in text and "reference" in text
    assert list((tmp_path / "mine.optimisation" / "designs").glob("design_*.yaml"))


def test_a_search_without_a_design_that_meets_the_limits_ends_with_1(study, call, tmp_path):
    path = study(SEARCH.replace("LIMIT", "10.0"))
    code, text = call("optimise", path, "--workers", 0)
    assert code == 1, text
    assert "no design meets every limit" in text and "worst peak_g by" in text


def test_a_limit_that_no_design_can_meet_ends_with_2(study, call, tmp_path):
    path = study(SEARCH.replace("LIMIT", "100.0").replace("worst peak_g", "liner_mass", 1)
                 .replace("at_most: 100.0", "at_most: 0.01"))  # fmt: skip
    code, text = call("optimise", path)
    assert code == 2, text
    assert "nothing in the ranges" in text
    assert not (tmp_path / "mine.optimisation").exists()


@pytest.mark.parametrize("module", ["pyarrow", "distributed"])
def test_a_missing_extra_is_named(study, tmp_path, module):
    code = (
        f"import sys; sys.modules[{module!r}] = None; from helmet_sim_ros.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "sweep", str(study())], cwd=tmp_path, text=True,
        capture_output=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1
    assert "pip install 'helmet_sim_ros[study]'" in done.stderr
