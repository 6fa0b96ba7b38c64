"""ROS parameters made from the values of a configuration, validated as a whole."""

from __future__ import annotations

import difflib
import sys
from array import array
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from helmet_sim_ros.errors import HelmetSimError, SetupError
from helmet_sim_ros.schema import Leaf

T = TypeVar("T")
Values = dict[str, Any]

#: How a node with :class:`Parameters` is created. rclpy then shows values of the command line
#: before they have a type, and leaves the refusal of unknown names to us, who can name near ones.
NODE_OPTIONS = {
    "automatically_declare_parameters_from_overrides": True,
    "allow_undeclared_parameters": True,
}

#: Parameter of every node.
CONFIG_PATHS = Leaf(
    "config_paths", tuple, (), "",
    "files, and folders of files, that clients may name beside those in config/; read-only",
)  # fmt: skip

#: Parameters that ROS itself declares on every node.
_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")
#: How much text is read as a list, in characters.
LONGEST_LIST = 1000
#: Values that stay as they were at the start.
_FIXED = (CONFIG_PATHS.name,)
_UNSET_WORDS = ("", "none", "null", "unset")


class Parameters(Generic[T]):
    """The parameters of one node.

    The node must be created with :data:`NODE_OPTIONS`.

    Args:
        node: the node that gets the parameters.
        leaves: name, type, unit, range and default of each.
        build: makes the configuration of all values; refuses with a :class:`SetupError`.
        expand: adds to the changes of one call those that follow from them; sees the changes and
            the values before.
        refuse: a reason to refuse every change now, or ``""``.
        changed: called after a change.

    Attributes:
        value: the present configuration.

    Raises:
        SetupError: an unknown or refused value from the command line or a parameter file.
    """

    def __init__(
        self,
        node: Node,
        leaves: Sequence[Leaf],
        build: Callable[[Values], T],
        expand: Callable[[Values, Values], Values] = lambda changes, before: changes,
        refuse: Callable[[], str] = lambda: "",
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self._node = node
        self._leaves = {leaf.name: leaf for leaf in (*leaves, CONFIG_PATHS)}
        self._make = build
        self._expand, self._refuse, self._changed = expand, refuse, changed
        defaults = {name: leaf.default for name, leaf in self._leaves.items()}
        given = {name: coerced(self._leaves[name], v) for name, v in self._given().items()}
        self._values = defaults | expand(given, defaults)
        self.value = self._build(self._values)
        self._next = self._values, self.value
        for name in self._leaves:
            self._declare(name)
        node.add_pre_set_parameters_callback(self._before)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._after)

    def _build(self, values: Values) -> T:
        return self._make({name: v for name, v in values.items() if name not in _FIXED})

    def _given(self) -> Values:
        """Take the values of the command line and of parameter files off the node."""
        given = {}
        for name, parameter in self._node.get_parameters_by_prefix("").items():
            if name in self._leaves:
                given[name] = parameter.value
                self._node.undeclare_parameter(name)
            elif not name.startswith(_OF_ROS):
                raise self._unknown(name, parameter.value)
        return given

    def _unknown(self, name: str, value: Any) -> SetupError:
        near = difflib.get_close_matches(name, self._leaves, 3, 0.5) or sorted(self._leaves)
        return SetupError.of(name, value, "unknown parameter; known: " + ", ".join(near))

    def _declare(self, name: str) -> None:
        value = self._values[name]
        if isinstance(value, tuple):
            value = list(value)
        leaf = self._leaves[name]
        self._node.declare_parameter(name, value, described(leaf), ignore_override=True)

    def _before(self, parameters: list[Parameter]) -> list[Parameter]:
        """Accept what is plainly meant (7 for 7.0), and add what follows."""
        own = {p.name: p.value for p in parameters if p.name in self._leaves}
        others = [p for p in parameters if p.name not in own]
        changes = {name: coerced(self._leaves[name], value) for name, value in own.items()}
        # Whatever is wrong is refused in _check, which gives a reason: what is raised here would
        # leave the client without any answer.
        with suppress(Exception):
            changes = self._expand(changes, self._values)
        return others + [_parameter(name, value) for name, value in changes.items()]

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        strange = [p for p in parameters if p.name not in self._leaves]
        strange = [p for p in strange if not p.name.startswith(_OF_ROS)]
        changes = {p.name: _plain(p.value) for p in parameters if p.name in self._leaves}
        reason = self._refuse() if changes else ""
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        try:
            if strange:
                raise self._unknown(strange[0].name, strange[0].value)
            if changes:
                values = self._values | changes
                if values != self._next[0]:
                    self._next = values, self._build(values)
        except HelmetSimError as error:
            reason = str(error)
            if not any(p.name in reason for p in parameters):  # a value that was there before
                reason = f"{_shown(changes)} does not go with {reason}"
            return SetParametersResult(successful=False, reason=reason)
        except Exception as error:
            reason = f"{_shown(changes)}: unexpected {type(error).__name__}: {error}"
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _after(self, parameters: list[Parameter]) -> None:
        changes = [p.name for p in parameters if p.name in self._leaves]
        if not changes:
            return
        self._values, self.value = self._next
        # rclpy removes a parameter that is unset; declaring it calls this again for it.
        missing = [name for name in changes if not self._node.has_parameter(name)]
        for name in missing:
            self._declare(name)
        if not missing:
            self._changed()


