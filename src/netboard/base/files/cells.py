"""Cells of CSV and TSV tables: no text in them runs as a formula when a spreadsheet opens the table.

Excel, LibreOffice and Google Sheets run a cell that begins with ``=``, ``+``, ``-`` or ``@``, or with a tab or a line
break before one, whatever the table quotes. A label of a block or a note may begin so. Such a text gets a single quote
in front, as spreadsheets themselves mark a text; so does a text that begins with such a quote, so that reading takes
exactly one away. Numbers stay numbers. Every writer and reader of such tables uses this module; a test finds those that
do not.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TextIO

QUOTE = "'"

RUNS = tuple("=+-@\t\r\n＝＋－＠")
"""First characters of texts that a spreadsheet may run; the last four are their full-width forms."""

MARKED = (*RUNS, QUOTE)
"""First characters of the texts that get a quote in front."""

IN_WORDS = (
    "A text that begins with = + - @, a tab, a line break or ' has a ' in front, because spreadsheets run such texts "
    "as formulas: remove this first character after reading. Numbers have none."
)
"""The rule, for data dictionaries and READMEs."""


def text_cell(text: str) -> str:
    """Return a text as a cell holds it."""
    return QUOTE + text if text.startswith(MARKED) else text


def text_of_cell(cell: str) -> str:
    """Return the text that a cell holds."""
    return cell[1:] if cell.startswith(QUOTE) and cell[1:].startswith(MARKED) else cell


def cell_of(value: object) -> Any:
    """Return a value as a cell holds it: a text marked if necessary, anything else as it is."""
    return text_cell(value) if isinstance(value, str) else value


class CsvWriter:
    """Writes rows or columns to a CSV file: commas, line feeds, and quotes where necessary.

    Floats get the fewest digits that read back as the same number.
    """

    def __init__(self, file: TextIO) -> None:
        self._writer = csv.writer(file, lineterminator="\n")

    def row(self, values: Iterable[Any]) -> None:
        """Write a row."""
        self._writer.writerow(map(cell_of, values))

    def rows(self, rows: Iterable[Iterable[Any]]) -> None:
        """Write rows."""
        for values in rows:
            self.row(values)

    def columns(self, columns: Sequence[Sequence[Any]], texts: Sequence[bool]) -> None:
        """Write rows given as columns, of which some hold texts; faster than `rows`, as numbers are not looked at."""
        cells = [list(map(text_cell, column)) if text else column for column, text in zip(columns, texts, strict=True)]
        self._writer.writerows(zip(*cells, strict=True))


def tsv_lines(rows: Iterable[Iterable[Any]], shown: Callable[[Any], str]) -> Iterator[str]:
    """Yield the lines of a TSV table.

    ``shown``: formats a value without tab and line break, because TSV has no quoting.
    """
    return ("\t".join(_shown(value, shown(value)) for value in values) + "\n" for values in rows)


def _shown(value: object, cell: str) -> str:
    return text_cell(cell) if isinstance(value, str) else cell


def tsv_number_lines(columns: Sequence[Iterable[str]]) -> Iterator[str]:
    """Yield the lines of a TSV table of numbers, given as columns of their digits."""
    return ("\t".join(cells) + "\n" for cells in zip(*columns, strict=True))
