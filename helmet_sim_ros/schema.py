"""The base of everything a user configures: frozen, strict, and able to describe itself.

One description of each value (type, range, unit, meaning) serves validation, error messages,
ROS parameters, the command line and the documentation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from helmet_sim_ros.errors import Problem, SetupError, did_you_mean


@dataclass(frozen=True)
class Leaf:
    """One scalar or list value of a configuration, as a user names it."""

    name: str
    type: type
    default: Any
    unit: str
    description: str
    minimum: float | None = None
    maximum: float | None = None
    exclusive_minimum: bool = False
    choices: tuple[str, ...] = ()
    optional: bool = False
    length: int | None = None

    @property
    def allowed(self) -> str:
        """The allowed values in words, for errors and descriptions."""
        return _allowed(self)


class Config(BaseModel):
    """Frozen configuration record that refuses unknown keys, wrong types, NaN and infinity.

    Raises:
        SetupError: on construction, naming every refused key, its value and the allowed range.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def __init__(self, **data: Any) -> None:
        for name, value in data.items():
            if isinstance(value, Mapping):  # pydantic would pass them on as keyword arguments
                _refuse_foreign_keys(value, f"{name}.")
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise SetupError(list(_problems(type(self), error))) from None

    @model_validator(mode="before")
    @classmethod
    def _lists_become_tuples(cls, data: Any) -> Any:
        # YAML and JSON know lists only; a frozen record holds tuples.
        if not isinstance(data, Mapping):
            return data
        return {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}

    def __repr_args__(self) -> Iterator[tuple[str | None, object]]:
        """What differs from the defaults."""
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if field.is_required() or value != field.get_default(call_default_factory=True):
                yield name, value

    @classmethod
    def from_mapping(cls, data: object, source: str = "") -> Any:
        """Build from parsed YAML or JSON.

        Raises:
            SetupError: not a mapping, or a refused value; names ``source``.
        """
        if not isinstance(data, Mapping):
            kind = type(data).__name__  # and not what is in it: it may be any file of the machine
            raise SetupError.of("(document)", kind, "must be a mapping of keys to values", source)
        try:
            _refuse_foreign_keys(data)
            return cls(**data)
        except SetupError as error:
            raise error.within(source) from None

    def replaced(self, changes: Mapping[str, Any]) -> Any:
        """A copy with dotted keys (``"liner.density"``) replaced, validated again.

        Raises:
            SetupError: unknown key, or a refused value.
        """
        data = self.model_dump()
        known = _leaf_names(type(self))
        for key, value in changes.items():
            if key not in known:
                raise SetupError.of(key, value, f"unknown key; known: {_near(key, known)}")
            *path, last = key.split(".")
            group = data
            for part in path:
                group = group[part]
            group[last] = value
        return type(self)(**data)


def _refuse_foreign_keys(data: Mapping[Any, Any], prefix: str = "") -> None:
    for key, value in data.items():
        if not isinstance(key, str):
            raise SetupError.of(f"{prefix}{key}", value, "a key must be text")


