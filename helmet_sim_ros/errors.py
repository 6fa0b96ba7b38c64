"""The one exception family of the package."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple


class HelmetSimError(Exception):
    """Base of every error this package raises on purpose."""


class Problem(NamedTuple):
    """One rejected value: dotted key, the value, and what would have been allowed."""

    key: str
    value: object
    allowed: str

    def __str__(self) -> str:
        shown = repr(self.value)
        if len(shown) > 120:
            shown = shown[:117] + "..."
        return f"{self.key} = {shown}: {self.allowed}"


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
    """The simulated state stopped being finite; ``time`` is the simulation time [s]."""

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
