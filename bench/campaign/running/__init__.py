"""Attacks on running systems: nodes and commands as processes of their own.

They use the rig and the domains of the tests, ``test/node_processes.py`` and ``test/domains.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "test"))

from domains import claim_domain
from node_processes import Rig

__all__ = ["Rig", "claim_domain"]
