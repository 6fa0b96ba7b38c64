"""README.md says what the code does: commands, examples, scenarios, links."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import click

from helmet_sim_ros.cli import main
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_scenario

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_every_command_that_is_shown_parses():
    shown = re.findall(r"^(helmet-sim .*)$", "\n".join(blocks("bash")), re.MULTILINE)
    assert len(shown) >= 3
    for text in shown:
        words = shlex.split(text, comments=True)[1:]
        command: click.Command = main
        context = click.Context(main)
        while isinstance(command, click.Group) and words:
            found = command.get_command(context, words.pop(0))
            assert found is not None, text
            command = found
        command.make_context(command.name, words, resilient_parsing=False)


def test_the_python_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    examples = blocks("python")
    assert len(examples) == 2
    for example in examples:
        exec(compile(example, "README.md", "exec"), {})
    assert capsys.readouterr().out.count("\n") == 7


def test_the_scenario_example_loads(tmp_path):
    (example,) = blocks("yaml")
    path = tmp_path / "example.yaml"
    path.write_text(example)
    assert len(load_scenario(path).cases) == 6


def test_every_shipped_scenario_is_listed_with_its_size():
    for path in (share_directory() / "config" / "scenarios").glob("*.yaml"):
        count = len(load_scenario(path.stem).cases)
        assert re.search(rf"\| `{path.stem}` \| {count} \|", README), path.stem


def test_files_that_are_linked_exist():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert "://" in target or (ROOT / target).exists(), target
