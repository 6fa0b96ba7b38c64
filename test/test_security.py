"""docs/security.md, checked: what a running system listens on, and what a killed one leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from typing import Any

import pytest
from domains import claim_domain

pytest.importorskip("rclpy", reason="no ROS 2 Python client is installed")

DOMAIN = claim_domain()
STUDY = """
common: {impact.rig: headform, sim.duration: 0.04}
draw: {count: 4096, values: {impact.normal_velocity: {uniform: [3.0, 8.0]}}}
"""


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    """Start helmet-sim as a user does who has set nothing; what is left at the end is killed."""
    started: list[subprocess.Popen[bytes]] = []
    clean = {
        k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "FASTRTPS", "FASTDDS"))
    }

    def begin(*arguments: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", "helmet_sim_ros", *arguments], cwd=tmp_path,
            env=clean | {"ROS_DOMAIN_ID": str(DOMAIN), "TMPDIR": str(tmp_path)},
            stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT,
        )  # fmt: skip
        started.append(process)
        return process

    yield begin
    for process in started:
        for pid in [*family(process.pid), process.pid]:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()


def family(pid: int) -> list[int]:
    """The processes that a process started, and those that these started."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *family(child)]
    return found


def listening(pids: list[int]) -> dict[int, list[IPv4Address | IPv6Address]]:
    """Process -> the local addresses of its sockets that take something from outside."""
    owners = {}
    for pid in pids:
        folder = Path(f"/proc/{pid}/fd")
        for descriptor in folder.iterdir() if folder.exists() else ():  # it may have ended
            try:
                target = os.readlink(descriptor)
            except OSError:
                continue
            if target.startswith("socket:["):
                owners[target[8:-1]] = pid
    found: dict[int, list[IPv4Address | IPv6Address]] = {pid: [] for pid in pids}
    for kind in ("tcp", "tcp6", "udp", "udp6", "udplite", "udplite6", "raw", "raw6"):
        path = Path("/proc/net", kind)
        for line in path.read_text().splitlines()[1:] if path.exists() else ():
            fields = line.split()
            closed_to_others = kind.startswith("tcp") and fields[3] != "0A"  # 0A: TCP_LISTEN
            if fields[9] in owners and not closed_to_others:
                found[owners[fields[9]]].append(address(fields[1].partition(":")[0]))
    return found


def address(text: str) -> IPv4Address | IPv6Address:
    """An address as ``/proc/net`` writes it: words in the byte order of this machine."""
    words = [int(text[i : i + 8], 16).to_bytes(4, sys.byteorder) for i in range(0, len(text), 8)]
    found = ip_address(b"".join(words))
    return getattr(found, "ipv4_mapped", None) or found


def until(ready: Callable[[], Any], seconds: float = 300.0) -> Any:
    deadline = time.monotonic() + seconds
    while not (found := ready()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.2)
    return found


def up(process: subprocess.Popen[bytes]) -> list[int]:
    """The four nodes, once each of them has sockets."""
    pids = family(process.pid)
    assert process.poll() is None
    return pids if len(pids) == 4 and all(listening(pids).values()) else []


def test_nothing_but_the_loopback_interface_is_listened_on(
    start: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    """The sockets were bound to all interfaces, although the README spoke of this host only."""
    (tmp_path / "study.yaml").write_text(STUDY)
    system = start("up")
    nodes = until(lambda: up(system))
    sweep = start("sweep", "study.yaml", "--workers", "2")

    def working() -> dict[int, list[IPv4Address | IPv6Address]]:
        assert sweep.poll() is None
        told = listening([sweep.pid, *family(sweep.pid)])
        return told if sum(map(bool, told.values())) >= 3 else {}

    found = listening(nodes) | until(working)
    sockets = [local for addresses in found.values() for local in addresses]
    assert len(sockets) >= 4 * 3 + 3 and all(local.is_loopback for local in sockets), found


def test_a_killed_system_leaves_no_shared_memory_and_no_folder(
    start: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    """233 files in /dev/shm and 4 temporary folders were left after some dozen kills."""
    first = start("up")
    nodes = until(lambda: up(first))
    for pid in nodes:  # nothing is mapped, so nothing can be left
        assert "/dev/shm/fast" not in Path(f"/proc/{pid}/maps").read_text()
    (folder,) = tmp_path.glob("helmet-sim-*")
    for pid in [first.pid, *nodes]:
        os.kill(pid, signal.SIGKILL)
    first.wait()
    assert folder.exists()
    second = start("up")
    until(lambda: up(second))
    (other,) = tmp_path.glob("helmet-sim-*")
    assert other != folder
    assert tempfile.gettempdir() != str(tmp_path)  # else this test would clean up after others
