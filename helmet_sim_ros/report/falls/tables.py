"""Head strikes of falls as files: a table, and a scenario that makes each a helmet test."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.fall.strikes import COLUMNS, HeadStrikes, Strike

#: Slower strikes make no impact [m/s into what is struck]; a choice.
SLOWEST = 0.5
#: Criteria in the table of strikes.
CRITERIA = ("peak_g", "hic", "bric", "peak_angular_acceleration", "peak_angular_velocity")


@dataclass(frozen=True)
class FallResult:
    """One fall and its head strikes, in their order."""

    name: str
    fall: Fall
    strikes: HeadStrikes


def to_csv(results: Sequence[FallResult]) -> str:
    """One line per strike; criteria in their own units, notes of what went beyond what there is."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [f"{name} [{unit}]" for name, unit in COLUMNS]
    writer.writerow(["fall", "strike", *columns, *CRITERIA, "notes"])
    for result in results:
        for number, row in enumerate(result.strikes.rows(CRITERIA), 1):
            cells = ["" if v is None else f"{v:.8g}" if isinstance(v, float) else v
                     for v in row.values()]  # fmt: skip
            notes = "; ".join(result.strikes[number - 1].record.notes)
            writer.writerow([result.name, number, *cells, notes])
    return text.getvalue()


def impacts_of(results: Sequence[FallResult]) -> Iterator[tuple[str, int, Strike]]:
    """The strikes that are impacts: name of the fall, number of the strike, the strike.

    Left out are those in which the head's centre hardly moves towards what it touches, and those
    that no impact setup takes, being too fast.
    """
    for result in results:
        for number, strike in enumerate(result.strikes, 1):
            if strike.normal_velocity < SLOWEST:
                continue
            try:
                strike.setup()
            except SetupError:
                continue
            yield result.name, number, strike


def to_scenario(results: Sequence[FallResult]) -> str | None:
    """A scenario file whose cases are the strikes as impacts; None: there is none."""
    cases = []
    for name, number, strike in impacts_of(results):
        described = strike.setup().described()
        told = {k: v for k, v in described.items() if v is not None and k not in NOT_CHOSEN}
        cases.append({"name": f"{name}, strike {number}"} | told)
    if not cases:
        return None
    common = {k: v for k, v in cases[0].items() if all(case.get(k) == v for case in cases)}
    common.pop("name", None)
    data = {
        "description": "Head strikes of falls, each as an impact of the same rider and helmet.",
        "common": common,
        "cases": [{k: v for k, v in case.items() if k not in common} for case in cases],
    }
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)


#: Told of a setup and never chosen.
NOT_CHOSEN = ("helmet.description", "helmet.liner.foam_digest")
