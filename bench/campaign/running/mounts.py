"""Disks of our own: small ones, and folders that nobody can write to."""

from __future__ import annotations

import subprocess
from pathlib import Path

from bench.campaign.attack import Impossible


def small_disk(folder: Path, size: int) -> None:
    """Mount an empty disk of so many bytes.

    Raises:
        Impossible: this process may not mount.
    """
    _mount("-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder))


def read_only(folder: Path) -> None:
    """Mount a folder read-only over itself: the only way that holds for root, too.

    Raises:
        Impossible: this process may not mount.
    """
    _mount("--bind", str(folder), str(folder))
    _mount("-o", "remount,ro,bind", str(folder))


def unmount(folder: Path) -> None:
    """Undo one of these; nothing if there is none."""
    # Not Path.is_mount(), which takes a folder that is mounted over itself for none.
    mounted = [line.split()[1] for line in Path("/proc/self/mounts").read_text().splitlines()]
    if str(folder.resolve()) in mounted:
        subprocess.run(["umount", str(folder)], check=True)


def _mount(*options: str) -> None:
    try:
        subprocess.run(["mount", *options], check=True, capture_output=True, text=True)
    except OSError as error:
        raise Impossible(f"mount: {error.strerror}") from None
    except subprocess.CalledProcessError as error:
        raise Impossible(error.stderr.strip()) from None
