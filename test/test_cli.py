"""The command line: help, bad input, options. Nothing here starts a node."""

from __future__ import annotations

import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

from helmet_sim_ros.cli import Verbs, main
from helmet_sim_ros.cli import run as run_verb
from helmet_sim_ros.cli._table import criteria_table, result_table
from helmet_sim_ros.cli.call import option_name
from helmet_sim_ros.model.fall.setup import fall_leaves
from helmet_sim_ros.model.setup import setup_leaves


@pytest.fixture
def helmet_sim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Call the command line where starting a node would be a failure."""

    def forbidden(*args: object, **kwargs: object) -> None:
        raise AssertionError("nodes were started")

    monkeypatch.setattr(run_verb, "start_nodes", forbidden)
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        return CliRunner().invoke(main, list(arguments))

    return call


def rendered(table: object) -> str:
    console = Console(width=100, file=StringIO())
    console.print(table)
    return console.file.getvalue()


def test_help_lists_every_verb_with_its_first_line(helmet_sim):
    result = helmet_sim("--help")
    assert result.exit_code == 0
    verbs = Verbs().list_commands(None)
    assert {"run", "up", "call"} <= set(verbs)
    commands = result.output.partition("Commands:")[2]
    for verb in verbs:
        line = next(text for text in commands.splitlines() if text.split()[:1] == [verb])
        assert len(line.split()) > 2, f"{verb} has no description"


def test_every_verb_file_loads_and_explains_itself(helmet_sim):
    for verb in Verbs().list_commands(None):
        result = helmet_sim(verb, "--help")
        assert result.exit_code == 0, result.output
        assert "Usage:" in result.output


def test_help_imports_no_verb():
    code = (
        "import sys\n"
        "from helmet_sim_ros.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "loaded = [m for m in sys.modules if m.startswith('helmet_sim_ros.cli.')]\n"
        "assert not loaded and 'rclpy' not in sys.modules, loaded"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nope"], ["scenario = 'nope'", "oblique_table1"]),
        (["run", "missing.yaml"], ["missing.yaml", "no such file"]),
        (["run", "drop_tests", "-o", "impact.friction=-1"], ["friction = -1", "0 to 2"]),
        (["run", "drop_tests", "-o", "impact.body_angle_deg=95"], ["95", "0 to 90 deg"]),
        (["run", "drop_tests", "-o", "impact.friction=.nan"], ["nan", "0 to 2"]),
        (["run", "drop_tests", "-o", "rider.mass=0"], ["rider.mass = 0", "30 to 180 kg"]),
        (["run", "drop_tests", "-o", "helmet=bowler"], ["bowler", "fullface"]),
        (["run", "drop_tests", "-o", "impact.fiction=1"], ["impact.fiction", "unknown"]),
        (["run", "drop_tests", "-o", "impact.friction"], ["KEY=VALUE"]),
        (["run", "drop_tests", "--standard", "none"], ["standard = 'none'", "ece_r22_05"]),
        (["run", "drop_tests", "--output", "/proc/nowhere"], ["/proc/nowhere", "written"]),
        (["run", "drop_tests", "--domain-id", "400"], ["400", "232"]),
        (["run", "empty.yaml"], ["empty.yaml", "matrix is empty"]),
        (["call", "impact", "--normal-velocity", "99"], ["99", "above 0 to 30 m/s"]),
        (["call", "impact", "--normal-velocity", "fast"], ["fast", "not a valid float"]),
        (["call", "impact", "--set", "helmet.liner.density=1"], ["density = 1", "15 to 120"]),
        (["call", "impact", "--direction", "below"], ["below", "front"]),
        (["no_such_verb"], ["no_such_verb"]),
    ],
)
def test_bad_input_is_refused_in_one_line_before_anything_starts(
    helmet_sim, tmp_path, arguments, words
):
    (tmp_path / "empty.yaml").write_text("cases: []")
    result = helmet_sim(*arguments)
    assert result.exit_code == 2, result.output
    errors = [line for line in result.output.splitlines() if line.startswith("Error: ")]
    assert len(errors) == 1
    for word in words:
        assert word in errors[0]
    assert "Traceback" not in result.output


def test_a_file_in_the_place_of_the_output_directory_is_refused(helmet_sim, tmp_path):
    (tmp_path / "logs").write_text("in the way")
    result = helmet_sim("run", "drop_tests")
    assert result.exit_code == 2
    assert "--output logs" in result.output


@pytest.mark.parametrize(
    ("kind", "found", "some"),
    [
        ("impact", setup_leaves(), {"--normal-velocity", "--tangential-velocity", "--rider-mass"}),
        ("fall", fall_leaves(), {"--preset", "--scene", "--speed", "--rider-mass"}),
    ],
)
def test_every_value_of_a_setup_has_its_own_option(helmet_sim, kind, found, some):
    names = [option_name(leaf) for leaf in found]
    assert len(names) == len(set(names))
    assert some | {"--time-step"} <= set(names)
    text = helmet_sim("call", kind, "--help").output
    assert all(name in text for name in names)


def test_a_verb_whose_extra_is_missing_says_which_to_install(helmet_sim, monkeypatch):
    monkeypatch.setitem(sys.modules, "helmet_sim_ros.cli.up", None)  # ours: a mistake, not an extra
    assert isinstance(helmet_sim("up").exception, ModuleNotFoundError)
    monkeypatch.delitem(sys.modules, "helmet_sim_ros.cli.report", raising=False)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for name in [name for name in sys.modules if name.startswith("helmet_sim_ros.report")]:
        monkeypatch.delitem(sys.modules, name)
    result = helmet_sim("report", __file__)
    assert result.exit_code == 1
    assert "needs jinja2" in result.output
    assert "[ros,report,study]" in result.output


def row(**changes: object) -> dict[str, object]:
    value = {"unit": "g", "limit": 275.0, "verdict": "pass", "window": [0.001, 0.004], "time": None}
    plain = {"peak_g": value | {"value": 123.4}, "hic": value | {"value": 456.7, "unit": "-"}}
    return {
        "name": "side vn5", "status": "evaluated", "error": "", "reference": None,
        "evaluation": {"verdict": "pass", "criteria": plain, "messages": []},
    } | changes  # fmt: skip


def test_the_table_shows_published_values_beside_ours():
    reference = {"peak_g": {"MB": 113.0, "FE": 132.0}}
    text = rendered(result_table([row(reference=reference)], "title"))
    assert [word for word in text.split() if word in ("MB", "FE")] == ["MB", "FE"]
    for word in ("side vn5", "123", "113", "132", "457", "pass"):
        assert word in text


def test_a_failed_case_has_no_number_in_the_table():
    text = rendered(result_table([row(), row(name="bad", status="failed", evaluation=None)], ""))
    line = next(line for line in text.splitlines() if "bad" in line)
    assert line.split() == ["bad", "FAILED"]


def test_all_criteria_show_window_limit_and_unit():
    text = rendered(criteria_table(row()))
    for word in ("peak_g", "123.4", "1.00 to 4.00", "275", "[ms]"):
        assert word in text


def test_what_failed_is_said_in_words():
    failing = row()
    failing["evaluation"]["criteria"]["hic"]["verdict"] = "fail"
    failing["evaluation"]["messages"] = ["hic 4119 exceeds the limit", "peak_g is within"]
    ((name, evaluation),) = run_verb.judged([failing, row(status="failed", evaluation=None)])
    assert name == "side vn5"
    assert run_verb.failures(evaluation) == ["hic 4119 exceeds the limit"]
