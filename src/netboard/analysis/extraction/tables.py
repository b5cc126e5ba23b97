"""Tables of measures: their rows, and their columns with kinds, units and meanings.

A column holds integers, numbers (NaN: the attempt has no such measure) or texts.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.trials import AttemptData
from netboard.base.tables.declared import require
from netboard.recording.format.channels import DTYPES, Field

if TYPE_CHECKING:
    import pandas as pd

Columns = dict[str, NDArray[Any]]
"""Table in memory: columns of equal length by name [SI]."""


@dataclass(frozen=True, slots=True)
class Group:
    """Measures of an attempt that are computed together; `measure` returns none if the attempt does not allow them.

    `of_hands`: whether the hands and the recorded ball determine them, so that controls have them, too
    (`netboard.analysis.extraction.controls`).
    """

    fields: tuple[Field, ...]
    measure: Callable[[AttemptData], Mapping[str, float | int | str]]
    of_hands: bool = False

    def of(self, take: AttemptData) -> Mapping[str, float | int | str]:
        """Return the measures of an attempt; all NaN if it has none."""
        names = [field.name for field in self.fields]
        if found := self.measure(take):
            require(f"{self.measure.__name__} in analysis/extraction/attempts.py", found, names)
        return found or dict.fromkeys(names, np.nan)


def number(name: str, text: str, unit: str) -> Field:
    """Describe a column of numbers."""
    return Field(name, "number", text, unit)


def count(name: str, text: str) -> Field:
    """Describe a column of integers."""
    return Field(name, "integer", text, "1")


def words(name: str, text: str) -> Field:
    """Describe a column of texts."""
    return Field(name, "string", text, "")


def columns_of(fields: tuple[Field, ...], rows: Sequence[Mapping[str, Any]]) -> Columns:
    """Convert rows to columns."""
    return {field.name: np.array([row[field.name] for row in rows], DTYPES[field.kind]) for field in fields}


def written(frame: "pd.DataFrame", fields: Sequence[Field]) -> Columns:
    """Return the columns of a table in their written form."""
    return {field.name: frame[field.name].to_numpy(DTYPES[field.kind]) for field in fields}


@dataclass(frozen=True, slots=True)
class TableKind:
    """A table that is written: its name, the meaning of a row, and its columns."""

    name: str
    about: str
    fields: tuple[Field, ...]


PLACE = (
    words("recording", "name of the recording"),
    count("trial", "number of the trial in its block, from 1"),
    count("attempt", "number of the attempt at it, from 1"),
)
"""Columns that locate a row of trials, movements and paths: recording, trial and attempt."""

ATTEMPT_KEY = [field.name for field in PLACE]
"""Names of the columns that identify an attempt."""