def quantity(description: str, unit: str, default: Any = ..., **rules: float) -> Any:
    """A field that states what it means, its unit and its range (``ge``, ``gt``, ``le``)."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, **rules)  # type: ignore[call-overload]


def leaves(model: type[Config], prefix: str = "") -> list[Leaf]:
    """Every leaf value of a configuration class, depth first, with dotted names."""
    found: list[Leaf] = []
    for name, field in model.model_fields.items():
        inner = _inner_type(field)
        if isinstance(inner, type) and issubclass(inner, Config):
            found += leaves(inner, f"{prefix}{name}.")
        elif get_origin(inner) is not dict and inner is not dict:
            found.append(_leaf(f"{prefix}{name}", field))
    return found


def leaf_values(config: Config, prefix: str = "") -> dict[str, Any]:
    """The values of ``leaves(type(config))`` in this instance, by dotted name."""
    values: dict[str, Any] = {}
    for name in type(config).model_fields:
        value = getattr(config, name)
        if isinstance(value, Config):
            values |= leaf_values(value, f"{prefix}{name}.")
        elif not isinstance(value, dict):
            values[f"{prefix}{name}"] = value
    return values


def unit_of(field: FieldInfo) -> str:
    """The unit declared for a field, ``""`` where it has none."""
    extra = field.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def _inner_type(field: FieldInfo) -> Any:
    """The declared type without ``None``."""
    kind = field.annotation
    if get_origin(kind) in (Union, UnionType):
        kinds = [k for k in get_args(kind) if k is not NoneType]
        kind = kinds[0]
    return kind


def _leaf(name: str, field: FieldInfo) -> Leaf:
    inner = _inner_type(field)
    choices: tuple[str, ...] = ()
    length = None
    kind: Any = inner
    if get_origin(inner) is Literal:
        choices, kind = tuple(get_args(inner)), str
    elif get_origin(inner) is tuple:
        kinds = get_args(inner)
        length, kind = None if Ellipsis in kinds else len(kinds), tuple
    minimum = maximum = None
    exclusive = False
    for rule in field.metadata:
        if isinstance(rule, annotated_types.Ge):
            minimum = float(rule.ge)  # type: ignore[arg-type]
        elif isinstance(rule, annotated_types.Gt):
            minimum, exclusive = float(rule.gt), True  # type: ignore[arg-type]
        elif isinstance(rule, annotated_types.Le):
            maximum = float(rule.le)  # type: ignore[arg-type]
    optional = get_origin(field.annotation) in (Union, UnionType)
    return Leaf(
        name, kind, field.get_default(call_default_factory=True), unit_of(field),
        field.description or "", minimum, maximum, exclusive, choices, optional, length,
    )  # fmt: skip


def _allowed(leaf: Leaf) -> str:
    if leaf.choices:
        return "must be one of " + ", ".join(leaf.choices)
    unit = f" {leaf.unit}" if leaf.unit and leaf.unit != "-" else ""
    if leaf.type is tuple and leaf.length is None:
        return "must be a list"
    if leaf.type is tuple:
        return f"must be a list of {leaf.length} numbers{unit}"
    kind = {float: "a number", int: "an integer", str: "text", bool: "true or false"}.get(
        leaf.type, leaf.type.__name__
    )
    if leaf.minimum is not None and leaf.maximum is not None:
        low = "above " if leaf.exclusive_minimum else ""
        return f"must be {kind} from {low}{leaf.minimum:g} to {leaf.maximum:g}{unit}"
    if leaf.minimum is not None:
        return f"must be {kind} {'>' if leaf.exclusive_minimum else '>='} {leaf.minimum:g}{unit}"
    if leaf.maximum is not None:
        return f"must be {kind} <= {leaf.maximum:g}{unit}"
    return f"must be {kind}{unit}"


def _problems(model: type[Config], error: ValidationError) -> Iterator[Problem]:
    by_name = {leaf.name: leaf for leaf in leaves(model)}
    for item in error.errors():
        cause = item.get("ctx", {}).get("error")
        path = ".".join(str(p) for p in item["loc"] if isinstance(p, str))
        if isinstance(cause, SetupError):  # from a nested configuration, or a validator
            for problem in cause.problems:
                key = f"{path}.{problem.key}" if path else problem.key
                if cause.source:  # the file that a value of ours names is the one to mend
                    key = f"{cause.source}: {problem.key}"
                yield Problem(key, problem.value, problem.allowed)
        elif item["type"] == "extra_forbidden":
            known = {leaf.name for leaf in leaves(model)} | set(model.model_fields)
            yield Problem(path, item["input"], f"unknown key; known: {_near(path, known)}")
        elif item["type"] == "missing" and isinstance(item["loc"][-1], str):
            yield Problem(path, None, "is required")
        elif path in by_name:
            leaf = by_name[path]
            hint = did_you_mean(item["input"], leaf.choices)
            yield Problem(path, item["input"], leaf.allowed + hint)
        else:
            yield Problem(path, item["input"], item["msg"])


@lru_cache(maxsize=64)
def _leaf_names(model: type[Config]) -> frozenset[str]:
    """Names of a class's leaves; asked for in every setup of a sweep."""
    return frozenset(leaf.name for leaf in leaves(model))


def _near(key: str, known: Set[str]) -> str:
    """The known keys most like ``key``, else all of them; and which of them may be meant."""
    import difflib

    near = difflib.get_close_matches(key, known, 3, 0.6) or sorted(known)
    return ", ".join(near) + did_you_mean(key, known)
