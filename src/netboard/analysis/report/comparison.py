"""Comparison of a study with the paper, as a table for the terminal.

The numbers come from `netboard.analysis.results.paper`; the report has the same comparison as an HTML table.
"""

from math import isfinite
from typing import Any

import pandas as pd
from rich.text import Text

from netboard.analysis.report.numbers import after, between, reported, unit_of, written
from netboard.analysis.results.paper import REMINDER
from netboard.base.terminal import FittedTable


def comparison_table(compared: pd.DataFrame) -> FittedTable:
    """Return the comparison as a table for the terminal."""
    table = FittedTable(
        "Fig.", "quantity", "of", "paper", "this study", "n", "", title="The paper and this study", caption=REMINDER
    )
    rows = compared.to_dict("records")
    for row, following in zip(rows, [*rows[1:], None], strict=True):
        ends = following is None or following["figure"][0] != row["figure"][0]
        n = f"{row['n']} {row['of']}{'' if row['n'] == 1 else 's'}" if row["of"] else "0"
        verdict = f"{row['verdict']}; {row['note']}" if row["kind"] == "count" and row["note"] else row["verdict"]
        cells = (row["figure"], row["quantity"], row["group"], _paper(row), _study(row), n, _colour(verdict))
        table.add_row(*cells)
        if ends:
            table.end_section()
    return table


def _paper(row: dict[str, Any]) -> str:
    """Return the paper's number as text."""
    return reported(row) if row["kind"] == "number" and isfinite(row["reported_sd"]) else str(row["said"])


def _study(row: dict[str, Any]) -> str:
    """Return the study's number as text, with its standard deviation, confidence interval or total."""
    if not isfinite(row["value"]):
        return "-"
    value, interval, unit = written(row)[0], between(row), after(unit_of(row))
    if row["kind"] == "count":
        return f"{value} of {row['n']}"
    if row["interval"] == "SD":
        return f"{value} {interval}{unit}"
    return f"{value}{unit} ({interval})" if interval else f"{value}{unit}"


def _colour(verdict: str) -> Text:
    """Colour agreement and disagreement; the words say it too."""
    colour = {"same": "green", "other": "red"}.get(verdict.split(maxsplit=1)[0])
    return Text(verdict, colour or "")
