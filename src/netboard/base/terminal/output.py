"""The terminal, and the tables on it; no other module makes any.

Every row can be identified at any width. The columns that identify a row come first and are never cut: not
shortened with an ellipsis, and folded only where they alone are wider than the terminal. Numbers are never broken. Text
wraps. Columns that still do not fit follow in a second table below, in which the identifying columns are repeated.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

Cell = str | Text
"""Content of a cell: plain text without markup, or styled text."""

GAP = 2
"""Spaces between columns."""

NARROWEST = 24
"""Smallest width to which text is wrapped, in characters."""

WIDEST_NAMES = 2 / 3
"""Columns that identify a row are wrapped only if they take more than this share of the terminal."""


def plain_console(*, stderr: bool = False, soft_wrap: bool = False) -> Console:
    """Return a terminal that prints text as it is: in a path or a note, rich would take ``[words]`` for markup."""
    return Console(stderr=stderr, soft_wrap=soft_wrap, highlight=False, markup=False)


def as_cell(value: str | float | int | bool) -> str:
    """Format a value of a table of results, a number with three digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class TableHeading:
    """Heading of a column, and whether it holds numbers, which are right-aligned and not wrapped."""

    heading: str
    number: bool = False


def numbers(*headings: str) -> tuple[TableHeading, ...]:
    """Return columns of numbers."""
    return tuple(TableHeading(heading, number=True) for heading in headings)


class FittedTable:
    """A table that fits the terminal on which it is printed.

    ``*columns``: heads of the columns; a str is the head of a column of text. The first one identifies a row, together
    with as many of those after it as it takes to tell the rows apart.
    """

    def __init__(
        self,
        *columns: str | TableHeading,
        rows: Iterable[Sequence[Cell]] = (),
        title: str = "",
        caption: str = "",
        header: bool = True,
    ) -> None:
        self.columns = tuple(TableHeading(column) if isinstance(column, str) else column for column in columns)
        self.title, self.caption, self.header = title, caption, header
        self.rows: list[tuple[Text, ...]] = []
        self._styles: list[str] = []
        self._sections: set[int] = set()
        for row in rows:
            self.add_row(*row)

    def add_row(self, *cells: Cell, style: str = "") -> None:
        """Add a row; cells that are missing at its end are empty."""
        if len(cells) > len(self.columns):
            raise ValueError(f"cells: found {len(cells)}, expected at most {len(self.columns)}")
        texts = [cell if isinstance(cell, Text) else Text(cell) for cell in cells]
        texts += [Text("") for _ in range(len(self.columns) - len(texts))]
        self.rows.append(tuple(texts))
        self._styles.append(style)

    def end_section(self) -> None:
        """Insert a blank line before the next row."""
        self._sections.add(len(self.rows))

    @property
    def names(self) -> int:
        """Return how many leading columns identify a row; 1 if no number of them does."""
        for count in range(1, len(self.columns)):
            if len({tuple(cell.plain for cell in row[:count]) for row in self.rows}) == len(self.rows):
                return count
        return 1

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Print one table, or several below each other."""
        width = options.max_width
        limits = self._limits(width)
        if self.title:
            yield Text(self.title, "bold")
        for group in self._groups(limits, width) if self.rows else ():
            yield self._table(group, _widths([limits[place] for place in group], width))
            yield Text("")
        if self.caption:
            yield Text(self.caption, "italic")

    def _groups(self, limits: Sequence[tuple[int, int]], width: int) -> Iterator[list[int]]:
        """Return the groups of columns that fit side by side."""
        names = list(range(self.names))
        group = list(names)
        for place in range(len(names), len(self.columns)):
            if len(group) > len(names) and _least([limits[column] for column in (*group, place)]) > width:
                yield group
                group = list(names)
            group.append(place)
        yield group

    def _limits(self, width: int) -> list[tuple[int, int]]:
        """Return minimal and natural widths of all columns."""
        limits = [self._limits_of(place) for place in range(len(self.columns))]
        names = self.names
        room = round(width * WIDEST_NAMES)
        for cap in range(room, 0, -1):
            capped = [min(most, cap) for _, most in limits[:names]]
            if sum(capped) + GAP * names <= room:
                return [(most, most) for most in capped] + limits[names:]
        return limits

    def _limits_of(self, place: int) -> tuple[int, int]:
        """Return minimal and natural width of a column."""
        column, heading = self.columns[place], self.columns[place].heading if self.header else ""
        head = max((cell_len(word) for word in heading.split()), default=1)
        most = max([head, *(cell_len(line) for row in self.rows for line in row[place].plain.splitlines())])
        whole = max(most, *(cell_len(line) for line in heading.splitlines() or [""]))
        return (most if column.number else max(head, min(most, NARROWEST))), whole

    def _table(self, group: Sequence[int], widths: Sequence[int]) -> Table:
        """Return the table of some columns."""
        table = Table(
            box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), show_header=self.header
        )
        for place, width in zip(group, widths, strict=True):
            column = self.columns[place]
            justify: Literal["left", "right"] = "right" if column.number else "left"
            table.add_column(Text(column.heading), justify=justify, width=width, overflow="fold")
        for number, (row, style) in enumerate(zip(self.rows, self._styles, strict=True)):
            if number and number in self._sections:
                table.add_row()
            table.add_row(*(row[place] for place in group), style=style)
        return table


def _least(limits: Sequence[tuple[int, int]]) -> int:
    """Return the minimal width of columns side by side."""
    return sum(least for least, _ in limits) + GAP * (len(limits) - 1)


def _widths(limits: Sequence[tuple[int, int]], width: int) -> list[int]:
    """Return the widths of columns side by side: natural if they fit, else with wide ones reduced."""
    spare = width - GAP * (len(limits) - 1)
    for cap in range(spare, 0, -1):
        widths = [max(least, min(most, cap)) for least, most in limits]
        if sum(widths) <= spare:
            return widths
    return [max(1, spare // len(limits)) for _ in limits]  # a terminal that is narrower than any table
