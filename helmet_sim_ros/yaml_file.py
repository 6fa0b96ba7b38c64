"""YAML as a user means it: ``2e-5`` is a number, and a key given twice is an error.

A text is looked through before anything is built from it: what is too large, nested too deep,
multiplied by aliases or of a type that no configuration has is refused at once.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from helmet_sim_ros.errors import SetupError

#: Largest text [byte], most values in it with every alias written out, deepest nesting: choices,
#: so that any file is read or refused within a second. The largest shipped file has 1.6 kB.
LARGEST = 2**19
MOST_VALUES = 30_000
DEEPEST = 40
#: Types that a value may name; all others (dates, sets, binary, Python objects) are refused.
_TAGS = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "seq",
                                                  "map")}  # fmt: skip

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same, ten times faster


class _Loader(_Base):  # type: ignore[misc]
    """Safe loader; YAML 1.1 would read ``2e-5`` as text and keep the last of two equal keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _refused("a key must be a single value", key.start_mark)
            if key.value in seen:
                raise _refused(f"key {key.value!r:.80} is given twice", key.start_mark)
            seen.add(key.value)
        found: dict[Any, Any] = super().construct_mapping(node, deep)
        for key in found:
            if not isinstance(key, str):
                raise _refused(f"a key must be text, quote {key!r:.80}", node.start_mark)
        return found

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, TypeError, AttributeError, LookupError, OverflowError):
            kind = node.tag.rpartition(":")[2]
            raise _refused(f"not a value of type {kind}", node.start_mark) from None


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
# A date is text: no configuration has one.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in forms if not tag.endswith(":timestamp")]
    for first, forms in _Loader.yaml_implicit_resolvers.items()
}


def parse_yaml(text: str) -> Any:
    """The value of a YAML text: lists, mappings, text, numbers, true, false and null only.

    Raises:
        yaml.YAMLError: not YAML, a key given twice, or more than a configuration can be (size,
            nesting, aliases, types). The text itself is not quoted.
    """
    if len(text) > LARGEST or len(text.encode("utf-8", "surrogatepass")) > LARGEST:
        raise _refused(f"larger than {LARGEST} bytes")
    try:
        _look_through(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        words = " ".join(filter(None, (error.context, error.problem))) or "not YAML"
        raise _refused(words, error.problem_mark) from None
    except yaml.reader.ReaderError as error:
        raise _refused(f"{error.reason} at character {error.position + 1}") from None
    except UnicodeEncodeError as error:
        raise _refused(f"{error.reason} at character {error.start + 1}") from None


def read_yaml(path: Path, key: str) -> Any:
    """The value of a YAML file; ``key`` is what an error calls it (``"scenario"``).

    Raises:
        SetupError: unreadable, not text, or refused as by :func:`parse_yaml`.
    """
    try:
        with open(path, "rb") as stream:
            data = stream.read(LARGEST + 1)  # never more, also of an endless file
        return parse_yaml(data.decode("utf-8-sig"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        if isinstance(error, UnicodeDecodeError):
            reason = f"not UTF-8 text at byte {error.start}"
        raise SetupError.of(key, str(path), f"cannot be read: {reason}") from error


class _Open(NamedTuple):
    """A list or mapping under way, and how many values stand before it."""

    anchor: str | None
    before: int


def _look_through(text: str) -> None:
    """Refuse too many values, too deep nesting and foreign types, without building anything."""
    sizes: dict[str, int] = {}  # of what each anchor stands for
    stack: list[_Open] = []
    total = 0
    for event in yaml.parse(text, Loader=_Base):
        mark, size = event.start_mark, 0
        if isinstance(event, yaml.CollectionEndEvent):
            done = stack.pop()
            if done.anchor is not None:
                sizes[done.anchor] = total - done.before
        elif isinstance(event, yaml.AliasEvent):
            if any(level.anchor == event.anchor for level in stack):
                raise _refused(f"*{event.anchor:.80} stands inside itself", mark)
            size = sizes.get(str(event.anchor), 1)
        elif isinstance(event, yaml.NodeEvent):
            tag = getattr(event, "tag", None)
            if tag not in (None, "!") and tag not in _TAGS:
                raise _refused(f"type {tag!r:.80} is none that a value here can have", mark)
            size = 1
            if isinstance(event, yaml.CollectionStartEvent):
                stack.append(_Open(event.anchor, total))
                if len(stack) > DEEPEST:
                    raise _refused(f"nested deeper than {DEEPEST} levels", mark)
            elif event.anchor is not None:
                sizes[event.anchor] = 1
        total += size
        if total > MOST_VALUES:
            raise _refused(f"more than {MOST_VALUES} values, aliases written out", mark)


def _refused(problem: str, mark: Any = None) -> yaml.YAMLError:
    where = "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"
    return yaml.YAMLError(problem + where)
