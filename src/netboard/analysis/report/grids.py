"""Tables of a report, as the page's template takes them: a caption, columns, and rows of texts, numbers and links."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from netboard.analysis.report.wording import amount

Kind = Literal["text", "name", "number", "code"]
"""What a column holds: words of the report, words of others, numbers, or what a machine reads."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column."""

    title: str
    kind: Kind = "text"


@dataclass(frozen=True, slots=True)
class Link:
    """A cell that leads to another place of the report."""

    text: str
    to: str


Cell = str | Link


@dataclass(frozen=True, slots=True)
class Grid:
    """A table."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    marked: frozenset[int] = frozenset()


def grid(caption: str, columns: Sequence[Column], rows: Sequence[Sequence[Cell | float]]) -> Grid:
    """Make a table."""
    written = tuple(tuple(cell if isinstance(cell, str | Link) else amount(cell) for cell in row) for row in rows)
    return Grid(caption, tuple(columns), written)


def number(title: str) -> Column:
    """Describe a column of numbers."""
    return Column(title, "number")


def name(title: str) -> Column:
    """Describe a column of words that others have chosen."""
    return Column(title, "name")


def code(title: str) -> Column:
    """Describe a column of what a machine reads."""
    return Column(title, "code")
