"""The tables of measures: what a row is, and the columns with their kinds, units and meanings.

A column is an integer, a number (NaN: the attempt has no such measure), or a text.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.trials import Take
from netboard.recording.format.channels import Field

Columns = dict[str, NDArray[Any]]
"""A table in memory: columns of equal length by name [SI]."""


@dataclass(frozen=True, slots=True)
class Group:
    """Measures of an attempt that are computed together."""

    fields: tuple[Field, ...]
    measure: Callable[[Take], Mapping[str, float | int | str]]


def number(name: str, text: str, unit: str) -> Field:
    """Describe a column of numbers."""
    return Field(name, "number", text, unit)


def count(name: str, text: str) -> Field:
    """Describe a column of integers."""
    return Field(name, "integer", text, "1")


def words(name: str, text: str) -> Field:
    """Describe a column of texts."""
    return Field(name, "string", text, "")


DTYPES = {"integer": np.dtype(np.int64), "number": np.dtype(np.float64), "string": np.dtype(object)}
"""Type of each kind of column."""


def columns_of(fields: tuple[Field, ...], rows: Sequence[Mapping[str, Any]]) -> Columns:
    """Make columns of rows."""
    return {field.name: np.array([row[field.name] for row in rows], DTYPES[field.kind]) for field in fields}


PLACE = (
    words("recording", "name of the recording"),
    count("trial", "number of the trial in its block, from 1"),
    count("attempt", "number of the attempt at it, from 1"),
)
"""Where a row of trials, movements and paths is from."""
