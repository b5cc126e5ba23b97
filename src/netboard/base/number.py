"""Numbers as people and programs write them in tables, options and the environment.

Decimal digits with a point and perhaps an exponent. Python's own readers also take ``1_000``, digits of other scripts,
``inf`` and ``nan``: with them the label ``1_1`` of a trial would be eleven. Settings are TOML, which has its own rules.
"""

import re
from math import isfinite

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,19}")


def number_of(word: str) -> float:
    """Return a finite number; raise ValueError for anything else."""
    if not _NUMBER.fullmatch(word) or not isfinite(value := float(word)):
        raise ValueError(f"{word}: is no finite number")
    return value


def whole_of(word: str) -> int:
    """Return a whole number, written in digits; raise ValueError for anything else."""
    if not _WHOLE.fullmatch(word):
        raise ValueError(f"{word}: is no whole number")
    return int(word)
