"""The one exception family of the package."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple


def printable(text: str) -> str:
    """Text as a terminal may show it: what is not printable is written as its escape.

    Names in files of others end up in messages; none of them moves the cursor or turns the
    direction of reading. Line breaks stay.
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


class HelmetSimError(Exception):
    """Base of every error this package raises on purpose."""

    def __str__(self) -> str:
        return printable(super().__str__())


class Problem(NamedTuple):
    """One rejected value: dotted key, the value, and what would have been allowed."""

    key: str
    value: object
    allowed: str

    def __str__(self) -> str:
        try:
            shown = repr(self.value)
        except RecursionError:
            shown = "(nested too deep to be shown)"
        if len(shown) > 120:
            shown = shown[:117] + "..."
        key = self.key or "(empty)"
        if len(key) > 400:  # the end of a dotted name says most
            key = f"{key[:200]}...{key[-190:]}"
        return f"{key} = {shown}: {self.allowed}"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """``"; did you mean 'front'?"`` for the known name most like a word; empty if none is."""
    import difflib

    if not isinstance(word, str):
        return ""
    names = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), names, 1, 0.6)
    return f"; did you mean {names[near[0]]!r}?" if near else ""


class SetupError(HelmetSimError, ValueError):
    """A configuration value was refused; ``problems`` names each key, value and allowed range."""

    def __init__(self, problems: Sequence[Problem], source: str = "") -> None:
        self.problems = tuple(problems)
        self.source = source
        where = f"{source}: " if source else ""
        super().__init__(where + "; ".join(map(str, self.problems)))

    @classmethod
    def of(cls, key: str, value: object, allowed: str, source: str = "") -> SetupError:
        """The error for a single refused value."""
        return cls([Problem(key, value, allowed)], source)

    def within(self, source: str) -> SetupError:
        """The same problems, said to come from ``source`` (a file)."""
        return SetupError(self.problems, source)


class PulseError(HelmetSimError, ValueError):
    """A signal cannot be evaluated: wrong shape, not finite, not uniform in time, wrong unit."""


class IncompleteError(HelmetSimError):
    """Samples of an impact are missing or out of order; no criterion may be computed from them."""


class DivergedError(HelmetSimError):
    """The simulated state left physics: it is not finite, or has more kinetic energy than there can
    be; ``time`` is the simulation time [s]."""

    def __init__(self, time: float, setup: object = None) -> None:
        self.time = time
        self.setup = setup
        super().__init__(f"the simulation diverged at t = {time * 1e3:.3f} ms; setup: {setup!r}")


class LogError(HelmetSimError):
    """An impact log cannot be written or read."""


class NodeError(HelmetSimError):
    """A node, service or peer did not answer as the contract says."""


class StudyError(HelmetSimError):
    """A study could not be finished; every result it had by then is kept."""
