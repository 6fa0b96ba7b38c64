"""The seal of a metadata record: MCAP has checksums for everything else, but none for these."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

#: Key of the seal among the values of a record.
SEAL = "sha256"


def sealed(name: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values of a metadata record with the SHA-256 of its name and of all of them."""
    kept = {key: value for key, value in values.items() if key != SEAL}
    return kept | {SEAL: _digest(name, kept)}


def unsealed(name: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values without their seal.

    Raises:
        ValueError: the seal is missing, or not that of this name and these values.
    """
    kept = {key: value for key, value in values.items() if key != SEAL}
    if values.get(SEAL) != _digest(name, kept):
        raise ValueError(f"metadata {name}: damaged: not what its seal says")
    return kept


def _digest(name: str, values: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps([name, sorted(values.items())]).encode()).hexdigest()
