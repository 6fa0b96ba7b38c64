"""Compiled functions, cached by the content of all sources that they are built from.

Numba keys a cached function by the file that holds it, not by the files of the functions it calls:
an edited constant would leave its callers' old machine code in use. Here the cache folder carries
a digest of every source of this package's model, so edited sources never meet old machine code.
The place and the dates of the sources do not count: copies of one version share what they compile.
Processes that need the same function at the same time compile it once: the others wait for it.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TextIO, TypeVar

import numba
import numba.core.config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime.nrt import rtsys

#: Numba's settings; its stubs do not know them.
config: Any = numba.core.config

F = TypeVar("F", bound=Callable[..., object])

SOURCES = Path(__file__).resolve().parent
OLD = 86400.0  # s; younger caches of other sources may be in use by running processes
PATIENCE = 600.0  # s; whoever has compiled for longer is stuck, and is no longer waited for


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
    options: dict[str, Any] = {"inline": inline, "_nrt": references}  # its stubs lack _nrt
    # numpy's division: by zero gives infinity, which the loops watch, and no branch.
    decorate: Any = numba.njit(nogil=True, error_model="numpy", **options)
    dispatcher = decorate(function)
    dispatcher._cache = Shared(function)  # what njit(cache=True) does, with numba's own cache
    return dispatcher  # type: ignore[no-any-return]


class ByContent:
    """Where numba keeps a function's machine code: a subfolder of :func:`cache_folder` per module.

    The methods are those that numba asks a locator for.
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


class _Located(CompileResultCacheImpl):
    _locator_classes = [ByContent]  # noqa: RUF012 - as numba has it


class Shared(FunctionCache):
    """Numba's cache of a function, for processes side by side.

    Numba alone lets each of them compile the same, and of two that save different signatures of one
    function, one may later be given the other's machine code: both choose the same file name.
    The locks are the operating system's: they end with the process that holds them.
    """

    _impl_class = _Located

    def __init__(self, function: Callable[..., object]) -> None:
        """Of a function."""
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._compiling: dict[Any, TextIO] = {}

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is on disk. If there is nothing, this process compiles it, or waits until another
        has done so."""
        found = self._on_disk(sig, target_context)
        if found is None and sig not in self._compiling:
            self._compiling[sig] = self._locked(hashlib.sha256(str(sig).encode()).hexdigest()[:16])
            found = self._on_disk(sig, target_context)
            if found is not None:
                self._compiling.pop(sig).close()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write what was compiled, and let those who wait go on."""
        with self._locked("index"):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        if sig in self._compiling:
            self._compiling.pop(sig).close()

    def _on_disk(self, sig: Any, target_context: Any) -> Any:
        """As numba's own, without first making all known that can be compiled: machine code needs
        the functions that count references, and no more. Whoever compiles does so itself."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]

    def _locked(self, what: str) -> TextIO:
        """An open file whose lock this process has until it is closed."""
        self._impl.locator.ensure_cache_path()
        name = f"{self._impl.filename_base}.{what}.lock"
        file = Path(self.cache_path, name).open("w")  # noqa: SIM115 - open: this is the lock
        give_up = time.monotonic() + PATIENCE
        while time.monotonic() < give_up:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.02)  # flock has no time-out of its own
            except OSError:  # a file system without locks
                break
        return file


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
