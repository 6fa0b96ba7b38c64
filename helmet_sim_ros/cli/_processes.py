"""The four nodes, in processes of their own or in this one; they never outlive the command."""

from __future__ import annotations

import ctypes
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from types import FrameType, TracebackType
from typing import Any, Protocol

import yaml

from helmet_sim_ros.errors import NodeError
from helmet_sim_ros.lasting import lasting

NODES = ("simulation", "evaluator", "recorder", "scenario")

#: How long a node may take after SIGTERM before it is killed [s]; a recorder finishes its log.
PATIENCE = 10.0


@contextmanager
def termination_as_interrupt() -> Iterator[None]:
    """SIGTERM and SIGHUP unwind the stack like Ctrl-C, so that children get stopped."""

    def interrupt(signum: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    kinds = (signal.SIGTERM, signal.SIGHUP)
    before = {kind: signal.signal(kind, interrupt) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


class Nodes(Protocol):
    """The nodes while a command runs, wherever they are."""

    exit_code: int

    def __enter__(self) -> Nodes: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    def check(self) -> None:
        """Raise a :class:`NodeError` if a node has ended."""


def start_nodes(
    one_process: bool,
    parameters: Mapping[str, Mapping[str, Any]],
    remaps: Mapping[str, Mapping[str, str]] | None = None,
    quiet: bool = True,
) -> Nodes:
    """The nodes, to be entered: as threads of this process, or as four processes.

    Args:
        one_process: in this process.
        parameters, remaps, quiet: see :class:`NodeProcesses`.

    Raises:
        MissingExtraError: no ROS 2 Python client is installed.
    """
    if not one_process:
        return NodeProcesses(parameters, remaps, quiet)
    with lasting():
        from helmet_sim_ros.nodes.one_process import OneProcess

    return OneProcess(parameters, remaps, quiet)


class NodeProcesses:
    """Starts the nodes on entry and stops them, whatever happened, on exit.

    Args:
        parameters: node name -> parameter name -> value.
        remaps: node name -> name in the node -> name outside.
        quiet: write what the nodes say to a file that errors quote, not to the terminal.

    Attributes:
        exit_code: of this process; not needed here, where no middleware runs in it.
    """

    exit_code = 1

    def __init__(
        self,
        parameters: Mapping[str, Mapping[str, Any]],
        remaps: Mapping[str, Mapping[str, str]] | None = None,
        quiet: bool = True,
    ) -> None:
        self._parameters = parameters
        self._remaps = remaps or {}
        self._quiet = quiet
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._output = ExitStack()
        self._folder = self._output.enter_context(claimed_folder())

    def __enter__(self) -> NodeProcesses:
        try:
            for name in NODES:
                self._start(name)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def check(self) -> None:
        """Raise a :class:`NodeError` if a node has ended, with the last lines it wrote."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise NodeError(
                    f"the {name} node ended with exit code {process.returncode}{self._said(name)}"
                )

    def stop(self) -> None:
        """End every node: SIGTERM, then SIGKILL; safe to call again.

        Not SIGINT: Python catches that before the node does, and may lose it while it starts.
        """
        try:
            self._signal(signal.SIGTERM)
            self._wait(PATIENCE)
        finally:  # also when the user presses Ctrl-C once more
            self._signal(signal.SIGKILL)
            self._wait(None)
            self._running.clear()
            self._output.close()

    def _start(self, name: str) -> None:
        settings = self._folder / f"{name}.yaml"
        values = {"/**": {"ros__parameters": dict(self._parameters.get(name, {}))}}
        settings.write_text(yaml.safe_dump(values), encoding="utf-8")
        output = None
        if self._quiet:
            output = self._output.enter_context(settings.with_suffix(".txt").open("wb"))
        arguments = ["--ros-args", "--params-file", str(settings)]
        for inside, outside in self._remaps.get(name, {}).items():
            arguments += ["-r", f"{inside}:={outside}"]
        self._running[name] = subprocess.Popen(
            [sys.executable, "-m", f"helmet_sim_ros.nodes.{name}_node", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output and subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C reaches the nodes through stop(), in its order
            preexec_fn=end_with_parent(),
        )  # fmt: skip

    def _wait(self, seconds: float | None) -> None:
        """Until every node has ended, or the time is up."""
        deadline = None if seconds is None else time.monotonic() + seconds
        for process in self._running.values():
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            with suppress(subprocess.TimeoutExpired):
                process.wait(left)

    def _signal(self, kind: signal.Signals) -> None:
        for process in self._running.values():
            if process.poll() is None:
                os.killpg(process.pid, kind)

    def _said(self, name: str) -> str:
        if not self._quiet:
            return ""
        text = (self._folder / f"{name}.txt").read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip()][-3:]
        return ": " + " | ".join(lines) if lines else ""


#: Temporary folders of ours begin so; a lock in them is held as long as their owner lives.
FOLDER_PREFIX, FOLDER_LOCK = "helmet-sim-", ".owner"


@contextmanager
def claimed_folder() -> Iterator[Path]:
    """A temporary folder that is gone afterwards; those of killed processes are removed as well."""
    remove_abandoned_folders()
    with TemporaryDirectory(prefix=FOLDER_PREFIX) as name:
        begun = Path(name, "begun")
        with open(begun, "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            begun.rename(Path(name, FOLDER_LOCK))  # never there without its lock
            yield Path(name)


def remove_abandoned_folders() -> None:
    """Remove our user's temporary folders whose owner was killed before it could."""
    for folder in Path(gettempdir()).glob(FOLDER_PREFIX + "*"):
        with suppress(OSError):  # another user's, or gone meanwhile
            if folder.is_symlink() or folder.stat().st_uid != os.geteuid():
                continue
            with open(folder / FOLDER_LOCK) as lock:  # not there yet: somebody is just making it
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder)


def end_with_parent() -> Callable[[], None] | None:
    """A ``preexec_fn`` that has the kernel end a child when this process dies, even by SIGKILL.

    None where the kernel cannot (it is Linux's).
    """
    if sys.platform != "linux":
        return None
    parent, libc = os.getpid(), ctypes.CDLL(None)

    def prepare() -> None:
        libc.prctl(1, signal.SIGTERM)  # 1: PR_SET_PDEATHSIG
        if os.getppid() != parent:  # it died before the kernel knew
            os._exit(1)

    return prepare
