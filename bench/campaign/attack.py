"""What every attack of the campaign is: numbered cases, each from a seed, each with one outcome."""

from __future__ import annotations

import random
import resource
import time
import traceback
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, get_args

#: ``held``: as if nothing had happened. ``refused``: an error or a warning of ours says what is
#: wrong and where. ``lost``: something is gone, doubled, mixed or changed and nobody was told.
#: ``failed``: another exception, a hang, or more memory than is promised.
Verdict = Literal["held", "refused", "lost", "failed"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

#: Longest processor time in which a file is refused [s], and most memory that it may take [byte].
LONGEST = 1.0
MOST_MEMORY = 100e6
#: How many times that what is read may take: a matrix of thousands of cases, for instance.
WHAT_IS_READ = 10.0


class Outcome(NamedTuple):
    """What a case came to; ``detail`` says what happened."""

    verdict: Verdict
    detail: str = ""


class Impossible(Exception):
    """An attack cannot be tried on this machine; why."""


class Attack(ABC):
    """An attack: prepared once, then any number of cases.

    Attributes:
        name: for the table and ``--only``.
        what: one sentence.
        cases: how many by default, and by ``--long``.
        bounded: whether each case must keep to ``LONGEST`` and ``MOST_MEMORY``.
    """

    name: ClassVar[str]
    what: ClassVar[str]
    cases: ClassVar[tuple[int, int]]
    bounded: ClassVar[bool] = True

    @abstractmethod
    def prepare(self, folder: Path) -> None:
        """Make what the cases need, in an empty folder of its own.

        Raises:
            Impossible: this machine does not allow it.
        """

    @abstractmethod
    def case(self, rng: random.Random) -> Outcome:
        """One case, which depends on ``rng`` alone. Whatever it raises counts as failed."""

    def close(self) -> None:  # noqa: B027 - most have nothing to close
        """End what was started."""


@dataclass
class Tally:
    """The cases of one attack, counted.

    Attributes:
        attack: its name.
        counts: cases by verdict.
        bad: number of each case that was lost or failed, with its detail.
        last: the last case.
        slowest: processor time [s] of the slowest case.
        skipped: why no case could be tried; empty if they were.
    """

    attack: str
    counts: Counter[str] = field(default_factory=Counter)
    bad: list[tuple[int, Outcome]] = field(default_factory=list)
    last: Outcome | None = None
    slowest: float = 0.0
    skipped: str = ""

    @property
    def words(self) -> str:
        """The counts in words."""
        if self.skipped:
            return f"skipped: {self.skipped}"
        counts = ", ".join(f"{self.counts[verdict]} {verdict}" for verdict in VERDICTS)
        return f"{sum(self.counts.values())} cases ({counts})"


def run_case(attack: Attack, seed: int, number: int) -> tuple[Outcome, float]:
    """A case and its processor time [s]; the same for the same attack, seed and number."""
    rng = random.Random(f"{attack.name}/{seed}/{number}")
    memory, began = _most_memory(), time.process_time()
    try:
        outcome = attack.case(rng)
    except Exception as error:  # that is what is looked for
        *_, where = traceback.extract_tb(error.__traceback__)
        place = f"{Path(where.filename).name} line {where.lineno}"
        first = error.__context__  # while it was handled, the other came on top
        reason = f", after {type(first).__name__}: {first}" if first is not None else ""
        outcome = Outcome("failed", f"{type(error).__name__}: {error} ({place}){reason}")
    spent, grown = time.process_time() - began, _most_memory() - memory
    # The first cases load code and fill caches.
    if attack.bounded and number > 0 and outcome.verdict != "failed":
        scale = 1.0 if outcome.verdict == "refused" else WHAT_IS_READ
        if spent > scale * LONGEST:
            outcome = Outcome("failed", f"{spent:.1f} s of processor time; {outcome.detail}")
        elif grown > scale * MOST_MEMORY:
            outcome = Outcome("failed", f"{grown / 1e6:.0f} MB more memory; {outcome.detail}")
    return outcome, spent


def run(attack: Attack, seed: int, numbers: range, folder: Path) -> Tally:
    """Prepare an attack, run its cases and count them."""
    tally = Tally(attack.name)
    folder.mkdir(parents=True)
    try:
        attack.prepare(folder)
        for number in numbers:
            outcome, spent = run_case(attack, seed, number)
            tally.counts[outcome.verdict] += 1
            tally.last = outcome
            tally.slowest = max(tally.slowest, spent)
            if outcome.verdict in ("lost", "failed"):
                tally.bad.append((number, outcome))
    except Impossible as reason:
        tally.skipped = str(reason)
    finally:
        attack.close()
    return tally


def _most_memory() -> float:
    """The most memory that this process ever had [byte]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0
