"""Comparison of a counterfactual replay with the recording: a table for a terminal, and values for JSON."""

from collections.abc import Sequence
from math import isnan
from typing import Any

from rich.text import Text

from netboard.base.terminal.output import FittedTable, numbers
from netboard.recording.counterfactual.what_if import QUANTITIES, AttemptComparison, WhatIf
from netboard.recording.format.summary import or_null

EXPLANATION = (
    "Open loop: the hands move as recorded and do not react to the change. The trial state machine decides again.\n"
    "Each attempt starts from the state recorded at its release, and is compared until the shorter one ends.\n"
    "unfinished: the computed attempt had not ended when the recorded one did."
)
"""Explanation of the numbers, below every table."""


def table_of(comparisons: Sequence[AttemptComparison], changes: Sequence[str]) -> FittedTable:
    """Return a table that compares every attempt."""
    different = sum(one.then.outcome != one.now.outcome for one in comparisons)
    title = (
        f"With {', '.join(changes) or 'nothing changed'}: {different} of {len(comparisons)} attempts end differently"
    )
    differing = numbers(*(f"{quantity.text}\n[{quantity.unit}]\nrms\nmax" for quantity in QUANTITIES))
    table = FittedTable(
        *numbers("trial,\nattempt"), "outcome,\nthen -> now", *numbers("completion"), *differing, title=title
    )
    for one in comparisons:
        same = one.then.outcome == one.now.outcome
        table.add_row(
            f"{one.then.trial}, {one.then.attempt}",
            one.then.outcome if same else Text(f"{one.then.outcome}\n-> {one.now.outcome}", "yellow"),
            _seconds(one.then.completion) + (f"\n-> {_seconds(one.now.completion)}" if one.changed else ""),
            *(
                f"{quantity.scale * change.rms:.3g}\n{quantity.scale * change.largest:.3g}"
                for quantity in QUANTITIES
                for change in [one.differences[quantity.name]]
            ),
        )
    return table


def _seconds(time: float) -> str:
    return "-" if isnan(time) else f"{time:.3f} s"


def as_data(found: WhatIf, changes: Sequence[str]) -> dict[str, Any]:
    """Return the comparison for JSON, in SI units."""
    return {
        "set": list(changes),
        "identical": found.identical,
        "attempts": [
            {
                "trial": one.then.trial,
                "attempt": one.then.attempt,
                "then": {"outcome": one.then.outcome, "completion": or_null(one.then.completion)},
                "now": {"outcome": one.now.outcome, "completion": or_null(one.now.completion)},
                "compared": one.common,
                "differences": {
                    name: {"rms": or_null(change.rms), "max": or_null(change.largest)}
                    for name, change in one.differences.items()
                },
            }
            for one in found.comparisons
        ],
    }
