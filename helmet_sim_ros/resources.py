"""Where the package's shared files (config, launch) are, however it was installed."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from helmet_sim_ros.errors import SetupError

PACKAGE = "helmet_sim_ros"


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


def is_path(value: object) -> bool:
    """Whether a configuration value is the path of a file and not a name."""
    return isinstance(value, str) and ("/" in value or value.endswith(".yaml"))


def find_config(kind: str, name_or_path: str, key: str, suffix: str = ".yaml") -> Path:
    """The file of a shipped configuration by name, or any file by path.

    Args:
        kind: folder below ``config/`` (``helmets``, ``scenarios``, ``standards``).
        name_or_path: ``fullface``, or a path (it contains a separator or ends with the suffix).
        key: the configuration key to name in the error.

    Raises:
        SetupError: no such name (the known names are listed), or no such file.
    """
    if "/" in name_or_path or name_or_path.endswith(suffix):
        path = Path(name_or_path).expanduser()
        if not path.is_file():
            raise SetupError.of(key, name_or_path, "no such file")
        return path
    folder = share_directory() / "config" / kind
    path = folder / f"{name_or_path}{suffix}"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in folder.glob(f"*{suffix}")))
        raise SetupError.of(key, name_or_path, f"must be one of {known}, or a path to a {suffix}")
    return path
