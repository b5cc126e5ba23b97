"""The results of a study in a report: the main ones in sentences, all of them in tables, and beside the paper.

No sentence says more than its numbers: what they are of, their intervals, and of how many they are made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import pandas as pd

from netboard.report.grids import Cell, Column, Grid, grid, name, number
from netboard.report.wording import NONE, amount, counted, decimals, in_unit

MAIN: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "learning",
        (
            "completion time",
            "change of completion time",
            "number of velocity peaks",
            "change of number of velocity peaks",
        ),
    ),
    (
        "dyads",
        (
            "completion time: mean of the two less dyad",
            "completion time: dyads better than the mean of the two",
            "number of velocity peaks: mean of the two less dyad",
            "number of velocity peaks: dyads better than the mean of the two",
        ),
    ),
    (
        "classes",
        (
            "share of cooperative movement",
            "share of competitive movement",
            "share of single movement",
            "share of stillness",
        ),
    ),
    (
        "strategy",
        ("change of the area of the ellipse", "change of variance of distance", "change of variance of velocity"),
    ),
    ("delay", ("delay, mean of 10 to 40 %", "delay at 40 % less that at 10 %")),
    ("contrasts", ("completion time: ratio", "velocity peaks: difference")),
)
"""Topics and quantities that the summary names, in this order."""

_DIFFERENCE = " less "
"""In the name of a group: it is a difference of two."""


def sentence(quantity: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Say what a quantity is in each group, with intervals and of what it is made.

    Parameters
    ----------
    quantity : str
        What it is.
    rows : sequence of mapping
        Its rows in the table of results.

    Returns
    -------
    str
        Such as ``Completion time (4 dyads; 95 % t): on = 3.61 s (3.02 to 4.20); off = 4.01 s (3.55 to 4.47).``
    """
    made_of = [_made_of(row) for row in rows]
    alike = len(set(made_of)) == 1
    start = f"{quantity[:1].upper()}{quantity[1:]}{f' ({made_of[0]})' if alike else ''}"
    parts = [_part(row, "" if alike else said) for row, said in zip(rows, made_of, strict=True)]
    return f"{start}: {'; '.join(parts)}."


def _made_of(row: Mapping[str, Any]) -> str:
    """Say of what a result is made, and what its interval is."""
    said = counted(int(row["n"]), row["of"])
    return f"{said}; {row['interval']}" if row["interval"] and isfinite(row["low"]) else said


def _part(row: Mapping[str, Any], made_of: str) -> str:
    """Write one group's result."""
    interval, value = between(row), written(row)[0]
    if row["interval"] == "SD" and interval:
        value, interval = f"{value} {interval}", ""
    aside = "; ".join(part for part in (interval, made_of) if part)
    group = f"{row['group']} = " if row["group"] else ""
    return f"{group}{value}{in_unit(row['unit'])}" + (f" ({aside})" if aside else "")


def between(row: Mapping[str, Any]) -> str:
    """Write an interval.

    Parameters
    ----------
    row : mapping
        A row of the table of results, or of one that has its columns.

    Returns
    -------
    str
        Its ends, or how far it goes to either side if it is a standard deviation; empty without one.
    """
    _, low, high = written(row)
    if not isfinite(row["low"]):
        return ""
    if row["interval"] == "SD":
        return f"± {amount((row['high'] - row['low']) / 2, _places(row))}"
    return f"{low} to {high}"


def _places(row: Mapping[str, Any]) -> int:
    """Say how many decimals a result and its interval have: the larger of it and its reach decides."""
    three = [float(row[part]) for part in ("value", "low", "high")]
    if all(part.is_integer() for part in three if isfinite(part)):
        return 0
    return decimals(three[0], (three[2] - three[1]) / 2)