def config_paths(node: Node) -> list[Path]:
    """The files and folders that the operator of a node with :class:`Parameters` named.

    Raises:
        SetupError: one of them is not there.
    """
    given = node.get_parameter(CONFIG_PATHS.name).value or ()
    paths = [
        Path(text).expanduser() for text in ([given] if isinstance(given, str) else given) if text
    ]
    for path in paths:
        if not path.exists():
            raise SetupError.of(CONFIG_PATHS.name, str(path), "no such file or folder")
    return paths


def _shown(changes: Values) -> str:
    return ", ".join(f"{name} = {value!r:.40}" for name, value in sorted(changes.items()))


def described(leaf: Leaf) -> ParameterDescriptor:
    """Meaning, unit and range of a parameter.

    The type is left dynamic: a wrong one is refused by the configuration, which names key, value
    and allowed range, and an optional value can be unset.
    """
    unit = f" [{leaf.unit}]" if leaf.unit else ""
    descriptor = ParameterDescriptor(
        name=leaf.name,
        description=leaf.description + unit,
        additional_constraints=leaf.allowed,
        dynamic_typing=True,
        read_only=leaf.name in _FIXED,
    )
    if leaf.type is float:
        low = -sys.float_info.max if leaf.minimum is None else leaf.minimum
        high = sys.float_info.max if leaf.maximum is None else leaf.maximum
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif leaf.type is int:
        low = -(2**63) if leaf.minimum is None else int(leaf.minimum)
        high = 2**63 - 1 if leaf.maximum is None else int(leaf.maximum)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor


def coerced(leaf: Leaf, value: Any) -> Any:
    """A value as its leaf wants it where the meaning is plain, else unchanged."""
    value = _plain(value)
    if isinstance(value, str) and leaf.optional and value.strip().lower() in _UNSET_WORDS:
        return None
    if leaf.type is float and isinstance(value, int | str) and not isinstance(value, bool):
        try:
            return float(value)  # 7, and 2e-5, which YAML takes for text
        except ValueError:
            return value
    if leaf.type is tuple:
        return _vector(leaf, value)
    if leaf.type is str and type(value) is int:
        return str(value)
    if leaf.type is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _vector(leaf: Leaf, value: Any) -> Any:
    if isinstance(value, str):  # the command line takes [1, 0.5] for text
        try:
            value = yaml.safe_load(value[:LONGEST_LIST])
        except (yaml.YAMLError, ValueError, RecursionError):
            return value
    numbers = (int, float)
    if leaf.length and isinstance(value, list | tuple) and all(type(v) in numbers for v in value):
        return tuple(map(float, value))
    return tuple(value) if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, array | list) else value


def _parameter(name: str, value: Any) -> Parameter:
    try:
        return Parameter(name, value=list(value) if isinstance(value, tuple) else value)
    except TypeError:  # no type of ROS: refused as text, with the key and what is allowed
        return Parameter(name, value=str(value))


def renamed(leaves: Sequence[Leaf], prefix: str) -> list[Leaf]:
    """The leaves with a prefix to their names."""
    return [replace(leaf, name=prefix + leaf.name) for leaf in leaves]


def without_prefix(values: Mapping[str, Any], prefix: str) -> Values:
    """The values below a prefix, without it."""
    return {k.removeprefix(prefix): v for k, v in values.items() if k.startswith(prefix)}
