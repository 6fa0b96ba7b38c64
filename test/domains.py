"""ROS domains for tests: each is claimed once on this host, also by test runs side by side."""

from __future__ import annotations

import fcntl
import tempfile
from pathlib import Path
from typing import TextIO

_claims: list[TextIO] = []


def claim_domain() -> int:
    """A ROS domain that no other test has; it stays claimed until this process ends."""
    for domain in range(1, 100):
        path = Path(tempfile.gettempdir(), f"helmet_sim_ros_domain_{domain}.lock")
        lock = path.open("w")  # open: this is the claim
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        _claims.append(lock)
        return domain
    raise RuntimeError("no ROS domain is free")
