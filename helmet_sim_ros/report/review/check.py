"""Compare what a log says about its impacts with what its samples give."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact
from helmet_sim_ros.mcap_log.strikes import JudgedStrike
from helmet_sim_ros.model.fall.strikes import HeadStrikes
from helmet_sim_ros.report.replay.scene import admit_helmets
from helmet_sim_ros.report.review.strikes import LoggedStrike, beside_logged, found_strikes

#: Largest relative difference that another processor or library version may cause.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Difference:
    """A logged value that the samples do not give.

    Attributes:
        criterion: its name, or what else differs.
        field: of the criterion (``value``, ``limit``, ...).
        logged, computed: the two values.
    """

    criterion: str
    field: str
    logged: object
    computed: object

    def __str__(self) -> str:
        what = self.criterion if self.field == "value" else f"{self.criterion} {self.field}"
        return f"{what}: logged {self.logged!r}, computed from the samples {self.computed!r}"


@dataclass(frozen=True)
class Reviewed:
    """One impact, or head strike of a fall, after review.

    Attributes:
        impact: of the log.
        evaluation: computed from the logged samples, by the standard of the logged criteria.
        differences: what was logged otherwise.
        has_logged: whether the log has criteria of this impact.
    """

    impact: LoggedImpact | LoggedStrike
    evaluation: Evaluation
    differences: tuple[Difference, ...]
    has_logged: bool

    @property
    def check(self) -> str:
        """``same``, ``DIFFERS`` or ``not logged``."""
        if self.differences:
            return "DIFFERS"
        return "same" if self.has_logged else "not logged"


@dataclass(frozen=True)
class ReviewedFall:
    """One fall after review.

    Attributes:
        fall: of the log.
        strikes: its head strikes, found in the logged samples; none: no head contact.
        differences: what of the table of strikes was logged otherwise.
        has_logged: whether the log has the strikes of this fall.
    """

    fall: LoggedImpact
    strikes: tuple[Reviewed, ...]
    differences: tuple[Difference, ...]
    has_logged: bool

    @property
    def check(self) -> str:
        """``same``, ``DIFFERS`` or ``not logged``, strikes included."""
        if self.differences or any(strike.differences for strike in self.strikes):
            return "DIFFERS"
        return "same" if self.has_logged else "not logged"


def reviewed(log: ImpactLog, standard: str | None = None) -> Iterator[Reviewed | ReviewedFall]:
    """Every impact and fall of a log after review.

    Raises: see :func:`review`.
    """
    admit_helmets(log)
    for impact in log:
        yield review_fall(impact, standard) if impact.is_fall else review(impact, standard)


def review_fall(fall: LoggedImpact, standard: str | None = None) -> ReviewedFall:
    """Find and judge the head strikes of a fall again, and compare.

    Args and errors: see :func:`review`.
    """
    differences: list[Difference] = []
    try:
        logged = fall.strikes
    except LogError as error:
        logged = None
        differences.append(Difference("head strikes", "", str(error), "complete"))
    found = found_strikes(fall)
    strikes = beside_logged(fall, found, logged or ())
    if logged is not None:
        differences += _strike_differences(found, logged)
    return ReviewedFall(
        fall, tuple(review(strike, standard) for strike in strikes), tuple(differences),
        logged is not None,
    )  # fmt: skip


def review(impact: LoggedImpact | LoggedStrike, standard: str | None = None) -> Reviewed:
    """Compute the criteria of an impact or a head strike again and compare.

    Args:
        impact: of a log.
        standard: judge by this one; None: by that of the logged criteria.

    Raises:
        LogError: the samples are damaged.
        PulseError: no criteria can be computed from them.
        SetupError: the standard is unknown here.
    """
    try:
        logged, problem = impact.logged, ""
    except LogError as error:
        logged, problem = None, str(error)
    used = None if logged is None or logged.standard == DEFAULT_STANDARD else logged.standard
    computed = impact.evaluate(used)
    differences = list(_model_differences(impact))
    if problem:
        differences.append(Difference("criteria", "", problem, "complete"))
    if logged is not None:
        differences += evaluation_differences(logged, computed)
    if standard is not None and standard != used:
        computed = impact.evaluate(standard)
    return Reviewed(impact, computed, tuple(differences), logged is not None)


def evaluation_differences(logged: Evaluation, computed: Evaluation) -> Iterator[Difference]:
    """Where a logged evaluation differs; a criterion that was not logged is no difference."""
    for name, old in logged.criteria.items():
        new = computed.criteria.get(name)
        if new is None:
            yield Difference(name, "value", old.value, None)
        else:
            yield from _criterion_differences(old, new)
    if logged.verdict != computed.verdict:
        yield Difference("evaluation", "verdict", logged.verdict, computed.verdict)


def _criterion_differences(old: Criterion, new: Criterion) -> Iterator[Difference]:
    for field in ("value", "unit", "window", "time", "limit", "verdict"):
        before, after = getattr(old, field), getattr(new, field)
        if not _same(before, after):
            yield Difference(old.name, field, before, after)


def _strike_differences(
    found: HeadStrikes, logged: tuple[JudgedStrike, ...]
) -> Iterator[Difference]:
    """Where the table of head strikes was logged otherwise; their criteria are compared alone."""
    if len(found) != len(logged):
        yield Difference("head strikes", "number", len(logged), len(found))
    for number, (old, new) in enumerate(zip(logged, found.rows(()), strict=False), 1):
        for name, value in new.items():
            if not _same(old.row.get(name), value):
                yield Difference(f"strike {number}", name, old.row.get(name), value)


def _model_differences(impact: LoggedImpact | LoggedStrike) -> Iterator[Difference]:
    if impact.model_problem:
        yield Difference("model", "hash", impact.model_problem, impact.model_hash)


def _same(a: object, b: object) -> bool:
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=1e-12)
    return bool(a == b)
