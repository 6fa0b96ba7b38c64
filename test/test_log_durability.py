"""What a recorder told as on disk can be read again, wherever its process was killed."""

from __future__ import annotations

import gc
import io
import os
import signal
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

from impacts import Impacts, session

from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import open_log, writer
from helmet_sim_ros.mcap_log.recover import recover


@pytest.fixture(scope="module")
def impacts() -> Impacts:
    return Impacts()


class Killer:
    """Kills this process before one of the calls that change what is on disk."""

    def __init__(self, call: int) -> None:
        self._left = call

    def before(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any) -> Any:
            if self._left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            self._left -= 1
            return function(*arguments)

        return wrapped


def killed_at(call: int, path: Path, impacts: Impacts, count: int) -> tuple[list[str], bool]:
    """Write some impacts in a process that dies before its n-th call; what it told, and whether it
    died."""
    inlet, outlet = os.pipe()
    child = os.fork()
    if child == 0:
        killer = Killer(call)

        class Raw(io.FileIO):
            @killer.before
            def write(self, data: Any) -> int:
                return super().write(data)

        writer.open = lambda name, mode: io.BufferedWriter(Raw(name, mode))  # type: ignore[attr-defined]
        os.fsync, os.replace = killer.before(os.fsync), killer.before(os.replace)  # type: ignore
        try:
            log = session(path)
            for number in range(count):
                impacts.write(log, number)
                os.write(outlet, f"test-{number}\n".encode())
            log.close()
        finally:
            os._exit(0)
    os.close(outlet)
    with os.fdopen(inlet) as told:
        ids = told.read().split()
    _, status = os.waitpid(child, 0)
    return ids, os.WIFSIGNALED(status)


def readable(path: Path, impacts: Impacts) -> Iterator[str]:
    """The impacts of a log, or of its unfinished part, that are there with their criteria."""
    part = path.with_name(path.name + writer.PART)
    if part.exists():
        path = recover(part).path
    if path.exists():
        for impact in open_log(path).impacts:
            assert same_samples(impact.record, impacts.record)
            if impact.logged is not None:
                assert impact.logged == impacts.evaluation
                yield impact.impact_id


def test_what_was_told_as_on_disk_survives_a_kill_before_every_single_write(
    impacts: Impacts, tmp_path: Path
) -> None:
    """Two impacts that the status had told as on disk were gone after a SIGKILL: a log that was
    complete, but did not have its final name yet, could not be recovered."""
    call, died = 0, True
    while died:
        path = tmp_path / f"{call}.mcap"
        told, died = killed_at(call, path, impacts, 3)
        if told:
            assert set(told) <= set(readable(path, impacts)), f"killed before call {call}"
        call += 1
    assert told == ["test-0", "test-1", "test-2"] and call > 10


def test_a_log_that_is_removed_while_it_is_written_is_an_error(
    impacts: Impacts, tmp_path: Path
) -> None:
    """Impacts were called recorded although the folder of the log had been removed."""
    folder = tmp_path / "logs"
    folder.mkdir()
    log = session(folder / "a.mcap")
    impacts.write(log, 0)
    (folder / "a.mcap.part").unlink()
    with pytest.raises(LogError, match="was removed while"):
        impacts.write(log, 1)
    (folder / "a.mcap.part").write_text("another's")  # nor is it taken for ours
    with pytest.raises(LogError, match="was removed while"):
        log.close()
    assert (folder / "a.mcap.part").read_text() == "another's"


def test_a_failed_log_without_any_impact_leaves_nothing(
    impacts: Impacts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a full disk, every impact made another empty ``.part``."""
    log = session(tmp_path / "a.mcap")
    full = OSError(28, "No space left on device")
    with monkeypatch.context() as context:
        context.setattr(log._writer._writer, "finish", raising(full))
        with pytest.raises(LogError, match="No space left"):
            log.close()
    assert list(tmp_path.iterdir()) == []
    log = session(tmp_path / "b.mcap")
    impacts.write(log, 0)
    with monkeypatch.context() as context:
        context.setattr(log._writer._writer, "finish", raising(full))
        with pytest.raises(LogError, match="No space left"):
            log.close()
    assert [path.name for path in tmp_path.iterdir()] == ["b.mcap.part"]
    assert recover(tmp_path / "b.mcap.part").impacts == 1


def raising(error: Exception) -> Callable[..., None]:
    def fail(*arguments: object) -> None:
        raise error

    return fail


def test_the_memory_of_a_log_hardly_grows_with_its_impacts(
    impacts: Impacts, tmp_path: Path
) -> None:
    """A recorder grew by about 0.1 MB with each impact, and would have been killed some day."""
    log = session(tmp_path / "a.mcap")
    tracemalloc.start()
    try:
        used = []
        for number in range(90):
            impacts.write(log, number)
            if number in (29, 89):
                gc.collect()
                used.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert (used[1] - used[0]) / 60 < 1000  # byte per impact
    assert len(open_log(log.close()).impacts) == 90
