"""Ending processes, and what they leave behind."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import Any

import psutil

#: Where Fast DDS would leave its segments.
SHARED_MEMORY = Path("/dev/shm")


def shared_memory() -> set[str]:
    """Names of the segments of Fast DDS."""
    return {path.name for path in SHARED_MEMORY.iterdir() if "fast" in path.name}


def ended_by(process: subprocess.Popen[Any], kind: signal.Signals, seconds: float) -> list[str]:
    """Send a signal to a command: which of the processes that it had started do not end in time.

    They are killed then.
    """
    try:
        family = psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        family = []
    process.send_signal(kind)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        return [f"the command itself, {process.pid}"]
    _, alive = psutil.wait_procs(family, timeout=seconds)
    left = []
    for child in alive:
        try:
            if child.status() != psutil.STATUS_ZOMBIE:  # which nobody has waited for
                left.append(f"{child.pid} {' '.join(child.cmdline())}")
                child.kill()
        except psutil.NoSuchProcess:
            continue
    return left
