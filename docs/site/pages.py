"""MkDocs hook: the navigation follows the pages that there are.

A page that it names and that is optional has no entry while it is missing; a page that it does not
name stands at the end of the section Explanation, under its own title.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig

#: Pages that may be missing; any other missing page ends a strict build.
OPTIONAL = frozenset({"architecture.md"})
#: Where pages go that the navigation does not name.
SECTION = "Explanation"


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Take out the entries of missing optional pages, and add those of unnamed ones."""
    folder = Path(config.docs_dir)
    if config.nav is None:  # then MkDocs lists all pages by itself
        return config
    named = set(_pages(config.nav))
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*.md")}
    for entry in config.nav:
        if isinstance(entry, dict) and SECTION in entry:
            entry[SECTION] += sorted(there - named)
    config.nav = _kept(config.nav, OPTIONAL - there)
    return config


def _pages(entry: object) -> Iterator[str]:
    """Every page that a part of the navigation names."""
    if isinstance(entry, str):
        yield entry
    parts = entry.values() if isinstance(entry, dict) else entry if isinstance(entry, list) else ()
    for part in parts:
        yield from _pages(part)


def _kept(entry: object, missing: frozenset[str]) -> object:
    if isinstance(entry, list):
        return [item for item in (_kept(item, missing) for item in entry) if item is not None]
    if isinstance(entry, dict):
        found = {name: _kept(value, missing) for name, value in entry.items()}
        return {name: value for name, value in found.items() if value is not None} or None
    return None if entry in missing else entry
