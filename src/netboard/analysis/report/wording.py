"""Numbers and names as a reader meets them: sensible digits, and no character that hides what is there.

Numbers are written as in American English, with a true minus sign. Names come from participants, experimenters and file
systems: a character that is not seen, or that turns the direction of what follows, is shown as its number.
"""

import re
import shlex
import unicodedata
from math import floor, isfinite, log10

NONE = "–"
"""Where there is no number."""

_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
_FINEST = 6
_PLURALS = {"person": "people", "": ""}


def visible(text: str) -> str:
    """Show what would not be seen, or would change what is.

    Returns
    -------
    str
        The text with control characters, marks of direction and lone surrogates as ``[U+202E]``.
    """
    if text.isprintable():
        return text
    return "".join(f"[U+{ord(c):04X}]" if c not in "\n\t" and unicodedata.category(c) in _UNSEEN else c for c in text)


def decimals(*values: float, digits: int = 3) -> int:
    """Say how many decimals numbers need that are read together.

    Parameters
    ----------
    digits : int
        How many digits that one is to have at least [1].
    """
    largest = max((abs(value) for value in values if isfinite(value)), default=0.0)
    if largest == 0.0:
        return 0
    return min(max(digits - 1 - floor(log10(largest)), 0), _FINEST)


def amount(value: float, places: int | None = None) -> str:
    """Write a number.

    Parameters
    ----------
    places : int, optional
        Decimals; of a whole number none, of another as many as make three digits [1].
    """
    if not isfinite(value):
        return NONE if value != value else "∞" if value > 0 else "−∞"  # noqa: PLR0124  # NaN differs from itself
    if isinstance(value, int) or (places is None and float(value).is_integer()):
        places = 0
    elif places is None:
        places = decimals(value)
        if 0 < abs(value) < 0.5 * 10**-_FINEST:
            base, _, power = f"{value:.2e}".partition("e")
            return f"{base} × 10^{int(power)}".replace("-", "−")
    text = f"{value:,.{places}f}"
    return text.replace("-", "−") if float(text.replace(",", "")) else text.removeprefix("-")


def counted(n: int, of: str) -> str:
    """Write how many of something."""
    word = of if n == 1 else _PLURALS.get(of, f"{of}s")
    return f"{amount(n)} {word}".strip()


def command(*words: str) -> str:
    """Write a command that a shell takes as it is meant.

    Returns
    -------
    str
        One line; a word with characters that are not seen has them as escapes, as bash and zsh read them.
    """
    return " ".join(shlex.quote(word) if word.isprintable() else _escaped(word) for word in words)


def _escaped(word: str) -> str:
    """Quote a word with escapes for all that is not plain."""
    data = word.encode("utf-8", "surrogateescape")
    return "$'" + "".join(chr(b) if 32 <= b < 127 and chr(b) not in "'\\" else f"\\x{b:02x}" for b in data) + "'"


def css_text(text: str) -> str:
    """Write a text as a string of a style sheet, which nothing in it can end."""
    return '"' + re.sub(r"[^A-Za-z0-9 ]", lambda found: f"\\{ord(found[0]):x} ", visible(text)) + '"'
