"""Griffe extension: makes the docstrings of the package readable for mkdocstrings.

Cross references, ``:func:`~package.name```, become links; one on a page to something that does not
exist ends a strict build. Entries for several arguments at once, ``a, b: text``, become one each.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_ROLE = re.compile(r":(?:func|class|meth|mod|attr|data):`([^`]+)`")
_SEVERAL = re.compile(
    r"^( +)(\w+(?:, \w+)+): (.*(?:\n(?:\1 +\S.*))*)$",  # with the lines that continue it
    re.MULTILINE,
)


class Docstrings(griffe.Extension):
    """Rewrites the docstrings of a package once it is loaded."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Rewrite every docstring of a package."""
        self._package = pkg
        self._walk(pkg)

    def _walk(self, thing: griffe.Object) -> None:
        if thing.docstring is not None:
            text = _SEVERAL.sub(_one_each, thing.docstring.value)
            thing.docstring.value = _ROLE.sub(lambda match: self._link(thing, match[1]), text)
        for member in thing.members.values():
            if isinstance(member, griffe.Object):
                self._walk(member)

    def _link(self, where: griffe.Object, written: str) -> str:
        short, name = written.startswith("~"), written.lstrip("~")
        shown = name.rpartition(".")[2] if short else name
        target = self._target(where, name)
        # One that exists need not stand on a page; one that does not exist is a broken link.
        found = f'identifier="{name}"' if target is None else f'identifier="{target}" optional'
        return f"<autoref {found}><code>{shown}</code></autoref>"

    def _target(self, where: griffe.Object, name: str) -> str | None:
        """The full path of what a name means at some place; None if it means nothing."""
        scope: griffe.Object | None = where
        scopes = [f"{self._package.path}.{name}", name]
        while scope is not None:
            scopes.append(f"{scope.path}.{name}")
            scope = scope.parent if isinstance(scope.parent, griffe.Object) else None
        return next(filter(None, (self._find(path) for path in reversed(scopes))), None)

    def _find(self, path: str) -> str | None:
        prefix = f"{self._package.path}."
        if not path.startswith(prefix):
            return None
        try:
            found = self._package[path.removeprefix(prefix)]
            return str(found.final_target.path if found.is_alias else found.path)
        except (KeyError, griffe.AliasResolutionError, griffe.CyclicAliasError):
            return None


def _one_each(match: re.Match[str]) -> str:
    indent, names, text = match.groups()
    return "\n".join(f"{indent}{name}: {text}" for name in names.split(", "))
