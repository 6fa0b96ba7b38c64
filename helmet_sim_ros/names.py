"""What a name that comes from outside may look like before it becomes the name of a file."""

from __future__ import annotations

import unicodedata

from helmet_sim_ros.errors import SetupError

#: Longest name of a file that Linux takes, and longest path [byte] (limits.h, less the end mark).
NAME_MAX = 255
PATH_MAX = 4095

#: Unicode's control, format (directions of writing among them), surrogate, private and unassigned
#: characters, and line and paragraph separators: what a reader cannot see or is misled by.
_HIDDEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


def check_path(key: str, text: str, longest: int = PATH_MAX) -> None:
    """Refuse a path, or any name, that a reader would not see as it is or no system takes.

    Args:
        key: what an error calls it.
        text: the path or name.
        longest: how many bytes it may have.

    Raises:
        SetupError: a hidden character, or too long; names the key and the rule.
    """
    for position, character in enumerate(text):
        if unicodedata.category(character) in _HIDDEN:
            raise SetupError.of(
                key, text,
                f"must not hold control or invisible characters (U+{ord(character):04X} at "
                f"{position})",
            )  # fmt: skip
    if len(text.encode()) > longest or any(len(p.encode()) > NAME_MAX for p in text.split("/")):
        raise SetupError.of(
            key, text, f"must have at most {longest} bytes, and {NAME_MAX} between two slashes"
        )


def check_file_name(key: str, name: str, longest: int) -> None:
    """Refuse what is no plain name of a file; arguments as for :func:`check_path`.

    Raises:
        SetupError: a directory in it, hidden, a character that nobody sees, or too long.
    """
    check_path(key, name, longest)
    if "/" in name or "\\" in name or name.startswith("."):
        raise SetupError.of(key, name, "must be a plain file name, without a directory")
