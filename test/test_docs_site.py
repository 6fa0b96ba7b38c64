"""The documentation site builds without a warning, needs no network, and shows what works."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import click
import pytest

from helmet_sim_ros.cli import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))


def build(folder: Path, config: Path = ROOT / "mkdocs.yml") -> subprocess.CompletedProcess[str]:
    pytest.importorskip("mkdocstrings", reason="the site needs the extra 'docs'")
    pytest.importorskip("mkdocs_click", reason="the site needs the extra 'docs'")
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", config, "-d", folder],
        cwd=ROOT, capture_output=True, text=True, check=False,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = build(folder)
    assert done.returncode == 0, done.stderr
    return folder


class Loaded(HTMLParser):
    """What a browser would fetch by itself for a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source"):
            self.addresses.append(given.get("src") or "")
        if tag == "link" and given.get("rel") not in ("canonical", "prev", "next"):
            self.addresses.append(given.get("href") or "")


def test_every_page_is_built_and_fetches_nothing_from_elsewhere(site):
    assert len(list(site.rglob("*.html"))) >= len(PAGES)
    for page in site.rglob("*.html"):
        for address in Loaded(page.read_text(encoding="utf-8")).addresses:
            assert "//" not in address, (page.name, address)
    for sheet in (site / "assets" / "stylesheets").glob("*.css"):
        assert not re.search(r"url\([\"']?https?:", sheet.read_text(encoding="utf-8")), sheet.name


def test_the_reference_has_functions_commands_topics_and_parameters(site):
    def said(page):
        return re.sub(r"<[^>]+>", "", (site / page).read_text(encoding="utf-8"))

    assert "Every sample, SI units" in said("api.html")
    assert "helmet-sim report" in said("commands.html") and "--standard" in said("commands.html")
    assert "impact/samples" in said("ros.html")
    assert "impact.normal_velocity" in said("interface.html")
    assert ":class:" not in said("api.html") and ":func:" not in said("api/biomech.html")


def test_a_broken_link_and_a_bad_reference_end_the_build(tmp_path):
    (tmp_path / "docs").mkdir()
    broken = "[away](nowhere.md) [there](other.md#gone) [`x`][helmet_sim_ros.lost]"
    (tmp_path / "docs" / "index.md").write_text(f"# A page\n\n{broken}\n")
    (tmp_path / "docs" / "other.md").write_text("# Another\n")
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    config = config[: config.index("\nnav:")].replace("docs/site/", f"{ROOT}/docs/site/")
    config = config.replace("paths: [.]", f"paths: [{ROOT}]").replace("extra_css", "#")
    (tmp_path / "mkdocs.yml").write_text(config)
    done = build(tmp_path / "out", tmp_path / "mkdocs.yml")
    assert done.returncode != 0
    for name in ("nowhere.md", "gone", "helmet_sim_ros.lost"):
        assert name in done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_that_is_shown_parses(page):
    for text in _commands(page.read_text(encoding="utf-8")):
        words = shlex.split(text.rstrip("& "), comments=True)[1:]
        command: click.Command = main
        context = click.Context(main)
        while isinstance(command, click.Group) and words:
            found = command.get_command(context, words.pop(0))
            assert found is not None, text
            command = found
        try:
            command.make_context(command.name, words, resilient_parsing=False)
        except click.BadParameter as error:
            assert "does not exist" in error.message, text  # a file of the reader's


def _commands(text: str) -> list[str]:
    shown = "\n".join(re.findall(r"```bash\n(.*?)```", text, re.DOTALL))
    return re.findall(r"^(helmet-sim .*)$", shown.replace("\\\n", " "), re.MULTILINE)


@pytest.mark.parametrize("name", ["tutorial", "howto"])
def test_the_python_examples_run(name, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    for example in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(example, name, "exec"), {})
        assert capsys.readouterr().out.strip()
