"""Everything that a log shows, as plain text, to compare it with the original."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from helmet_sim_ros import open_log
from helmet_sim_ros.biomech.record import to_block
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact

#: Of an impact.
PARTS: dict[str, Callable[[LoggedImpact], str]] = {
    "start": lambda impact: repr(impact.start_time),
    "length": lambda impact: repr(impact.samples),
    "setup": lambda impact: json.dumps(dict(impact.setup), sort_keys=True),
    "model": lambda impact: impact.model or "",
    "samples": lambda impact: _samples(impact),
    "criteria": lambda impact: "" if impact.logged is None else impact.logged.to_json(),
}


def shown(path: Path) -> tuple[ImpactLog, dict[str, str | LogError]]:
    """A log and all that it shows by name; an error where a part of it is refused.

    Raises:
        LogError: it cannot be opened.
    """
    log = open_log(path)
    found: dict[str, str | LogError] = {}

    def put(name: str, read: Callable[[], str]) -> None:
        try:
            found[name] = read()
        except LogError as error:
            found[name] = error

    put("ids", lambda: json.dumps([impact.impact_id for impact in log]))
    put("run", lambda: json.dumps(log.run, sort_keys=True))
    put("library", lambda: log.library)
    for name in log.files:
        put(f"attachment {name}", lambda name=name: log.file(name).hex())  # type: ignore[misc]
    for impact in log:
        for part, read in PARTS.items():
            put(f"{impact.impact_id} {part}", lambda read=read, i=impact: read(i))  # type: ignore[misc]
    return log, found


def _samples(impact: LoggedImpact) -> str:
    record = impact.record
    digest = hashlib.sha256(to_block(record).tobytes())
    for name, value in sorted(record.extras.items()):
        data = value.tobytes() if isinstance(value, np.ndarray) else json.dumps(value).encode()
        digest.update(name.encode() + b"=" + data)
    return digest.hexdigest()
