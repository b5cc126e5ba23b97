"""Results in a report: numbers with their intervals, result tables, and the comparison with the paper.

Numbers are in display units (`netboard.analysis.topics.units`); the tables of an analysis are in SI units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import pandas as pd

from netboard.analysis.report.grids import Cell, Grid, GridColumn, grid, grid_of, name, number
from netboard.analysis.report.wording import NONE, amount, decimals, plural
from netboard.analysis.topics import testing
from netboard.analysis.topics.units import Unit, read_in


def unit_of(row: Mapping[str, Any]) -> Unit:
    """Return the display unit of a result: a row of the table of results, or of a table with its columns."""
    return read_in(row["unit"], row["quantity"], row["group"])


def after(unit: Unit) -> str:
    """Return a unit as it follows a number on the same line; empty for a pure number."""
    return "\N{NO-BREAK SPACE}" + unit.symbol.replace(" ", "\N{NO-BREAK SPACE}") if unit.symbol else ""


def between(row: Mapping[str, Any]) -> str:
    """Return the limits of a result's interval as text, or plus-minus for a standard deviation; empty for none."""
    if not isfinite(row["low"]):
        return ""
    if row["interval"] == "SD":
        _, bottom, top = _three(row)
        return f"± {amount((top - bottom) / 2, _places(row))}"
    _, low, high = written(row)
    return f"{low} to {high}"


def _three(row: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return a result and the limits of its interval in the display unit."""
    scale = unit_of(row).scale
    return float(row["value"]) * scale, float(row["low"]) * scale, float(row["high"]) * scale


def _places(row: Mapping[str, Any]) -> int:
    """Return the decimals of a result and its interval; the larger of value and interval reach decides.

    The larger one has three digits; two if the value is below 1 and has an interval. A positive limit, as that of a
    ratio, is not rounded to 0.
    """
    value, low, high = _three(row)
    if not isfinite(low):
        return 0 if value.is_integer() else min(decimals(value), unit_of(row).finest)
    reach = (high - low) / 2
    places = decimals(value, reach, digits=2 if max(abs(value), reach) < 1.0 else 3)
    if 0.0 < low < 0.5 * 10**-places:
        places = decimals(low, digits=1)
    return min(places, unit_of(row).finest)


def written(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Return a result and the limits of its interval as text, with equal decimals, in the display unit."""
    places = _places(row)
    value, low, high = (amount(part, places) for part in _three(row))
    return value, low, high


@dataclass(frozen=True, slots=True)
class Topic:
    """All results of a topic, with notes; the table refers to their numbers, from 1."""

    title: str
    table: Grid
    notes: tuple[str, ...]


def topics(results: pd.DataFrame, titles: Mapping[str, str]) -> tuple[Topic, ...]:
    """Return all results as tables."""
    groups = results.groupby("topic", sort=False)
    return tuple(_topic(titles.get(str(topic), str(topic)), records(rows)) for topic, rows in groups)


def _topic(title: str, rows: Sequence[Mapping[str, Any]]) -> Topic:
    notes = list(dict.fromkeys(row["note"] for row in rows if row["note"]))
    table = grid_of(f"Results: {title}", [_result(row, notes) for row in rows])
    return Topic(title, table, tuple(notes))


def _result(row: Mapping[str, Any], notes: list[str]) -> dict[GridColumn, Cell | float]:
    value, low, high = written(row)
    return {
        GridColumn("Quantity"): row["quantity"],
        name("Group"): row["group"],
        number("Value"): value,
        number("Low"): low,
        number("High"): high,
        GridColumn("Unit"): unit_of(row).symbol,
        GridColumn("Interval"): row["interval"],
        number("n"): int(row["n"]),
        GridColumn("Of"): row["of"],
        number("Note"): str(notes.index(row["note"]) + 1) if row["note"] else "",
    }


def families_grid(results: pd.DataFrame) -> Grid:
    """Return the families of tests: how many tests, the smallest possible p, and the correction."""
    mine = results[results["topic"] == testing.TOPIC]
    rows: list[list[Cell | float]] = []
    for family, own in mine.groupby("group", sort=False):
        found = dict(zip(own["quantity"], own["value"], strict=True))
        least = [amount(found[name]) if name in found else NONE for name in (testing.LEAST, testing.LEAST_CORRECTED)]
        correction = str(own["note"].iloc[0]).removeprefix("correction: ")
        rows.append([str(family), int(found[testing.TESTS]), *least, correction, int(found[testing.BELOW])])
    columns = [
        name("Family of tests"),
        number("Tests"),
        number("Smallest possible p of one test"),
        number("Smallest possible p after the correction"),
        GridColumn("Correction for multiple tests"),
        number(f"p below {testing.LEVEL:g}, corrected as stated"),
    ]
    return grid(
        "All tests of this report, by family. A dash: the p value of this test has no lower limit.", columns, rows
    )


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table."""
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]


def comparison_grid(comparison: pd.DataFrame) -> Grid:
    """Return the comparison with the paper as a table."""
    return grid_of("This study beside the paper", [_compared(row) for row in records(comparison)])


def _compared(row: Mapping[str, Any]) -> dict[GridColumn, Cell | float]:
    return {
        GridColumn("Figure"): row["figure"],
        GridColumn("Quantity"): row["quantity"],
        name("Group"): row["group"],
        GridColumn("The paper says"): row["said"],
        number("Reported"): reported(row) if isfinite(row["reported"]) else NONE,
        number("Here"): f"{written(row)[0]}{after(unit_of(row))}" if isfinite(row["value"]) else NONE,
        GridColumn("Interval here"): f"{between(row)} ({row['interval']})" if between(row) else "",
        GridColumn("Made of"): plural(int(row["n"]), row["of"]) if row["n"] else "",
        GridColumn("Verdict"): row["verdict"],
        name("Note"): row["note"],
    }


def reported(row: Mapping[str, Any]) -> str:
    """Return the paper's number as text, with its standard deviation or total."""
    unit = unit_of(row)
    parts = [amount(row["reported"] * unit.scale)]
    if isfinite(row["reported_sd"]):
        parts.append(f"± {amount(row['reported_sd'] * unit.scale)}")
    if row["reported_of"]:
        parts.append(f"of {amount(int(row['reported_of']))}")
    return " ".join(parts) + after(unit)
