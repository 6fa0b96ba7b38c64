"""The state behind the page: two setups, what is shown of each, and how a change gets there.

Nothing here knows a browser: the page calls the methods and is told by ``changed`` and ``shown``.
"""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, load_standard
from helmet_sim_ros.errors import HelmetSimError, SetupError
from helmet_sim_ros.explore.controls import HELMET, control, controls, values_of
from helmet_sim_ros.explore.latest import LatestWins, Stale
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names

Side = Literal["A", "B"]
SIDES: tuple[Side, Side] = ("A", "B")

#: Samples between two looks for a newer request: a few milliseconds of work.
_SLICE = 400


def digest(described: Mapping[str, Any]) -> str:
    """A short name of a complete setup, the first digits of the digest in logs and answers.

    Args:
        described: ``setup.described()``, or the ``setup`` of a record.
    """
    try:
        return setup_digest(dict(described))[:8]
    except (TypeError, ValueError):  # a log of somebody else's, with NaN in its setup
        return hashlib.sha256(repr(sorted(described.items())).encode()).hexdigest()[:8]


@dataclass(frozen=True)
class Shown:
    """One impact, complete: everything on the page about a side comes from one of these.

    Attributes:
        setup: of the impact; None for a logged one that this version cannot simulate.
        digest: of the record's setup.
        record, evaluation: its samples and criteria; None if it failed.
        error: why there is no record, or no evaluation.
        origin: where a logged impact comes from; empty for one that was computed here.
        seconds: what simulation and criteria took.
    """

    setup: ImpactSetup | None
    digest: str
    record: ImpactRecord | None
    evaluation: Evaluation | None
    error: str = ""
    origin: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class _Wanted:
    setup: ImpactSetup | None
    standard: str
    record: ImpactRecord | None = None
    origin: str = ""


@dataclass(frozen=True)
class Slot:
    """The setup of one side as the user left it.

    Attributes:
        changes: dotted names and values that differ from the defaults and the helmet's file.
        setup: valid at any time.
    """

    changes: Mapping[str, Any]
    setup: ImpactSetup

    @property
    def digest(self) -> str:
        """Of the setup."""
        return digest(self.setup.described())

    def values(self) -> dict[str, Any]:
        """The value of every control."""
        return values_of(self.setup, self.changes)


class Session:
    """What one page shows and lets turn. Its methods may be called from any thread.

    Args:
        shown: takes the impact to show for a side, None when the side is closed. It is called in
            the order in which impacts are to be seen, one at a time.

    Attributes:
        standard: that the criteria are judged by.
        refusal: why the last change was refused, empty after one that was accepted.
    """

    def __init__(self, shown: Callable[[Side, Shown | None], None] = lambda side, shown: None):
        self._shown = shown
        self._lock = threading.RLock()
        self._slots: dict[Side, Slot] = {"A": slot_of({})}
        self._latest: dict[Side, Shown] = {}
        self._logged: dict[Side, tuple[ImpactRecord, str]] = {}
        self.standard = DEFAULT_STANDARD
        self.refusal = ""
        self._refused_key = ""
        self._worker: LatestWins[Side, _Wanted, Shown] = LatestWins(_computed, self._deliver)

    def start(self) -> None:
        """Compute the first impact."""
        self._ask("A")

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    def wait_idle(self, seconds: float) -> bool:
        """Wait until nothing is left to compute; whether that came about in time."""
        return self._worker.wait_idle(seconds)

    def has(self, side: Side) -> bool:
        """Whether a side is in use."""
        return side in self._slots

    def slot(self, side: Side) -> Slot:
        """The setup of a side."""
        return self._slots[side]

    def latest(self, side: Side) -> Shown | None:
        """The last impact that was shown for a side."""
        return self._latest.get(side)

    def pending(self, side: Side) -> bool:
        """Whether what is shown is older than the setup."""
        latest = self._latest.get(side)
        if side not in self._slots or side in self._logged:
            return False
        return latest is None or latest.digest != self._slots[side].digest

    def change(self, side: Side, name: str, content: Any) -> bool:
        """Set one value; whether it was accepted. A refused one changes nothing but ``refusal``.

        Args:
            name: dotted.
            content: as the control holds it: a number, a choice, or a text.
        """
        with self._lock:
            try:
                changed = control(name)
                slot = self._slots[side]
                value = changed.parsed(content)
                changes = dict(slot.changes) | {name: value}
                if name == HELMET:  # another helmet comes with all its own values
                    changes = {k: v for k, v in changes.items() if k == name or not _helmet(k)}
                new, dropped = _fitting(changes, name)
            except HelmetSimError as error:
                self._refuse(name, str(error))
                return False
            # A browser sets a number that was typed beyond a limit to this limit when the field
            # is left: what was refused must still be read then.
            at_limit = changed.leaf.minimum == value or changed.leaf.maximum == value
            if dropped or not (at_limit and name == self._refused_key):
                self._refuse("", dropped)
            if new.digest != slot.digest or side in self._logged:
                self._slots[side] = new
                self._logged.pop(side, None)
                self._ask(side)
            return True

    def load(self, side: Side, changes: Mapping[str, Any]) -> bool:
        """Take a whole setup, everything not given at its default; whether it was accepted."""
        with self._lock:
            try:
                slot = slot_of(changes)
            except HelmetSimError as error:
                self._refuse("", str(error))
                return False
            self._refuse("", "")
            self._slots[side] = slot
            self._logged.pop(side, None)
            self._ask(side)
            return True

    def show_logged(self, side: Side, record: ImpactRecord, origin: str) -> None:
        """Show an impact as it was recorded; its setup can be turned from there on."""
        with self._lock:
            setup: ImpactSetup | None = None
            try:
                slot = logged_slot(record.setup)
                self._slots[side], setup = slot, slot.setup
                self._refuse("", "")
            except HelmetSimError as error:
                self._refuse("", f"{origin}: its setup cannot be turned here: {error}")
            self._logged[side] = record, origin
            self._worker.submit(side, _Wanted(setup, self.standard, record, origin))

    def judge_by(self, standard: str) -> bool:
        """Judge by another standard, a name or the path of a file; whether it was accepted."""
        with self._lock:
            try:
                load_standard(standard)
            except HelmetSimError as error:
                self._refuse("standard", str(error))
                return False
            if standard != self.standard:
                self.standard = standard
                for side in self._slots:
                    self._ask(side)
            return True

    def open_b(self) -> None:
        """Begin the second side as a copy of the first."""
        with self._lock:
            self._slots["B"] = self._slots["A"]
            self._logged.pop("B", None)
            if "A" in self._logged:
                self._logged["B"] = self._logged["A"]
            self._ask("B")

    def close_b(self) -> None:
        """Give the second side up."""
        with self._lock:
            self._worker.forget("B")
            for held in (self._slots, self._latest, self._logged):
                held.pop("B", None)
        self._shown("B", None)

    def say(self, problem: str) -> None:
        """Note a problem that is no refused value, for the page to show."""
        self._refuse("", problem)

    def differences(self) -> list[tuple[str, Any, Any]]:
        """Name, value of A and value of B where the two setups differ."""
        if "B" not in self._slots:
            return []
        a, b = (self._slots[side].values() for side in SIDES)
        return [(name, a[name], b[name]) for name in a if a[name] != b[name]]

    def _refuse(self, key: str, text: str) -> None:
        self._refused_key, self.refusal = key, text

    def _ask(self, side: Side) -> None:
        record, origin = self._logged.get(side, (None, ""))
        setup = self._slots[side].setup
        self._worker.submit(side, _Wanted(setup, self.standard, record, origin))

    def _deliver(self, side: Side, shown: Shown) -> None:
        with self._lock:
            if side not in self._slots:  # closed meanwhile
                return
            self._latest[side] = shown
        self._shown(side, shown)


