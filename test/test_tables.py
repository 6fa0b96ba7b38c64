"""The tables of the documents, and the result that README.md shows, are what the code says."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

pytest.importorskip("rclpy", reason="the tables describe nodes")

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "docs/interface.md", "docs/files.md", "docs/ros.md")


@pytest.fixture(scope="module")
def tables() -> ModuleType:
    """docs/make_tables.py, which writes them."""
    spec = importlib.util.spec_from_file_location("make_tables", ROOT / "docs" / "make_tables.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES[::-1])
def test_the_tables_are_what_the_code_says(tables: ModuleType, page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert tables.rewritten(text) == text, "run `python docs/make_tables.py`"


def test_every_page_with_a_table_is_written(tables: ModuleType) -> None:
    marked = {path for path in (ROOT / "docs").glob("*.md") if "<!-- table: " in path.read_text()}
    assert marked | {ROOT / "README.md"} == {ROOT / page for page in PAGES} == set(tables.FILES)


def test_every_folder_of_configuration_is_named_with_its_keys() -> None:
    page = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    kinds = {path.parent.name for path in (ROOT / "config").glob("*/*.yaml")}
    assert {kind for kind in kinds if f"`config/{kind}`" not in page} == set()
