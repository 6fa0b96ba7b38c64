"""How a node process ends."""

import subprocess
import sys

import pytest

HANG = """
import ctypes, sys
from helmet_sim_ros.nodes.teardown import ending_anyway
print("done")
with ending_anyway(int(sys.argv[1]), 0.2):
    # Holds the interpreter lock, as a middleware that hangs does.
    ctypes.PyDLL(None).usleep(int(float(sys.argv[2]) * 1e6))
print("after")
"""


def end(code: int, seconds: float) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HANG, str(code), str(seconds)],
        capture_output=True, text=True, timeout=30,
    )  # fmt: skip


@pytest.mark.parametrize("code", [0, 2])
def test_a_process_ends_with_its_code_although_native_code_hangs(code: int) -> None:
    ended = end(code, 600.0)
    assert (ended.returncode, ended.stdout) == (code, "done\n")


def test_a_process_that_leaves_in_time_goes_on() -> None:
    ended = end(3, 0.01)
    assert (ended.returncode, ended.stdout) == (0, "done\nafter\n")


ORPHAN = """
import os, time
from helmet_sim_ros.cli._processes import end_with_parent
parent, prepare = os.getpid(), end_with_parent()
if os.fork() == 0:
    while os.getppid() == parent:
        time.sleep(0.01)
    print("orphaned", flush=True)
    prepare()
    print("and alive", flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel ends children on Linux only")
def test_a_child_whose_parent_died_before_it_was_ready_ends() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", ORPHAN], capture_output=True, text=True, timeout=60
    )
    assert ended.stdout == "orphaned\n"
