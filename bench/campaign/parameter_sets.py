"""Random sets of parameters: taken exactly as given, or refused by a message that names one."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.setup import setup_from_names

#: Values of every type that YAML, JSON or a caller in Python may bring.
ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2.5, 1e-5, 1e300, -1e300, math.inf, math.nan, 10**400, "", "x",
    "1", "../../etc/passwd", "/etc/passwd", "a" * 300, "\x00", "\ud800", "a\nb.yaml", "/dev/zero",
    "/proc/self/mem", "~nobody/x.yaml", "front", "foam", "spring", "headform", [], [1, 2, 3],
    [0.1, 0.1, 0.1], [math.nan] * 3, {}, {"a": 1}, b"x", (1, 2, 3), {1: 2}, 1j,
    {"A": 1.0, "B": 2.0}, {"density": 20.0}, ["front", ["foam"]], {"a": {"b": [None]}},
]  # fmt: skip
#: Names that are none, or only groups.
WRONG = ["helmet.unknown", "x", "impact.", "helmet.", "rider", "rider.x.y", "rider.neck",
         "helmet.liner", "helmet.shell", "rider.posture", "impact", "sim", "\x1b[2J", "a" * 300,
         "impact.friction ", "IMPACT.friction", "__class__", "helmet.__init__"]  # fmt: skip
#: What may be the path of a file.
PATHS = ("helmet.name", "head.surface", "head.form", "impact.surface")


class ParameterSets(Attack):
    """No value is changed on the way, dropped, or refused without being named."""

    name = "parameter sets"
    what = "random names and values of every type against the schema"
    cases = (2000, 10_000)

    def prepare(self, folder: Path) -> None:
        self._good = ImpactSetup().described()
        self._names = [*self._good, "helmet.liner.front.density", *WRONG]

    def case(self, rng: random.Random) -> Outcome:
        given = {}
        for name in rng.sample(self._names, rng.choice([1, 1, 1, 2, 3, 8])):
            given[name] = self._value(name, rng)
        try:
            setup = setup_from_names(given)
        except SetupError as error:
            return self._refused(given, error)
        described = setup.described()
        for name, value in given.items():
            taken = described.get(name, "(nothing)")
            unset = name == "head.surface" and value == ""  # the rig's own
            # The helmet's own value counts as none given: its spring then follows its liner.
            unset |= name.startswith("helmet.spring.") and value == self._good.get(name)
            if not unset and not _same(taken, value):
                return Outcome("lost", f"{name}: given {value!r:.80}, taken {taken!r:.80}")
        return Outcome("held", f"{sorted(given)}")

    def _value(self, name: str, rng: random.Random) -> Any:
        good = self._good.get(name)
        chance = rng.random()
        if chance < 0.4:
            return rng.choice(ODD)
        if isinstance(good, float) and chance < 0.8:
            return good * rng.uniform(0.5, 1.5) if good else rng.uniform(0.0, 0.1)
        if chance < 0.9:
            return good
        return rng.uniform(-1.0, 1.0) * 10 ** rng.uniform(-8.0, 8.0)

    def _refused(self, given: dict[str, Any], error: SetupError) -> Outcome:
        text = str(error)
        files = [str(value) for name, value in given.items() if name in PATHS]
        # A name that cannot be shown stands there with its escapes; a bad file by its path.
        shown = [name.encode("unicode_escape").decode() for name in given]
        if not any(name in text for name in (*shown, *files)) or not error.problems:
            return Outcome("lost", f"names none of {shown}: {text}")
        if "root:" in text or not text.isprintable():
            return Outcome("lost", f"shows what it must not: {text!r:.200}")
        return Outcome("refused", text)


def _same(taken: Any, given: Any) -> bool:
    if given == "side" and taken == "left":
        return True
    if isinstance(given, tuple):
        given = list(given)
    # An unset neck flexion is resolved; 5 and 5.0 are the same number, True is none.
    if given is None or isinstance(taken, bool) or isinstance(given, bool):
        return given is None or taken is given
    return bool(taken == given)
