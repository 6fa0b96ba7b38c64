"""Numbers with units as a reader of a page expects them: 11 490 rad/s², 3.06 kN, 6.3·10⁻⁵."""

from __future__ import annotations

import math
import re

#: Units that read better in a report: unit -> (shown unit, factor).
_SPOKEN = {
    "s": ("ms", 1e3), "m": ("mm", 1e3), "N": ("kN", 1e-3), "-": ("", 1.0),
    "rad/s^2": ("krad/s²", 1e-3),
}  # fmt: skip
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER = re.compile(r"\^(-?\d+)")
#: Between groups of digits, and between number and unit: no line break.
THIN, JOIN = "\u202f", "\u00a0"


def unit_text(unit: str) -> str:
    """``rad/s²`` for ``rad/s^2``; empty without dimension."""
    return "" if unit == "-" else pretty(unit)


def number(value: float, digits: int = 4) -> str:
    """A number with so many significant digits, true minus and powers, groups of thousands."""
    if not math.isfinite(value):
        return str(value)
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= exponent < max(6, digits):
        text = f"{value:.{max(0, digits - 1 - exponent)}f}"
        if exponent >= digits:  # further digits would say what is not known
            text = f"{round(value, digits - 1 - exponent):.0f}"
        if "." in text:
            text = text.rstrip("0").rstrip(".")
        whole, point, rest = text.partition(".")
        if len(whole.lstrip("-")) > 4:
            whole = f"{int(whole):,}".replace(",", THIN)
        text = whole + point + rest
    else:
        mantissa = f"{value / 10.0**exponent:.{digits - 1}f}".rstrip("0").rstrip(".")
        text = f"{mantissa}·10{str(exponent).translate(_RAISED)}"
    return text.replace("-", "−")


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """A number with its unit, in the unit that reads best: ``19.03 mm`` for 0.01903 m."""
    shown, factor = spoken(unit)
    return f"{number(value * factor, digits)}{JOIN}{shown}" if shown else number(value, digits)


def spoken(unit: str) -> tuple[str, float]:
    """The unit that reads best, and the factor to it."""
    return _SPOKEN.get(unit, (unit_text(unit), 1.0))


def pretty(text: str) -> str:
    """A sentence with true powers in its units: ``rad/s²`` for ``rad/s^2``."""
    return _POWER.sub(lambda match: match[1].translate(_RAISED), text)
