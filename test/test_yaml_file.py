"""YAML files: what they may hold, what they may cost, and what an error says of them."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.yaml_file import DEEPEST, LARGEST, MOST_VALUES, parse_yaml, read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


def test_numbers_and_text_are_what_a_user_means() -> None:
    text = "{a: 2e-5, b: -.5E+3, c: 1, d: true, e: 2001-01-01, f: [1, ~], g: '2e-5'}"
    assert parse_yaml(text) == {
        "a": 2e-5, "b": -500.0, "c": 1, "d": True, "e": "2001-01-01", "f": [1, None], "g": "2e-5",
    }  # fmt: skip
    assert parse_yaml("a: &x [1, 2]\nb: *x\nc: {<<: {d: 1}}") == {
        "a": [1, 2], "b": [1, 2], "c": {"d": 1},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, f"more than {MOST_VALUES} values"),
        ("[" + "1," * MOST_VALUES + "]", f"more than {MOST_VALUES} values"),
        ("[" * (DEEPEST + 1), f"nested deeper than {DEEPEST} levels"),
        ("[" * 20_000 + "]" * 20_000, "nest"),
        ("\n".join(" " * i + "a:" for i in range(500)), f"nested deeper than {DEEPEST} levels"),
        ("a: &a [1, *a]", "*a stands inside itself in line 1, column 11"),
        ("a: &a {<<: *a}", "*a stands inside itself"),
        ("x" * (LARGEST + 1), f"larger than {LARGEST} bytes"),
        ("a: 1\na: 2", "key 'a' is given twice in line 2, column 1"),
        ("a: !!python/object:os.system x", "python/object:os.system"),
        ("a: !!binary ab", "binary"),
        ("a: !!timestamp 2001-99-99", "timestamp"),
        ("a: !!int x", "not a value of type int in line 1, column 4"),
        ("a: !!float x", "not a value of type float"),
        ("a: !!bool x", "not a value of type bool"),
        ("a: 0b_", "not a value of type int"),
        ("a: " + "9" * 5000, "not a value of type int"),
        ("1: 2", "a key must be text, quote 1"),
        ("? [a]\n: b", "a key must be a single value"),
        ("a: =", "value"),
        ("--- a\n--- b", "another document"),
        ("a: \0", "character"),
        ("a: \ud800", "surrogates"),
    ],
)
def test_what_no_configuration_is_gets_refused_by_its_place(text: str, words: str) -> None:
    with pytest.raises(yaml.YAMLError) as error:
        parse_yaml(text)
    assert words in str(error.value)


def test_the_largest_that_is_allowed_is_read() -> None:
    assert len(parse_yaml("[" + "1," * (MOST_VALUES - 2) + "]")) == MOST_VALUES - 2
    assert parse_yaml("[" * DEEPEST + "]" * DEEPEST)
    assert len(parse_yaml("a: " + "x" * (LARGEST - 3))["a"]) == LARGEST - 3


def test_a_bomb_costs_neither_time_nor_memory(tmp_path: Path) -> None:
    """In a process of its own with little memory; the expanded bomb would need gigabytes."""
    path = tmp_path / "bomb.yaml"
    path.write_text(BOMB)
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_DATA, (2**29, 2**29))\n"
        "from helmet_sim_ros.errors import SetupError\n"
        "from helmet_sim_ros.yaml_file import read_yaml\n"
        "from pathlib import Path\n"
        f"try: read_yaml(Path({str(path)!r}), 'helmet')\n"
        "except SetupError: print('refused')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "refused\n", done.stderr


def test_a_file_without_an_end_is_not_read_to_its_end() -> None:
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(SetupError, match="larger than"):
        read_yaml(Path("/dev/zero"), "helmet")
    assert time.process_time() - began < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def test_an_error_quotes_nothing_of_a_file_that_is_no_configuration(tmp_path: Path) -> None:
    secrets = ["pass word", "- pass word", "'pass word", "a: {pass word", "", "a: b: pass word",
               "%pass word", "pass word: [\n"]  # fmt: skip
    for number, secret in enumerate(secrets):
        path = tmp_path / f"{number}.yaml"
        path.write_text(secret + "\n")
        with pytest.raises(SetupError) as error:
            ImpactSetup(helmet=str(path))
        assert "pass word" not in str(error.value) and str(path) in str(error.value)


@pytest.mark.parametrize("name", ["a" * 300, "a" * 300 + ".yaml", "x\0.yaml", "~nobody_at_all/x",
                                  "/dev/null", "../" * 2000 + "x", "."])  # fmt: skip
def test_a_name_that_no_file_has_is_refused_by_name(name: str) -> None:
    with pytest.raises(SetupError):
        ImpactSetup(helmet=name)


def test_an_error_moves_no_cursor(tmp_path: Path) -> None:
    path = tmp_path / "a\u202eb.yaml"
    path.write_text('"a\\e[2Jb": 1')
    with pytest.raises(SetupError) as error:
        ImpactSetup(helmet=str(path))
    assert str(error.value).isprintable()
    assert "a\\x1b[2Jb" in str(error.value)
