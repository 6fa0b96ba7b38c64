"""Where the package's shared files (config, launch) are, however it was installed."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from helmet_sim_ros.errors import SetupError, did_you_mean
from helmet_sim_ros.names import check_path

PACKAGE = "helmet_sim_ros"

#: Files and folders that a path may lead to; None: any (a program of the user's own).
_reach: frozenset[Path] | None = None
#: Files that paths led to before that was restricted.
_named: set[Path] = set()


@lru_cache(maxsize=1)
def share_directory() -> Path:
    """The directory that holds ``config/``: the source tree, or ``PREFIX/share/helmet_sim_ros``."""
    here = Path(__file__).resolve().parent
    for parent in here.parents:
        if (parent / "package.xml").is_file() and (parent / "config").is_dir():
            return parent
        installed = parent / "share" / PACKAGE
        if (installed / "config").is_dir():
            return installed
    raise FileNotFoundError(f"config/ of {PACKAGE} is in none of the parents of {here}")


def find_config(kind: str, name_or_path: str, key: str, suffix: str = ".yaml") -> Path:
    """The file of a shipped configuration by name, or any file by path.

    Args:
        kind: folder below ``config/`` (``helmets``, ``scenarios``, ``standards``).
        name_or_path: ``fullface``, or a path (it contains a separator or ends with the suffix).
        key: the configuration key to name in the error.

    Raises:
        SetupError: no such name (the known names are listed), or no such file.
    """
    if _reach is not None:
        check_path(key, name_or_path)
    if is_path(name_or_path, suffix):
        path = _resolved(Path(name_or_path), key)
        if not _reachable(path, kind, suffix):
            raise SetupError.of(
                key, name_or_path,
                f"must be a name in config/{kind}, or a file that the operator gave this node or "
                "named in its config_paths",
            )  # fmt: skip
        if not _is_file(path):
            raise SetupError.of(key, name_or_path, "no such file")
        if _reach is None:
            _named.add(path)
        return Path(name_or_path).expanduser()
    folder = share_directory() / "config" / kind
    path = folder / f"{name_or_path}{suffix}"
    if not _is_file(path):
        known = sorted(p.stem for p in folder.glob(f"*{suffix}"))
        allowed = f"must be one of {', '.join(known)}, or a path to a {suffix}"
        raise SetupError.of(key, name_or_path, allowed + did_you_mean(name_or_path, known))
    return path


def restrict_reach(places: Iterable[Path]) -> None:
    """From now on, let :func:`find_config` open in this process only what its operator chose.

    That is: the shipped files, files that were found before, ``places`` that are files, and files
    with the right suffix directly in ``places`` that are folders. For processes that take names
    from others, as every node does.
    """
    global _reach
    _reach = frozenset(_resolved(place, "config_paths") for place in places) | _named


def is_path(name_or_path: str, suffix: str = ".yaml") -> bool:
    """Whether a name is a path, not the name of a shipped file."""
    return "/" in name_or_path or name_or_path.endswith(suffix)


def _reachable(path: Path, kind: str, suffix: str) -> bool:
    if _reach is None or path in _reach or path.parent == share_directory() / "config" / kind:
        return True
    return path.parent in _reach and path.suffix == suffix


def _resolved(path: Path, key: str) -> Path:
    try:
        return path.expanduser().resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, no such user, a null character
        raise SetupError.of(key, str(path), "no such file") from None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name longer than any that there is, or a folder that is closed to us
        return False
