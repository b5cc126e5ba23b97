"""Results of a study: tables with checked claims, on the screen and in a folder.

A `BenchVerdict` is a claim and whether the measured numbers support it. The module that measures the numbers checks it.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Any

from rich.console import Console, Group
from rich.text import Text

from netboard.base.errors import writing
from netboard.base.files.cells import CsvWriter
from netboard.base.files.new import refuse_existing
from netboard.base.terminal.output import FittedTable, TableHeading, as_cell
from netboard.benchmarks.harness.machine import describe

Value = str | float | int | bool


@dataclass(frozen=True)
class BenchVerdict:
    """A claim, and the result that supports or refutes it."""

    claim: str
    holds: bool
    found: str


class ResultPart:
    """One part of a study: a table, and claims about it.

    - `columns`: heads of the columns, one by one or as a line with ``|`` between them.
    - `on_screen`: whether it is short enough to be printed.
    """

    def __init__(
        self,
        name: str,
        title: str,
        columns: str | Iterable[str],
        rows: Iterable[tuple[Value, ...]] = (),
        verdicts: Iterable[BenchVerdict] = (),
        *,
        on_screen: bool = True,
    ) -> None:
        self.name, self.title, self.on_screen = name, title, on_screen
        self.columns = tuple(columns.split(" | ") if isinstance(columns, str) else columns)
        self.rows, self.verdicts = list(rows), list(verdicts)

    def add(self, *row: Value) -> None:
        """Add a row."""
        self.rows.append(row)

    def claim(self, claim: str, holds: bool, found: str) -> None:
        """Add a claim, and the result that supports or refutes it."""
        self.verdicts.append(BenchVerdict(claim, holds, found))

    @property
    def holds(self) -> bool:
        """Return whether every claim holds."""
        return all(verdict.holds for verdict in self.verdicts)

    def plain(self) -> dict[str, Any]:
        """Return the part as JSON types."""
        names = ("name", "title", "columns", "rows", "verdicts", "on_screen")
        values = {name: getattr(self, name) for name in names}
        plain: dict[str, Any] = _plain(values | {"verdicts": [asdict(verdict) for verdict in self.verdicts]})
        return plain


class Folder:
    """A folder of results.

    - `force`: whether it may exist and its files may be overwritten.
    """

    def __init__(self, path: Path, *, force: bool = False) -> None:
        if not force:
            refuse_existing(path, ", or write into it with --force")
        with writing(path):
            path.mkdir(parents=True, exist_ok=True)
        self.path = path

    def write(self, parts: Sequence[ResultPart], about: Mapping[str, Any]) -> None:
        """Write a table for each part, and everything in one JSON file.

        - `about`: the options of the run, for the head of the JSON file.
        """
        for part in parts:
            with (self.path / f"{part.name}.csv").open("w", encoding="utf-8", newline="") as file:
                CsvWriter(file).rows([part.columns, *part.rows])
        results = {"machine": asdict(describe()), **about, "parts": [part.plain() for part in parts]}
        text = json.dumps(results, indent=1, allow_nan=False)
        (self.path / "results.json").write_text(text + "\n", encoding="utf-8")

    def save(self, name: str, draw: Callable[[], Any]) -> None:
        """Draw a figure and save it as PNG and SVG, if matplotlib is installed."""
        if find_spec("matplotlib") is None:
            return
        import matplotlib as mpl

        figure = draw()
        with mpl.rc_context({"svg.hashsalt": "netboard", "svg.fonttype": "none"}):
            figure.savefig(self.path / f"{name}.png", dpi=150)
            figure.savefig(self.path / f"{name}.svg", metadata={"Date": None})


def _plain(value: object) -> Any:
    """Return a value as JSON types, with non-finite numbers as text."""
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return str(value) if isinstance(value, float) and not isfinite(value) else value


def new_folder(name: str) -> Path:
    """Return a new folder name in the working directory."""
    number = 1
    while (path := Path(f"{name}-{number}")).exists():
        number += 1
    return path


def show(console: Console, part: ResultPart) -> None:
    """Print a part: its table and its claims."""
    head, *others = part.columns
    table = FittedTable(
        head, *(TableHeading(column, number=_is_numeric(part, column)) for column in others), title=part.title
    )
    for row in part.rows:
        table.add_row(*map(as_cell, row))
    console.print(Group(table, *(_line(verdict) for verdict in part.verdicts), Text("")))


def _is_numeric(part: ResultPart, column: str) -> bool:
    """Return whether a column holds only numbers."""
    place = part.columns.index(column)
    return all(isinstance(row[place], int | float) for row in part.rows)


def _line(verdict: BenchVerdict) -> Text:
    word, style = ("holds", "green") if verdict.holds else ("FAILS", "bold red")
    return Text.assemble((word, style), f"  {verdict.claim}: {verdict.found}")