def slot_of(changes: Mapping[str, Any]) -> Slot:
    """A slot with a valid setup, and no more changes than there are.

    Raises:
        SetupError: a refused value.
    """
    setup_from_names(changes)
    own = {HELMET: changes[HELMET]} if HELMET in changes else {}
    before = values_of(setup_from_names(own), own)
    before |= {c.name: None for c in controls() if c.leaf.optional and not _helmet(c.name)}
    kept = own | {name: value for name, value in changes.items() if before.get(name, ...) != value}
    return Slot(kept, setup_from_names(kept))


def _fitting(changes: Mapping[str, Any], turned: str) -> tuple[Slot, str]:
    """A slot, if need be without earlier changes that do not go with the value turned last.

    Returns:
        The slot, and what was set back, in words.

    Raises:
        SetupError: the value turned last is refused itself.
    """
    try:
        return slot_of(changes), ""
    except SetupError as error:
        others = {problem.key for problem in error.problems}
        if turned in others or not others <= set(changes):
            raise
        kept = {name: value for name, value in changes.items() if name not in others}
        return slot_of(kept), f"set back, because refused now: {error}"


def logged_slot(described: Mapping[str, Any]) -> Slot:
    """The slot behind a recorded setup, also where its helmet's file is not on this machine.

    Raises:
        SetupError: this version cannot simulate it.
    """
    known = {known.name for known in controls()}
    changes = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in described.items()
        if name in known
    }
    try:
        return slot_of(changes)
    except SetupError:
        # A log carries every value of its helmet, so any helmet can stand in for the file.
        changes.pop(HELMET, None)
        return _fitting(changes, "")[0]


def _computed(wanted: _Wanted, check: Callable[[], None]) -> Shown:
    from helmet_sim_ros.biomech.evaluation import evaluate

    began = time.perf_counter()
    record, error = wanted.record, ""
    evaluation: Evaluation | None = None
    try:
        if record is None:
            assert wanted.setup is not None
            record = _simulated(wanted.setup, check)
        evaluation = evaluate(record, None if wanted.standard == DEFAULT_STANDARD
                              else wanted.standard)  # fmt: skip
    except HelmetSimError as refused:
        error = str(refused)
    except Stale:
        raise
    except Exception as mistake:  # the page goes on with the next setup
        error = f"unexpected {type(mistake).__name__}: {mistake}"
    described = record.setup if record is not None else {}
    if record is None and wanted.setup is not None:
        described = wanted.setup.described()
    return Shown(
        wanted.setup, digest(described), record, evaluation, error, wanted.origin,
        time.perf_counter() - began,
    )  # fmt: skip


def _simulated(setup: ImpactSetup, check: Callable[[], None]) -> ImpactRecord:
    from helmet_sim_ros.model.impact import Impact

    impact = Impact(setup)
    while impact.advance(_SLICE) < impact.total:
        check()
    return impact.record()


def _helmet(name: str) -> bool:
    return name.startswith("helmet.")
