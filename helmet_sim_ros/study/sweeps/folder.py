"""A folder that belongs to one study: locked while it is used, and never mixed with another's."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path

from helmet_sim_ros.errors import SetupError, StudyError

TEMPORARY = ".part"


class StudyFolder:
    """The results folder of a study.

    Attributes:
        path: where it is.
    """

    def __init__(self, path: Path, identity: Mapping[str, str], note: Mapping[str, object]) -> None:
        """Open it, or create it.

        Args:
            identity: what decides the results, each part as a digest.
            note: further plain data for ``study.json``, for a reader.

        Raises:
            SetupError: it holds results of another study, another process uses it, or it cannot
                be written.
        """
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = open(path / ".lock", "w")  # noqa: SIM115 - held until close()
        except OSError as error:
            raise SetupError.of("output", str(path), f"cannot be written: {error}") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._take(identity, note)
        except BlockingIOError:
            self.close()
            raise SetupError.of(
                "output", str(path), "another process is writing results there"
            ) from None
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> StudyFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others use the folder."""
        self._lock.close()

    def write(self, path: Path, write: Callable[[Path], object]) -> None:
        """Write a file under a temporary name, and give it its own once it is on the disk.

        Raises:
            StudyError: that fails; everything written before stays.
        """
        part = path.with_name(path.name + TEMPORARY)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write(part)
            with open(part, "rb") as stream:
                os.fsync(stream.fileno())
            os.replace(part, path)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise StudyError(
                f"{path}: cannot be written: {error.strerror or error}; everything finished so "
                "far is kept, the same command goes on from there"
            ) from None

    def _take(self, identity: Mapping[str, str], note: Mapping[str, object]) -> None:
        for leftover in self.path.rglob(f"*{TEMPORARY}"):
            leftover.unlink()
        mark = self.path / "study.json"
        if not mark.exists():
            text = json.dumps({"identity": dict(identity), **note}, indent=1) + "\n"
            self.write(mark, lambda to: to.write_text(text, encoding="utf-8"))
            return
        try:
            there = json.loads(mark.read_text(encoding="utf-8"))["identity"]
            other = [key for key, digest in identity.items() if there.get(key) != digest]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise SetupError.of("output", str(mark), f"cannot be read: {error!r}") from None
        if other:
            raise SetupError.of(
                "output", str(self.path),
                f"holds results of another study: other {', '.join(other)}; choose another place",
            )  # fmt: skip
