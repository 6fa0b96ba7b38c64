"""Compiled functions, cached by the content of all sources that they are built from.

Numba keys a cached function by the file that holds it, not by the files of the functions it calls:
an edited constant would leave its callers' old machine code in use. Here the cache folder carries
a digest of every source of this package's model, so edited sources never meet old machine code.
The place and the dates of the sources do not count: copies of one version share what they compile.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar

import numba
import numba.core.config

#: Numba's settings; its stubs do not know them.
config: Any = numba.core.config

F = TypeVar("F", bound=Callable[..., object])

SOURCES = Path(__file__).resolve().parent
OLD = 86400.0  # s; younger caches of other sources may be in use by running processes


def compiled(function: F) -> F:
    """Decorator: compile at first call, without the interpreter lock, cached on disk.

    The function makes no arrays (numba refuses to compile one that does): it then counts no
    references to those it is given, which took a third of the time of all forces together.
    """
    return _compiled(function, "never")


def allocating(function: F) -> F:
    """Decorator: as :func:`compiled`, for a function that makes arrays."""
    return _compiled(function, "never", references=True)


def inlined(function: F) -> F:
    """Decorator: as :func:`compiled`, written into the functions that call it. For small functions
    of the innermost loops that take or return many numbers: a call costs more than they do."""
    return _compiled(function, "always")


def _compiled(function: F, inline: Literal["never", "always"], references: bool = False) -> F:
    before = config.CACHE_LOCATOR_CLASSES
    config.CACHE_LOCATOR_CLASSES = f"{__name__}.{ByContent.__name__}"
    try:
        options: dict[str, Any] = {"inline": inline, "_nrt": references}  # its stubs lack _nrt
        # numpy's division: by zero gives infinity, which the loops watch, and no branch.
        decorate: Any = numba.njit(cache=True, nogil=True, error_model="numpy", **options)
        return decorate(function)  # type: ignore[no-any-return]
    finally:
        config.CACHE_LOCATOR_CLASSES = before


class ByContent:
    """Where numba keeps a function's machine code: a subfolder of :func:`cache_folder` per module.

    The methods are those that numba asks a locator for (``NUMBA_CACHE_LOCATOR_CLASSES``).
    """

    def __init__(self, function: Callable[..., object], source: str) -> None:
        """Of a function in a source file."""
        self._line, self._py_file = function.__code__.co_firstlineno, source  # numba warns of it
        path = Path(source).resolve()
        self._stamp = ""  # the folder tells the content of every source of the model
        if path.is_relative_to(SOURCES):
            self._module = path.relative_to(SOURCES).with_suffix("")
        else:
            self._stamp = hashlib.sha256(path.read_bytes()).hexdigest()
            self._module = Path("elsewhere", hashlib.sha256(str(path).encode()).hexdigest()[:16])

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> ByContent:
        """The locator of a function in a source file."""
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        """Make the folder."""
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """The folder of the function's machine code."""
        return str(cache_folder() / self._module)

    def get_source_stamp(self) -> str:
        """What a change of a source outside the model changes."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Tells functions of one name apart."""
        return str(self._line)


def source_digest(folder: Path = SOURCES) -> str:
    """First 16 digits of the SHA-256 of all Python sources below a folder, names included."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


@lru_cache(maxsize=1)
def cache_folder() -> Path:
    """The folder for the machine code of the present sources: below ``NUMBA_CACHE_DIR`` if set,
    else beside the sources, else (not writable) in the user's cache."""
    root = _writable_root()
    folder = root / source_digest()
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        _drop_old(root, folder)
    return folder


def _writable_root() -> Path:
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR) / "helmet_sim_ros"
    own = SOURCES / "__pycache__" / "machine_code"
    try:
        own.mkdir(parents=True, exist_ok=True)
        probe = own / f".probe-{time.monotonic_ns()}"
        probe.touch()
        probe.unlink()
        return own
    except OSError:
        user = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        return Path(user) / "helmet_sim_ros" / "machine_code"


def _drop_old(root: Path, keep: Path) -> None:
    for other in root.iterdir():
        try:
            stale = other != keep and other.is_dir() and time.time() - other.stat().st_mtime > OLD
        except OSError:  # another process was faster
            continue
        if stale:
            shutil.rmtree(other, ignore_errors=True)
