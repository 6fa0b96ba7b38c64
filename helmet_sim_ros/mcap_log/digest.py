"""The digest of an impact setup: the proof that what ran is what was asked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

#: Its name in sample blocks, criteria, metadata and answers.
SETUP_DIGEST = "setup_digest"


def setup_digest(described: Mapping[str, Any]) -> str:
    """SHA-256 of a complete setup in canonical JSON, as 64 hexadecimal digits.

    Canonical: keys sorted, no blanks, ASCII, numbers as Python writes them (shortest form that
    reads back bit for bit).

    Args:
        described: every value by its dotted name, as ``ImpactSetup.described()`` gives it.

    Raises:
        ValueError: a value that JSON does not have (NaN, infinity).
        TypeError: a value that is no plain data.
    """
    text = json.dumps(described, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()
