"""Formatting of numbers and names: sensible digits and no invisible characters.

Numbers follow American English, with a true minus sign. Names come from participants, experimenters and file systems:
invisible characters and those that change the text direction are shown by code point.
"""

import re
import unicodedata
from math import floor, isfinite, log10

from netboard.base.plural import noun

NONE = "–"
"""Text for a missing number."""

_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
_FINEST = 6


def visible(text: str) -> str:
    """Return text with control characters, direction marks and lone surrogates made visible, as ``[U+202E]``."""
    if text.isprintable():
        return text
    return "".join(f"[U+{ord(c):04X}]" if c not in "\n\t" and unicodedata.category(c) in _UNSEEN else c for c in text)


def decimals(*values: float, digits: int = 3) -> int:
    """Return the common number of decimals for numbers shown together, with `digits` for the largest one."""
    largest = max((abs(value) for value in values if isfinite(value)), default=0.0)
    if largest == 0.0:
        return 0
    return min(max(digits - 1 - floor(log10(largest)), 0), _FINEST)


def amount(value: float, places: int | None = None) -> str:
    """Return a number as text; by default without decimals if whole, otherwise with enough for three digits.

    A number that the finest number of decimals would turn into 0 is written with a power of ten.
    """
    if not isfinite(value):
        return NONE if value != value else "∞" if value > 0 else "−∞"  # noqa: PLR0124  # NaN differs from itself
    if isinstance(value, int) or (places is None and float(value).is_integer()):
        places = 0
    elif places is None:
        places = decimals(value)
    if places >= _FINEST and 0 < abs(value) < 0.5 * 10**-_FINEST:
        base, _, power = f"{value:.2e}".partition("e")
        return f"{base} × 10^{int(power)}".replace("-", "−")
    text = f"{value:,.{places}f}"
    return text.replace("-", "−") if float(text.replace(",", "")) else text.removeprefix("-")


def plural(n: int, of: str) -> str:
    """Return a count with its noun."""
    return f"{amount(n)} {noun(n, of)}".strip()


def percent(share: float) -> str:
    """Return a share as a percentage."""
    return f"{amount(round(100.0 * share, 6))}\N{NO-BREAK SPACE}%"


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def css_text(text: str) -> str:
    """Return a text as a CSS string that no content can terminate."""
    return '"' + re.sub(r"[^A-Za-z0-9 ]", lambda found: f"\\{ord(found[0]):x} ", visible(text)) + '"'
