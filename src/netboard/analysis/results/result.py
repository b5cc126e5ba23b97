"""A number that is reported, and the tidy table of all of them: none without its n and its unit of replication."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import wraps
from typing import TypeVar
from weakref import ref

import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.extraction.tables import count, number, words


@dataclass(frozen=True, slots=True)
class Result:
    """A reported number.

    Attributes
    ----------
    topic : str
        What it belongs to, such as ``learning``: one word, that of its picture.
    value : float
        The number; NaN where there is none [its unit].
    low, high : float
        Ends of its interval; NaN without one [its unit].
    interval : str
        What the interval is, such as ``95 % t`` or ``SD``; empty without one.
    """

    topic: str
    quantity: str
    group: str
    value: float
    low: float
    high: float
    unit: str
    interval: str
    n: int
    of: str
    note: str = ""


RESULTS = (
    words("topic", "what it belongs to: the name of a picture"),
    words("quantity", "what it is"),
    words("group", "of whom and when"),
    number("value", "the number", "in column unit"),
    number("low", "lower end of its interval", "in column unit"),
    number("high", "upper end of its interval", "in column unit"),
    words("unit", "SI unit of the three"),
    words("interval", "what the interval is; empty without one"),
    count("n", "of how many it is made"),
    words("of", "of what: the unit of replication"),
    words("note", "what must be known to read it"),
)
"""Columns of the table of results."""


def table_of(results: Iterable[Result]) -> pd.DataFrame:
    """Make the tidy table."""
    return pd.DataFrame([asdict(result) for result in results], columns=[field.name for field in RESULTS])


UNCOMPUTABLE = (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError)
"""What numbers that nobody foresaw raise, in numpy, scipy, pandas and matplotlib."""

T = TypeVar("T")


MOST_KEPT = 4
"""Studies whose findings are kept: the one that is reported, and those pooled from it [1]."""


def kept(find: Callable[[Study], T]) -> Callable[[Study], T]:
    """Let a costly finding, which nobody changes, be computed once for the results and figures of a study."""
    newest: deque[tuple[ref[Study], T]] = deque(maxlen=MOST_KEPT)

    @wraps(find)
    def once(study: Study) -> T:
        for of, found in newest:
            if of() is study:
                return found
        newest.append((ref(study), find(study)))
        return newest[-1][1]

    return once
