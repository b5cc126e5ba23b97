"""Reported numbers and their tidy table: each has its n and its unit of replication.

Values are in SI units; `netboard.analysis.topics.units` converts them for display.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import update_wrapper
from math import nan
from typing import Generic, TypeVar
from weakref import ref

import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import count, number, words


@dataclass(frozen=True, slots=True)
class Result:
    """A reported number and the limits of its interval, NaN for none, in its SI unit.

    The topic, such as ``learning``, is also the name of its figure; the interval is such as ``95 % t`` or ``SD``, or
    empty.
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


def plain(topic: str, quantity: str, group: str, value: float, unit: str, n: int, of: str, note: str = "") -> Result:
    """Return a number without an interval as a result."""
    return Result(topic, quantity, group, value, nan, nan, unit, "", n, of, note)


def cautioned(text: str, caution: str) -> str:
    """Return a text with a caution in brackets beside it; without a caution, the text alone."""
    return f"{text} ({caution})" if caution else text


RESULTS = (
    words("topic", "topic: the name of its figure"),
    words("quantity", "what it is"),
    words("group", "condition or group to which it refers"),
    number("value", "the number", "in column unit"),
    number("low", "lower end of its interval", "in column unit"),
    number("high", "upper end of its interval", "in column unit"),
    words("unit", "SI unit of value and interval"),
    words("interval", "kind of the interval; empty without one"),
    count("n", "number of units of replication"),
    words("of", "unit of replication"),
    words("note", "note on the interpretation"),
)
"""Columns of the table of results."""


def table_of(results: Iterable[Result]) -> pd.DataFrame:
    """Return results as a tidy table."""
    return pd.DataFrame([asdict(result) for result in results], columns=[field.name for field in RESULTS])


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TopicResults(Generic[T]):
    """What a topic computes of a study: its parts, such as one for each condition, and all numbers to report."""

    parts: tuple[T, ...]
    results: tuple[Result, ...]

    @classmethod
    def of(cls, parts: Iterable[T], report: Callable[[T], Iterable[Result]]) -> "TopicResults[T]":
        """Return parts with the numbers that a function reports of each."""
        found = tuple(parts)
        return cls(found, tuple(result for part in found for result in report(part)))


UNCOMPUTABLE = (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError)
"""Exceptions that unforeseen values raise in numpy, scipy, pandas and matplotlib."""

MAX_CACHED = 4
"""Studies whose results are cached: the reported one, and those pooled from it [1]."""


class cached(Generic[T]):  # noqa: N801  # a decorator
    """Cache a costly computation for the most recent studies, which must not be changed."""

    def __init__(self, compute: Callable[[StudyData], T]) -> None:
        self._compute = compute
        self._newest: deque[tuple[ref[StudyData], T]] = deque(maxlen=MAX_CACHED)
        update_wrapper(self, compute)

    def __call__(self, study: StudyData) -> T:
        """Return the result for a study."""
        if not any(reference() is study for reference, _ in self._newest):
            self.adopt(study, self._compute(study))
        return next(result for reference, result in self._newest if reference() is study)

    def kept(self, study: StudyData) -> T | None:
        """Return the result for a study if it is kept."""
        return next((result for reference, result in self._newest if reference() is study), None)

    def adopt(self, study: StudyData, result: T) -> None:
        """Keep the result for a study that another process has computed."""
        self._newest.append((ref(study), result))

    def __reduce__(self) -> str:
        """Let another process import it by its name."""
        return self._compute.__qualname__
