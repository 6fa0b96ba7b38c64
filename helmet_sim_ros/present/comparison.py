"""Records, evaluations and setups side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from helmet_sim_ros.biomech.catalogue import HEADLINE
from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.errors import PulseError, did_you_mean
from helmet_sim_ros.extra import need
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.present.html import table
from helmet_sim_ros.present.words import quantity_text, value_text

if TYPE_CHECKING:
    import pandas as pd

#: What can be compared.
Comparable = ImpactRecord | Evaluation | ImpactSetup


@dataclass(frozen=True, repr=False)
class Comparison:
    """Several impacts side by side: how their setups differ, and what came out.

    Attributes:
        names: of what is compared, one per column.
        setups: values in which the setups differ, by dotted name, one per column; None where a
            column has no setup, or not this value.
        criteria: values of the criteria by name, one per column; None where a column has none.
        units: of the criteria, by name.
        verdicts: one per column; None where there is no evaluation.
    """

    names: tuple[str, ...]
    setups: Mapping[str, tuple[Any, ...]]
    criteria: Mapping[str, tuple[float | None, ...]]
    units: Mapping[str, str]
    verdicts: tuple[str | None, ...]

    def frame(self) -> pd.DataFrame:
        """One row per value, one column per impact; units are in ``frame.attrs["units"]``.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        rows = {**self.setups, **self.criteria, "verdict": self.verdicts}
        pandas = need("pandas", "report")
        frame = pandas.DataFrame.from_dict(rows, orient="index", columns=list(self.names))
        frame.attrs = {"units": dict(self.units)}
        return frame

    def __repr__(self) -> str:
        rows = self._rows()
        widths = [max(len(row[i]) for row in rows) for i in range(len(self.names) + 1)]
        lines = (
            "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])])
            for row in rows
        )
        return "\n".join(line.rstrip() for line in lines)

    def _repr_html_(self) -> str:
        head, *rows = self._rows()
        return table(head, rows)

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("", *self.names)]
        rows += [(name, *map(value_text, values)) for name, values in self.setups.items()]
        for name, values in self.criteria.items():
            unit = self.units[name]
            rows.append((name, *("" if v is None else quantity_text(v, unit) for v in values)))
        if any(self.verdicts):
            rows.append(("verdict", *(verdict or "" for verdict in self.verdicts)))
        return rows


def compare(
    items: Iterable[Comparable],
    names: Sequence[str] | None = None,
    criteria: Sequence[str] | None = None,
    standard: str | None = None,
) -> Comparison:
    """Put impacts side by side.

    Args:
        items: records, evaluations or setups, also mixed. Records are evaluated; setups are not
            simulated.
        names: of the columns; None: 1, 2, ...
        criteria: which to show; None: the headline, and what the standards limit.
        standard: that records are judged by, as for :func:`helmet_sim_ros.evaluate`.

    Raises:
        PulseError: nothing to compare, something of another kind, another number of names, or a
            criterion that none of the items has.
    """
    given = list(items)
    for item in given:
        if not isinstance(item, Comparable):
            raise PulseError(
                f"compare: {type(item).__name__} is none of ImpactRecord, Evaluation, ImpactSetup"
            )
    if not given:
        raise PulseError("compare: nothing to compare")
    columns = [str(number) for number in range(1, len(given) + 1)] if names is None else list(names)
    if len(columns) != len(given):
        raise PulseError(f"compare: {len(columns)} names for {len(given)} items")
    setups = [_setup(item) for item in given]
    evaluations = [_evaluation(item, standard) for item in given]
    wanted = _wanted(evaluations, criteria)
    return Comparison(
        tuple(columns),
        _differing(setups),
        {name: tuple(_value(e, name) for e in evaluations) for name in wanted},
        {n: next(e.criteria[n].unit for e in evaluations if e and n in e.criteria) for n in wanted},
        tuple(None if e is None else e.verdict for e in evaluations),
    )


def _setup(item: Comparable) -> Mapping[str, Any]:
    if isinstance(item, ImpactSetup):
        return item.described()
    return item.setup if isinstance(item, ImpactRecord) else {}


def _evaluation(item: Comparable, standard: str | None) -> Evaluation | None:
    if isinstance(item, ImpactRecord):
        return evaluate(item, standard)
    return item if isinstance(item, Evaluation) else None


def _differing(setups: Sequence[Mapping[str, Any]]) -> dict[str, tuple[Any, ...]]:
    known = [setup for setup in setups if setup]
    names = dict.fromkeys(name for setup in known for name in setup)
    return {
        name: tuple(setup.get(name) for setup in setups)
        for name in names
        if any(setup.get(name) != known[0].get(name) for setup in known)
    }


def _wanted(evaluations: Sequence[Evaluation | None], names: Sequence[str] | None) -> list[str]:
    found = dict.fromkeys(name for e in evaluations if e is not None for name in e.criteria)
    if names is None:
        limited = {
            n for e in evaluations if e for n, c in e.criteria.items() if c.limit is not None
        }
        return [name for name in found if name in HEADLINE or name in limited]
    for name in names:
        if name not in found:
            raise PulseError(f"compare: no criterion {name!r}{did_you_mean(name, found)}")
    return list(names)


def _value(evaluation: Evaluation | None, name: str) -> float | None:
    if evaluation is None or name not in evaluation.criteria:
        return None
    return evaluation.criteria[name].value
