"""A study beside the paper, as a table for the terminal."""

from math import isfinite
from typing import Any

import pandas as pd
from rich.table import Table

from netboard.findings.paper import REMINDER


def comparison_table(compared: pd.DataFrame) -> Table:
    """Make the table.

    Parameters
    ----------
    compared : DataFrame
        From `netboard.findings.paper.compare`.
    """
    table = Table(title="The paper and this study", title_justify="left", caption=REMINDER, caption_justify="left")
    for heading in ("Fig.", "quantity", "of", "paper", "this study", "n", ""):
        table.add_column(heading, overflow="fold")
    rows = compared.to_dict("records")
    for row, following in zip(rows, [*rows[1:], None], strict=True):
        ends = following is None or following["figure"][0] != row["figure"][0]
        n = f"{row['n']} {row['of']}{'' if row['n'] == 1 else 's'}" if row["of"] else "0"
        verdict = f"{row['verdict']}; {row['note']}" if row["kind"] == "count" and row["note"] else row["verdict"]
        cells = (row["figure"], row["quantity"], row["group"], _paper(row), _study(row), n, _colour(verdict))
        table.add_row(*cells, end_section=ends)
    return table


def _paper(row: dict[str, Any]) -> str:
    """Write what the paper says."""
    if row["kind"] != "number" or not isfinite(row["reported_sd"]):
        return str(row["said"])
    return f"{row['reported']:.2f} ± {row['reported_sd']:.2f}{_unit(row)}"


def _study(row: dict[str, Any]) -> str:
    """Write what the study says: with the standard deviation, the interval, or of how many."""
    if not isfinite(row["value"]):
        return "-"
    if row["kind"] == "count":
        return f"{row['value']:.0f} of {row['n']}"
    if row["interval"] == "SD":
        return f"{row['value']:.2f} ± {row['value'] - row['low']:.2f}{_unit(row)}"
    scale, unit = (1e3, " ms") if row["figure"] == "6" else (1.0, _unit(row))
    value, low, high = (row[name] * scale for name in ("value", "low", "high"))
    return f"{value:.3g}{unit}" if not isfinite(low) else f"{value:.3g} [{low:.3g}, {high:.3g}]{unit}"


def _unit(row: dict[str, Any]) -> str:
    return "" if row["unit"] in ("", "1") else f" {row['unit']}"


def _colour(verdict: str) -> str:
    """Mark what agrees and what does not; the words say so too."""
    colour = {"same": "green", "other": "red"}.get(verdict.split(maxsplit=1)[0])
    return f"[{colour}]{verdict}[/{colour}]" if colour else verdict
