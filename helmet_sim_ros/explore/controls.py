"""What a user can turn: one control for each value of the setup, described by the schema alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import yaml

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.setup import ImpactSetup, setup_leaves
from helmet_sim_ros.present.words import unit_text
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.schema import Leaf, leaves
from helmet_sim_ros.yaml_file import parse_yaml

#: Selects the helmet; every other ``helmet.*`` value is one in it.
HELMET = "helmet.name"
#: Says where a helmet's values come from; nothing to turn.
_PROSE = "helmet.description"
#: Words for "no value of its own" in the field of an optional value.
UNSET = "unset"
_UNSET_WORDS = ("", UNSET, "none", "null")
#: A slider over a wider range cannot be set finely enough; such a value is typed (a choice).
_WIDEST_RATIO, _SMALLEST_SHARE = 1000.0, 0.02
#: Steps of a slider, about.
_STEPS = 200

Kind = Literal["slider", "text", "menu", "switch"]


@dataclass(frozen=True)
class Control:
    """How one value of a setup is turned.

    Attributes:
        leaf: the value, as the schema describes it.
        kind: ``slider`` (both limits are known), ``menu``, ``switch`` or ``text``.
        initial: the value of the default setup; of an optional slider what it resolves to.
        choices: of a menu.
        step: of a slider.
    """

    leaf: Leaf
    kind: Kind
    initial: Any
    choices: tuple[str, ...] = ()
    step: float = 0.0

    @property
    def name(self) -> str:
        """The dotted name, ``impact.normal_velocity``."""
        return self.leaf.name

    @property
    def group(self) -> tuple[str, ...]:
        """Where it belongs: ``("helmet", "liner")``."""
        return tuple(self.name.split(".")[:-1])

    @property
    def label(self) -> str:
        """``normal velocity [m/s]``."""
        words = self.name.split(".")[-1].replace("_", " ")
        if self.leaf.unit == "deg":
            words = words.removesuffix(" deg")
        return words if self.leaf.unit in ("", "-") else f"{words} [{unit_text(self.leaf.unit)}]"

    @property
    def hint(self) -> str:
        """What it means, what is allowed, and its name for files and the command line."""
        unset = f", or {UNSET}" if self.leaf.optional and self.kind == "text" else ""
        text = f"{self.leaf.description}; {self.leaf.allowed}{unset} ({self.name})"
        return text[:1].upper() + text[1:]

    @property
    def minimum(self) -> float:
        """Of a slider."""
        low = self.leaf.minimum or 0.0
        return low + self.step if self.leaf.exclusive_minimum else low

    @property
    def maximum(self) -> float:
        """Of a slider."""
        return self.leaf.maximum or 0.0

    def shown(self, value: Any) -> Any:
        """A value as its control holds it."""
        if self.kind == "slider":
            return float(value) if self.leaf.type is float else value
        if self.kind == "switch":
            return bool(value)
        if value is None:
            return UNSET
        if isinstance(value, list | tuple):
            return ", ".join(f"{item:g}" if isinstance(item, float) else str(item)
                             for item in value)  # fmt: skip
        return f"{value:.10g}" if isinstance(value, float) else str(value)

    def parsed(self, content: Any) -> Any:
        """The value that the content of a control stands for; the setup judges it.

        Raises:
            SetupError: a text that is no value at all.
        """
        if not isinstance(content, str):
            return content
        text = content.strip()
        if self.leaf.optional and text.lower() in _UNSET_WORDS:
            return None
        if self.leaf.type is str:
            return text
        if self.leaf.type is tuple and not text.startswith("["):
            text = f"[{text}]"
        try:
            value = parse_yaml(text)
        except yaml.YAMLError:
            raise SetupError.of(self.name, content, self.leaf.allowed) from None
        return tuple(value) if isinstance(value, list) else value


@lru_cache(maxsize=1)
def controls() -> tuple[Control, ...]:
    """A control for every value of a setup, in the order of the schema, the helmet's last."""
    setup = ImpactSetup()
    described = setup.described()
    name = Leaf(HELMET, str, setup.helmet, "", "name in config/helmets, or path to a YAML file")
    helmet = [leaf for leaf in leaves(Helmet, "helmet.") if leaf.name != _PROSE]
    return tuple(
        _control(leaf, described.get(leaf.name, leaf.default))
        for leaf in [*setup_leaves(), name, *helmet]
    )


def control(name: str) -> Control:
    """The control of a dotted name.

    Raises:
        SetupError: there is none.
    """
    for known in controls():
        if known.name == name:
            return known
    raise SetupError.of(name, None, "no such value")


def values_of(setup: ImpactSetup, changes: Mapping[str, Any]) -> dict[str, Any]:
    """The value of every control in a setup; None where an optional value was not given."""
    described = setup.described()
    values = {c.name: described.get(c.name, c.leaf.default) for c in controls()}
    for c in controls():  # a description holds what such a value resolves to
        if c.leaf.optional and c.kind == "text" and not c.name.startswith("helmet."):
            values[c.name] = changes.get(c.name, c.leaf.default)
    return values


def _control(leaf: Leaf, initial: Any) -> Control:
    choices = leaf.choices or _configured(leaf)
    if choices and initial is not None:  # a menu has no entry for unset
        return Control(leaf, "menu", initial, choices)
    if leaf.type is bool:
        return Control(leaf, "switch", initial)
    if leaf.type in (float, int) and initial is not None and _slides(leaf, float(initial)):
        assert leaf.minimum is not None and leaf.maximum is not None
        step = _round_step((leaf.maximum - leaf.minimum) / _STEPS)
        return Control(
            leaf, "slider", initial, step=max(1.0, step) if leaf.type is int else step
        )  # fmt: skip
    return Control(leaf, "text", None if leaf.optional else initial)


def _slides(leaf: Leaf, initial: float) -> bool:
    low, high = leaf.minimum, leaf.maximum
    if low is None or high is None:
        return False
    if low > 0.0 and high / low > _WIDEST_RATIO:
        return False
    share = (initial - low) / (high - low)
    return share == 0.0 or share >= _SMALLEST_SHARE


def _round_step(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step))
    return float(f"{power * max(f for f in (1, 2, 5) if f * power <= step * 1.001):.1g}")


def _configured(leaf: Leaf) -> tuple[str, ...]:
    """The shipped files that a value names: ``helmet.name`` those in ``config/helmets``."""
    if leaf.type is not str:
        return ()
    *_, group, last = leaf.name.split(".")
    config = share_directory() / "config"
    for folder in (f"{group}_{last}s", f"{group if last == 'name' else last}s"):
        if (config / folder).is_dir():
            return tuple(sorted(path.stem for path in (config / folder).glob("*.yaml")))
    return ()
