"""The result of an evaluation: plain frozen data that survives JSON unchanged."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from helmet_sim_ros.errors import PulseError, did_you_mean
from helmet_sim_ros.views import show

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["pass", "fail", "info"]


class Criterion(NamedTuple):
    """One criterion of one impact.

    Attributes:
        name: as in the catalogue, ``peak_g``.
        value: in ``unit``.
        unit: SI, or g for accelerations of the head.
        window: the interval t1, t2 that the value belongs to, in the record's time [s].
        time: when the peak occurs, in the record's time [s].
        limit: largest allowed value, in ``unit``; None: the standard sets none.
        verdict: ``pass``, ``fail``, or ``info`` where there is no limit.
        note: what a reader of this one number must know.
        source: where the limit stands.
        verified: whether the limit was checked against the primary text; None without a limit.
    """

    name: str
    value: float
    unit: str
    window: tuple[float, float] | None = None
    time: float | None = None
    limit: float | None = None
    verdict: Verdict = "info"
    note: str = ""
    source: str = ""
    verified: bool | None = None

    def __float__(self) -> float:
        return self.value


@dataclass(frozen=True, repr=False)
class Evaluation:
    """All criteria of one impact, judged by one standard.

    A criterion is also an attribute: ``result.peak_g`` is ``result.criteria["peak_g"]``.

    Attributes:
        standard: name of the standard.
        title: its full title.
        criteria: by name.
        messages: the verdict in plain language, one line per limit, failures first.
        warnings: what weakens these numbers (sample rate, the record's notes, other impact
            conditions, ...).
    """

    standard: str
    title: str
    criteria: Mapping[str, Criterion]
    messages: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def verdict(self) -> Literal["pass", "fail"]:
        """``fail`` if any limit is exceeded."""
        failed = any(criterion.verdict == "fail" for criterion in self.criteria.values())
        return "fail" if failed else "pass"

    def __getattr__(self, name: str) -> Criterion:
        criteria = self.__dict__.get("criteria", {})
        if name not in criteria:
            hint = did_you_mean(name, criteria)
            known = f"; criteria: {', '.join(criteria)}" if criteria and not hint else ""
            raise AttributeError(f"{type(self).__name__} has no criterion {name!r}{hint or known}")
        return criteria[name]  # type: ignore[no-any-return]

    def frame(self) -> pd.DataFrame:
        """One row per criterion as a pandas table: value, unit, window, limit, verdict, ...

        Units are also in ``frame.attrs["units"]``.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return show("criteria_frame", self)

    def __repr__(self) -> str:
        return str(show("evaluation_text", self))

    def _repr_html_(self) -> str:
        return str(show("evaluation_html", self))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; see ``config/evaluation.schema.json``."""
        criteria = {name: criterion._asdict() for name, criterion in self.criteria.items()}
        for entry in criteria.values():
            entry["window"] = None if entry["window"] is None else list(entry["window"])
        return {
            "standard": self.standard,
            "title": self.title,
            "verdict": self.verdict,
            "messages": list(self.messages),
            "warnings": list(self.warnings),
            "criteria": criteria,
        }

    def to_json(self) -> str:
        """:meth:`as_dict` as one line of JSON; every number reads back bit for bit."""
        return json.dumps(self.as_dict(), allow_nan=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Evaluation:
        """The inverse of :meth:`as_dict`.

        Raises:
            PulseError: not the data of an evaluation.
        """
        try:
            return cls(
                standard=_text(data["standard"]),
                title=_text(data["title"]),
                criteria={name: _criterion(entry) for name, entry in data["criteria"].items()},
                messages=tuple(map(_text, data["messages"])),
                warnings=tuple(map(_text, data["warnings"])),
            )
        except (LookupError, TypeError, AttributeError, ValueError, OverflowError) as error:
            raise PulseError(f"evaluation: not the data of an evaluation: {error!r}") from None

    @classmethod
    def from_json(cls, text: str) -> Evaluation:
        """The inverse of :meth:`to_json`.

        Raises:
            PulseError: not JSON, or not the data of an evaluation.
        """
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise PulseError(f"evaluation: not JSON: {error}") from None
        return cls.from_dict(data)


def _criterion(entry: Mapping[str, Any]) -> Criterion:
    known = {name: entry[name] for name in Criterion._fields if name in entry}
    for name in ("name", "unit", "note", "source"):
        _text(known.get(name, ""))
    if known.get("verdict", "info") not in get_args(Verdict):
        raise ValueError(f"verdict {known['verdict']!r:.80}")
    if not isinstance(known.get("verified"), bool | None):
        raise TypeError("verified must be true, false or null")
    for name in ("time", "limit"):
        if known.get(name) is not None:
            known[name] = _finite(known[name])
    if known.get("window") is not None:
        begin, end = known["window"]
        known["window"] = _finite(begin), _finite(end)
    return Criterion(**known | {"value": _finite(known["value"])})


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r:.80} is no text")
    return value


def _finite(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise TypeError(f"{value!r:.80} is no finite number")
    return float(value)
