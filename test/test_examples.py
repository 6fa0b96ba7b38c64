"""The examples run as a user runs them, and say what they promise to."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def run(name: str, folder: Path, *arguments: str) -> str:
    """What an example prints, started in a folder of its own."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *arguments],
        cwd=folder, capture_output=True, text=True, check=False, timeout=240,
        env=os.environ | {"PYTHONPATH": str(EXAMPLES.parent), "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def is_picture(path: Path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 5000


def test_the_first_impact_prints_its_criteria_and_draws_them(tmp_path):
    pytest.importorskip("matplotlib", reason="the figure needs the extra 'report'")
    printed = run("first_impact.py", tmp_path)
    assert "refused: normal_velocity = 50.0: must be a number from above 0 to 30 m/s" in printed
    assert re.search(r"peak_g +[\d.]+ g +limit 275 +pass", printed)
    assert is_picture(tmp_path / "first_impact.png")


def test_the_liner_study_finds_that_a_thicker_liner_is_better_and_softer(tmp_path):
    pytest.importorskip("matplotlib", reason="the figure needs the extra 'report'")
    printed = run("liner_study.py", tmp_path)
    found = re.findall(r"(\d+) mm: least at (\d+) kg/m³ with (\d+) g", printed)
    density, peak = [int(d) for _, d, _ in found], [int(g) for _, _, g in found]
    assert len(found) == 6
    assert peak == sorted(peak, reverse=True) and density == sorted(density, reverse=True)
    assert is_picture(tmp_path / "liner_study.png")


def test_a_log_is_read_and_judged_by_another_standard(tmp_path):
    pytest.importorskip("rclpy", reason="the log is written by the recorder's session")
    from logs import write_log

    from helmet_sim_ros import ImpactSetup, evaluate

    (tmp_path / "logs").mkdir()
    setup = ImpactSetup(rig="headform", normal_velocity=7.5, duration=0.02)
    (record,) = write_log(tmp_path / "logs" / "drop.mcap", [setup])
    printed = run("read_a_log.py", tmp_path)
    assert "drop.mcap: complete impacts: 1, incomplete: 0" in printed
    assert f"logged {evaluate(record).peak_g.value:.0f} g" in printed
    judged = evaluate(record, "ece_r22_06_linear_medium")
    assert f"{judged.title}: {judged.verdict}" in printed and judged.messages[0] in printed


def test_a_measured_pulse_is_judged_by_ece_r22_06(tmp_path):
    printed = run("measured_pulse.py", tmp_path)
    assert re.search(r"peak_g_cfc1000 +\S+ g +limit 275 +pass", printed)
    assert "linear impact at 7.5 m/s: pass" in printed and "compares numbers" not in printed
    shipped = (EXAMPLES / "headform_drop.csv").read_text()
    harder = tmp_path / "harder.csv"
    harder.write_text(
        re.sub(r"(?m)^([\d.]+),(-?\d)", r"\1,\g<2>", shipped).replace("[g]", "[m/s^2]")
    )
    printed = run("measured_pulse.py", tmp_path, str(harder), "5")
    assert "compares numbers, it is not a result of that test" in printed


def test_the_small_search_finds_a_lighter_liner_and_goes_on_where_it_was(tmp_path):
    pytest.importorskip("optuna", reason="a search needs the extra 'study'")
    printed = run("optimise_liner.py", tmp_path)
    assert "40 designs, 40 of them computed now" in printed
    rows = re.findall(r"^(reference|\d{4}) +([\d.]+) +(\d+) +(\d+)", printed, re.MULTILINE)
    reference, *best = [(float(mass), int(peak)) for _, mass, peak, _ in rows]
    assert min(mass for mass, _ in best) < reference[0]
    assert is_picture(tmp_path / "liner.optimisation" / "pareto.png")
    assert "40 designs, 0 of them computed now" in run("optimise_liner.py", tmp_path)


def test_every_example_is_listed():
    listed = set(re.findall(r"\[(\w+\.py)\]", (EXAMPLES / "README.md").read_text()))
    assert listed == {path.name for path in EXAMPLES.glob("*.py")}