def written(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Write a result and the ends of its interval with the same decimals.

    Parameters
    ----------
    row : mapping
        A row of the table of results.
    """
    places = _places(row)
    return amount(row["value"], places), amount(row["low"], places), amount(row["high"], places)


def summary(results: pd.DataFrame, titles: Mapping[str, str]) -> tuple[tuple[str, str, tuple[str, ...]], ...]:
    """Put the main results into sentences; where a quantity has differences, only those.

    Parameters
    ----------
    results : DataFrame
        The tidy table of results.
    titles : mapping of str to str
        Titles of pictures by their names.

    Returns
    -------
    tuple of (str, str, tuple of str)
        Name and title of a topic, and its sentences.
    """
    said = []
    for topic, quantities in MAIN:
        mine = results[(results["topic"] == topic) & results["value"].notna()]
        chosen = [(quantity, _chosen(mine[mine["quantity"] == quantity])) for quantity in quantities]
        sentences = tuple(sentence(quantity, rows) for quantity, rows in chosen if rows)
        if sentences:
            said.append((topic, titles.get(topic, topic), sentences))
    return tuple(said)


def _chosen(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Choose the rows that a sentence names: differences, if there are any, each with its first interval."""
    differences = rows["group"].str.contains(_DIFFERENCE, regex=False)
    return _records((rows[differences] if differences.any() else rows).drop_duplicates("group"))


def few(dyads: int) -> str:
    """Say what so many dyads can show.

    Parameters
    ----------
    dyads : int
        How many there are [1].
    """
    least = min(1.0, 2.0 / 2**dyads)
    said = (
        f"The dyad is the unit of replication: {counted(dyads, 'dyad')}, however many trials. "
        f"An exact two-sided test of a difference within dyads has no p below {amount(least)} here"
    )
    if least > 0.05:
        return f"{said}, so none can be significant at 5 %; six dyads are the least of which one can."
    return f"{said}."


@dataclass(frozen=True, slots=True)
class Topic:
    """All results of a topic.

    Attributes
    ----------
    title : str
        Its title.
    table : Grid
        The results.
    notes : tuple of str
        What must be known to read them; the table has their numbers, from 1.
    """

    title: str
    table: Grid
    notes: tuple[str, ...]


def topics(results: pd.DataFrame, titles: Mapping[str, str]) -> tuple[Topic, ...]:
    """Put all results into tables.

    Parameters
    ----------
    results : DataFrame
        The tidy table of results.
    titles : mapping of str to str
        Titles of pictures by their names.

    Returns
    -------
    tuple of Topic
        The topics in the order of the table.
    """
    groups = results.groupby("topic", sort=False)
    return tuple(_topic(titles.get(str(topic), str(topic)), _records(rows)) for topic, rows in groups)


def _topic(title: str, rows: Sequence[Mapping[str, Any]]) -> Topic:
    """Put the results of a topic into a table."""
    notes = list(dict.fromkeys(row["note"] for row in rows if row["note"]))
    columns = [
        Column("Quantity"),
        name("Group"),
        number("Value"),
        number("Low"),
        number("High"),
        Column("Unit"),
        Column("Interval"),
        number("n"),
        Column("Of"),
        number("Note"),
    ]
    table = grid(f"Results: {title}", columns, [_result(row, notes) for row in rows])
    return Topic(title, table, tuple(notes))


def _result(row: Mapping[str, Any], notes: list[str]) -> list[Cell | float]:
    """Write a row of the table of results."""
    note = str(notes.index(row["note"]) + 1) if row["note"] else ""
    labels, last = [row["quantity"], row["group"]], [row["interval"], int(row["n"]), row["of"], note]
    return [*labels, *written(row), in_unit(row["unit"]).strip(), *last]


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]


def comparison_grid(comparison: pd.DataFrame) -> Grid:
    """Put a study's numbers beside those of the paper.

    Parameters
    ----------
    comparison : DataFrame
        As in `netboard.report.html.write_report`.
    """
    columns = [
        Column("Figure"),
        Column("Quantity"),
        name("Group"),
        Column("The paper says"),
        number("Reported"),
        number("Here"),
        Column("Interval here"),
        Column("Made of"),
        Column("Verdict"),
        name("Note"),
    ]
    return grid("This study beside the paper", columns, [_compared(row) for row in _records(comparison)])


def _compared(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Write a row of the comparison."""
    unit = in_unit(row["unit"])
    reported = amount(row["reported"])
    if isfinite(row["reported_sd"]):
        reported = f"{reported} ± {amount(row['reported_sd'])}"
    if row["reported_of"]:
        reported = f"{reported} of {amount(int(row['reported_of']))}"
    here = f"{written(row)[0]}{unit}" if isfinite(row["value"]) else NONE
    interval = f"{between(row)} ({row['interval']})" if between(row) else ""
    made_of = counted(int(row["n"]), row["of"]) if row["n"] else ""
    there = f"{reported}{unit}" if isfinite(row["reported"]) else NONE
    labels = row["figure"], row["quantity"], row["group"], row["said"]
    return *labels, there, here, interval, made_of, row["verdict"], row["note"]
