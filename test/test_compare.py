"""Comparison of logs and the paper's figures from logs."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")
pytest.importorskip("matplotlib", reason="figures need the extra 'report'")

from click.testing import CliRunner
from logs import write_log

from helmet_sim_ros import ImpactSetup, evaluate, open_log, simulate
from helmet_sim_ros.biomech import Chatter, Rating, channel_rating, chatter
from helmet_sim_ros.cli import main
from helmet_sim_ros.report.figures.overlay import overlay_figure
from helmet_sim_ros.report.figures.paper import paper_figures
from helmet_sim_ros.report.review.compare import Change, paired

SETUPS = [
    ImpactSetup(duration=0.012, normal_velocity=v, tangential_velocity=5.0, time_step=1e-4)
    for v in (2.5, 5.0)
]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def stiffer(setup: ImpactSetup) -> ImpactSetup:
    return ImpactSetup(
        duration=setup.duration, normal_velocity=setup.normal_velocity,
        tangential_velocity=setup.tangential_velocity, time_step=setup.time_step,
        overrides={"helmet.spring.side.A": 70000.0},
    )  # fmt: skip


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    write_log(folder / "a.mcap", SETUPS)
    write_log(folder / "same.mcap", SETUPS[::-1])
    write_log(folder / "stiff.mcap", [stiffer(setup) for setup in SETUPS])
    write_log(folder / "fewer.mcap", SETUPS[:1])
    return folder


def test_the_same_impacts_in_another_order_do_not_differ(logs):
    answer = run("compare", logs / "a.mcap", logs / "same.mcap", "--tolerance", 0, "--all-criteria")
    assert answer.exit_code == 0, answer.output
    assert "no difference" in answer.output


def test_another_helmet_differs_by_what_the_simulation_says(logs):
    answer = run("compare", logs / "a.mcap", logs / "stiff.mcap", "--json", "-c", "peak_g")
    assert answer.exit_code == 1
    for row, setup in zip(json.loads(answer.output), SETUPS, strict=True):
        (change,) = row["criteria"]
        assert change["a"] == evaluate(simulate(setup)).peak_g.value
        assert change["b"] == evaluate(simulate(stiffer(setup))).peak_g.value
        assert change["differs"]
    percent = 100.0 * max(
        abs(c["b"] - c["a"]) / max(c["a"], c["b"])
        for row in json.loads(answer.output) for c in row["criteria"]
    )  # fmt: skip
    both = logs / "a.mcap", logs / "stiff.mcap", "-c", "peak_g", "--tolerance"
    assert run("compare", *both, f"{percent * 1.001:.6f}").exit_code == 0
    assert run("compare", *both, f"{percent * 0.999:.6f}").exit_code == 1


def test_histories_are_rated_and_looked_through_for_spikes(logs):
    answer = run("compare", logs / "a.mcap", logs / "same.mcap", "--json")
    for row in json.loads(answer.output):
        assert row["ratings"]["head_acceleration"]["total"] == pytest.approx(1.0)
        assert row["chatter"][0] == row["chatter"][1]
    answer = run("compare", logs / "a.mcap", logs / "stiff.mcap", "--json")
    for row, setup in zip(json.loads(answer.output), SETUPS, strict=True):
        records = simulate(setup), simulate(stiffer(setup))
        for channel, found in row["ratings"].items():
            assert Rating(**found) == channel_rating(*records, channel)
            assert found["total"] < 0.999
        for found, record in zip(row["chatter"], records, strict=True):
            acceleration = record.head_acceleration / 9.80665
            assert Chatter(**found) == chatter(acceleration, record.time_step)
    text = run("compare", logs / "a.mcap", logs / "stiff.mcap").output
    assert "ISO/TS 18571" in text and "Chatter" in text
    assert any(grade in text for grade in ("excellent", "good", "fair", "poor"))


def test_an_impact_without_counterpart_is_a_difference(logs):
    for pair in (("a", "fewer"), ("fewer", "a")):
        answer = run("compare", *(logs / f"{name}.mcap" for name in pair))
        assert answer.exit_code == 1
        assert f"missing in {'B' if pair[0] == 'a' else 'A'}" in answer.output


def test_pairs_follow_the_setup_and_not_the_order(logs):
    pairs = paired(open_log(logs / "a.mcap"), open_log(logs / "same.mcap"))
    for pair in pairs:
        name = "impact.normal_velocity"
        assert pair.a.setup[name] == pair.b.setup[name]


@pytest.mark.parametrize(
    ("a", "b", "differs"),
    [
        (1.0, 1.009, False),
        (1.0, 1.02, True),
        (0.0, 0.0, False),
        (0.0, 1e-9, True),
        (1.0, None, True),
    ],
)
def test_tolerances_are_relative_to_the_larger_value(a, b, differs):
    assert Change("x", "-", a, b, 0.01).differs == bool(differs)


def test_bad_input_is_told(logs, tmp_path):
    (tmp_path / "x.mcap").write_text("nothing")
    answer = run("compare", logs / "a.mcap", tmp_path / "x.mcap")
    assert answer.exit_code == 2 and "not an MCAP file" in answer.stderr
    answer = run("compare", logs / "a.mcap", logs / "same.mcap", "-c", "peak_k")
    assert answer.exit_code == 2 and "peak_g" in answer.stderr
    answer = run("compare", logs / "a.mcap", logs / "same.mcap", "-o", tmp_path / "x.docx")
    assert answer.exit_code == 2 and "cannot be written" in answer.stderr


def test_names_with_brackets_are_shown_as_they_are(logs, tmp_path):
    """Brackets are markup to the library that prints tables."""
    odd = tmp_path / "[bold]a[-1].mcap"
    odd.write_bytes((logs / "a.mcap").read_bytes())
    answer = run("compare", odd, logs / "same.mcap")
    assert answer.exit_code == 0 and f"A: {odd}\n" in answer.output


def test_overlays_and_figures_are_written_and_reproducible(logs, tmp_path):
    target = tmp_path / "overlay.svg"
    answer = run("compare", logs / "a.mcap", logs / "stiff.mcap", "-o", target)
    assert answer.exit_code == 1
    assert ElementTree.parse(target).getroot().tag.endswith("svg")
    names = []
    for folder in ("one", "two"):
        answer = run("figures", logs / "a.mcap", "-o", tmp_path / folder, "-f", "svg", "-f", "pdf")
        assert answer.exit_code == 0, answer.output
        names.append(sorted(path.name for path in (tmp_path / folder).iterdir()))
    assert names[0] == names[1] == ["fig7.pdf", "fig7.svg", "fig8.pdf", "fig8.svg"]
    for name in names[0]:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_an_overlay_shows_acceleration_force_and_compression_of_both(logs):
    whole = paired(*(open_log(logs / name) for name in ("a.mcap", "stiff.mcap")))
    for pairs in (whole, whole[:1]):
        axes = overlay_figure(pairs, ("soft", "stiff")).axes
        assert len(axes) == 3 * len(pairs)
        for pair, row in zip(pairs, np.reshape(axes, (-1, 3)), strict=True):
            assert row[0].get_title(loc="left") == pair.label
            assert [text.get_text() for text in row[0].get_legend().get_texts()] == [
                "soft",
                "stiff",
            ]
            assert [ax.get_ylabel() for ax in row] == [
                "head acceleration [g]", "normal ground force [kN]", "compression [mm]",
            ]  # fmt: skip
            for impact, *lines in zip((pair.a, pair.b), *(ax.lines for ax in row), strict=True):
                found = evaluate(impact.record)
                tops = [line.get_ydata().max() for line in lines]
                assert tops == pytest.approx([
                    found.peak_g.value, found.peak_normal_force.value / 1e3,
                    1e3 * found.peak_compression.value,
                ])  # fmt: skip
                assert lines[0].get_xdata()[-1] == pytest.approx(1e3 * impact.record.time[-1])
        assert {ax.get_xlabel() for ax in axes[-3:]} == {"time [ms]"}
        assert len({ax.get_xlim() for ax in axes}) == 1


def test_figures_show_the_logged_curves_in_the_papers_layout(tmp_path):
    path = tmp_path / "mixed.mcap"
    drops = [ImpactSetup(rig="headform", direction=d, normal_velocity=v, duration=0.015)
             for d in ("front", "back", "left", "top") for v in (2.5, 5.0)]  # fmt: skip
    oblique = [ImpactSetup(duration=0.012, normal_velocity=7.5, tangential_velocity=v)
               for v in (5.0, 10.0)]  # fmt: skip
    write_log(path, [*drops, *oblique])
    log = open_log(path)
    figures = paper_figures(log)
    assert list(figures) == ["fig3", "fig4", "fig5", "fig9"]
    assert [ax.get_title() for ax in figures["fig3"].axes] == ["front", "back"]
    assert [ax.get_title() for ax in figures["fig4"].axes] == ["side", "top"]
    for ax, zone in zip(figures["fig3"].axes, (drops[:2], drops[2:4]), strict=True):
        curves = [line for line in ax.lines if len(line.get_xdata()) > 1]
        peaks = [evaluate(simulate(setup)).peak_normal_force.value / 1e3 for setup in zone]
        assert [curve.get_ydata().max() for curve in curves] == pytest.approx(peaks, rel=1e-12)
    assert [len(line.get_xdata()) for line in figures["fig5"].axes[0].lines] == [2, 2, 2, 2]
    for ax, impact in zip(figures["fig9"].axes, log.impacts[-2:], strict=True):
        curve, *published = ax.lines
        assert curve.get_ydata().max() == pytest.approx(impact.logged.peak_g.value, rel=1e-12)
        assert len(published) == 3  # MB, FE, THUMS


def test_nothing_to_draw_is_told(tmp_path, logs):
    path = tmp_path / "sliding.mcap"
    write_log(path, [ImpactSetup(rig="headform", tangential_velocity=2.0, duration=0.01)])
    answer = run("figures", path, "-o", tmp_path / "figures")
    assert answer.exit_code == 2 and "no drop test" in answer.stderr
    assert not (tmp_path / "figures").exists()
    answer = run("figures", tmp_path / "missing.mcap", logs / "a.mcap", "-o", tmp_path / "figures")
    assert answer.exit_code == 2 and (Path(tmp_path) / "figures" / "fig7.svg").exists()
