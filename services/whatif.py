"""Counterfactual replay of a recording, attempt by attempt, for people and programs."""

import json
from collections.abc import Sequence
from importlib.util import find_spec
from math import isnan
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from netboard.base.config import parse
from netboard.base.errors import NetboardError, RecordingError
from netboard.base.terminal import FittedTable, numbers
from netboard.recording.counterfactual.figure import draw
from netboard.recording.counterfactual.what_if import QUANTITIES, Comparison, WhatIf, save, what_if
from netboard.recording.files.reader import Recording
from netboard.stage.stage import make_stage

WORDS = (
    "The hands move as recorded and do not react to the change (open loop). The trial state machine decides again.\n"
    "Each attempt starts from the state recorded at its release. It is compared until the earlier of the two ends.\n"
    "unfinished: the attempt had not ended when the recorded one did."
)
"""Explanation of the numbers, below every table."""


def main(
    path: Path,
    changes: Sequence[str],
    *,
    output: Path | None = None,
    figure: Path | None = None,
    trial: int | None = None,
    as_json: bool = False,
) -> int:
    """Run the recorded hands through a changed stage.

    Parameters
    ----------
    trial : int or None
        The trial in the figure; None for the most informative attempt.
    """
    require_free(figure)
    console = Console(highlight=False)
    with Recording(path) as recording, Console(stderr=True).status("the recorded hands, once more"):
        config = parse(recording.config_text, f"{path} (its configuration)", changes)
        found = what_if(recording.ticks(), make_stage(config))
        source = recording.metadata
    if not found.comparisons:
        raise RecordingError(f"{path}: has no attempt at a trial, so there is nothing to compare")
    shown = None if trial is None else attempt_at(found, trial, path)
    if as_json:
        console.file.write(json.dumps(as_data(found, changes)) + "\n")
    else:
        console.print(table_of(found.comparisons, changes))
        console.print("nothing differs, to the bit" if found.identical else WORDS, soft_wrap=True)
    if output is not None:
        save(output, found, config, source, path.name, changes)
    if figure is not None:
        draw(found, changes, shown).savefig(figure, dpi=100)
    return 0


def require_free(figure: Path | None) -> None:
    """Refuse a figure that exists already, or that cannot be drawn here."""
    if figure is None:
        return
    if find_spec("matplotlib") is None:
        raise NetboardError("--figure: matplotlib is not installed; install netboard[bench]")
    if figure.exists():
        raise NetboardError(f"{figure}: exists already; give the figure another name")
    if figure.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise NetboardError(f"{figure}: expected a name that ends in .png, .svg or .pdf")


def attempt_at(found: WhatIf, trial: int, path: Path) -> Comparison:
    """Return the last attempt at a trial."""
    attempts = [one for one in found.comparisons if one.then.trial == trial]
    if not attempts:
        numbers = sorted({one.then.trial for one in found.comparisons})
        raise RecordingError(f"{path}: has no attempt at trial {trial}; it has trials {numbers[0]} to {numbers[-1]}")
    return attempts[-1]


def table_of(comparisons: Sequence[Comparison], changes: Sequence[str]) -> FittedTable:
    """Return a table that compares every attempt."""
    otherwise = sum(one.then.outcome != one.now.outcome for one in comparisons)
    title = f"With {', '.join(changes) or 'nothing changed'}: {otherwise} of {len(comparisons)} attempts end otherwise"
    differing = numbers(*(f"{quantity.text}\n[{quantity.unit}]\nrms\nmax" for quantity in QUANTITIES))
    table = FittedTable(
        *numbers("trial,\nattempt"), "outcome,\nthen -> now", *numbers("completion"), *differing, title=title
    )
    for one in comparisons:
        same = one.then.outcome == one.now.outcome
        table.add_row(
            f"{one.then.trial}, {one.then.attempt}",
            one.then.outcome if same else Text(f"{one.then.outcome}\n-> {one.now.outcome}", "yellow"),
            seconds(one.then.completion) if not one.changed else completions(one),
            *(differences(one, quantity.name, quantity.scale) for quantity in QUANTITIES),
        )
    return table


def completions(one: Comparison) -> str:
    """Return both completion times in words."""
    return f"{seconds(one.then.completion)}\n-> {seconds(one.now.completion)}"


def seconds(time: float) -> str:
    """Return a completion time in words."""
    return "-" if isnan(time) else f"{time:.3f} s"


def differences(one: Comparison, name: str, scale: float) -> str:
    """Return how much a quantity differs, in words."""
    apart = one.differences[name]
    return f"{scale * apart.rms:.3g}\n{scale * apart.largest:.3g}"


def as_data(found: WhatIf, changes: Sequence[str]) -> dict[str, Any]:
    """Return the comparison for JSON, in SI units."""
    return {
        "set": list(changes),
        "identical": found.identical,
        "attempts": [
            {
                "trial": one.then.trial,
                "attempt": one.then.attempt,
                "then": {"outcome": one.then.outcome, "completion": _number(one.then.completion)},
                "now": {"outcome": one.now.outcome, "completion": _number(one.now.completion)},
                "compared": one.common,
                "differences": {
                    name: {"rms": _number(apart.rms), "max": _number(apart.largest)}
                    for name, apart in one.differences.items()
                },
            }
            for one in found.comparisons
        ],
    }


def _number(value: float) -> float | None:
    """Return None for NaN, which JSON does not know."""
    return None if isnan(value) else value
