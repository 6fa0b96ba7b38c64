"""MkDocs hook: a page that the navigation names and that does not exist yet has no entry."""

from __future__ import annotations

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig

#: Pages that may be missing; any other missing page ends a strict build.
OPTIONAL = frozenset({"architecture.md", "explore.md"})


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Take out the entries of missing optional pages."""
    config.nav = _kept(config.nav, Path(config.docs_dir))
    return config


def _kept(entry: object, folder: Path) -> object:
    if isinstance(entry, list):
        return [item for item in (_kept(item, folder) for item in entry) if item is not None]
    if isinstance(entry, dict):
        found = {name: _kept(value, folder) for name, value in entry.items()}
        return {name: value for name, value in found.items() if value is not None} or None
    missing = entry in OPTIONAL and not (folder / str(entry)).exists()
    return None if missing else entry
