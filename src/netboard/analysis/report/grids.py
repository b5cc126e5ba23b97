"""Tables of a report for the page template: caption, columns, and rows of texts, numbers and links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from netboard.analysis.report.wording import amount

Kind = Literal["text", "name", "number", "code"]
"""Content of a column: the report's words, names chosen by others, numbers, or machine-readable text."""


@dataclass(frozen=True, slots=True)
class GridColumn:
    """A column of a table."""

    title: str
    kind: Kind = "text"


@dataclass(frozen=True, slots=True)
class CellLink:
    """A cell with a link to another place in the report."""

    text: str
    to: str


Cell = str | CellLink


@dataclass(frozen=True, slots=True)
class Grid:
    """A table of the report."""

    caption: str
    columns: tuple[GridColumn, ...]
    rows: tuple[tuple[Cell, ...], ...]
    marked: frozenset[int] = frozenset()


def grid(caption: str, columns: Sequence[GridColumn], rows: Sequence[Sequence[Cell | float]]) -> Grid:
    """Return a table."""
    written = tuple(tuple(cell if isinstance(cell, str | CellLink) else amount(cell) for cell in row) for row in rows)
    return Grid(caption, tuple(columns), written)


def grid_of(caption: str, rows: Sequence[Mapping[GridColumn, Cell | float]]) -> Grid:
    """Return a table of one or more rows, each with its cells by column."""
    return grid(caption, tuple(rows[0]), [tuple(row.values()) for row in rows])


def number(title: str) -> GridColumn:
    """Return a column of numbers."""
    return GridColumn(title, "number")


def name(title: str) -> GridColumn:
    """Return a column of names that others have chosen."""
    return GridColumn(title, "name")


def code(title: str) -> GridColumn:
    """Return a column of machine-readable text."""
    return GridColumn(title, "code")
