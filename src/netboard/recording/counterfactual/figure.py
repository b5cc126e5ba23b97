"""Figure of a counterfactual replay: one attempt as recorded and as recomputed, and the differences of all attempts.

The colours are from the Okabe-Ito palette, which colour-blind readers can distinguish; dashes distinguish the lines in
black-and-white print. Needs matplotlib, which is imported when a figure is drawn.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from netboard.base.looks import BLUE, PRINT_BODY, VERMILION
from netboard.recording.counterfactual.what_if import (
    QUANTITIES,
    AttemptComparison,
    ComparedQuantity,
    WhatIf,
    attempt_to_show,
    difference,
    seconds_since_release,
)
from netboard.task.trials.state_machine import BALL_FREE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RECORDED, _COMPUTED, _OTHERS = BLUE, VERMILION, "0.75"


def draw(found: WhatIf, changes: Sequence[str], shown: AttemptComparison | None = None) -> Any:
    """Draw recorded and recomputed values and their difference, with a row for each quantity.

    ``found``: a counterfactual replay of a recording with at least one attempt.
    """
    from matplotlib.figure import Figure

    shown = attempt_to_show(found.comparisons) if shown is None else shown
    figure = Figure(figsize=(12, 10), layout="constrained")
    axes = figure.subplots(len(QUANTITIES), 2, sharex="col", squeeze=False)
    for quantity, (values, change) in zip(QUANTITIES, axes, strict=True):
        _draw_values(values, found, quantity, shown)
        _draw_difference(change, found, quantity, shown)
    for column in range(2):
        axes[-1, column].set_xlabel("time since the release (s)")
    axes[0, 0].set_title(f"trial {shown.then.trial}, attempt {shown.then.attempt}: {_outcomes(shown)}")
    axes[0, 1].set_title(f"difference, now minus then: all {len(found.comparisons)} attempts")
    for column in range(2):
        axes[0, column].legend(fontsize=PRINT_BODY, loc="best")
    figure.suptitle(f"The recorded hands with {', '.join(changes) or 'nothing changed'} (open loop: they do not react)")
    return figure


def _outcomes(shown: AttemptComparison) -> str:
    """Describe the recorded and the recomputed outcome of an attempt."""
    then, now = shown.then, shown.now
    if then.outcome == now.outcome == "success":
        return f"success after {then.completion:.2f} s, now {now.completion:.2f} s"
    return f"{then.outcome}, now {now.outcome}"


def _draw_values(axis: "Axes", found: WhatIf, quantity: ComparedQuantity, shown: AttemptComparison) -> None:
    """Draw one quantity of the shown attempt, recorded and recomputed, each while the ball is free."""
    start = int(np.searchsorted(found.recorded["tick"], shown.then.tick))
    for rows, attempt, colour, style, label in (
        (found.recorded, shown.then, _RECORDED, "-", "recorded"),
        (found.computed, shown.now, _COMPUTED, "--", "recomputed"),
    ):
        part = rows[start : int(np.searchsorted(rows["tick"], attempt.stop))]
        part = part[np.isin(part["phase"], BALL_FREE)]
        times = seconds_since_release(part["tick"])
        values = quantity.scale * part[quantity.name]
        axis.plot(times, values, color=colour, linestyle=style, linewidth=1.5, label=label)
        axis.plot(times[-1:], values[-1:], marker="o", markersize=4, color=colour)
    axis.set_ylabel(f"{quantity.text} ({quantity.unit})")
    axis.grid(True, alpha=0.3)


def _draw_difference(axis: "Axes", found: WhatIf, quantity: ComparedQuantity, shown: AttemptComparison) -> None:
    """Draw the difference of one quantity in all attempts, with the shown one on top."""
    others = [one for one in found.comparisons if one is not shown]
    for place, one in enumerate([*others, shown]):
        start = int(np.searchsorted(found.recorded["tick"], one.then.tick))
        rows = slice(start, start + one.common)
        change = quantity.scale * difference(found.recorded, found.computed, quantity, rows)
        on_top = one is shown
        label = f"trial {one.then.trial}, attempt {one.then.attempt}" if on_top else "the others"
        axis.plot(
            seconds_since_release(found.recorded["tick"][rows]),
            change,
            color="black" if on_top else _OTHERS,
            linewidth=1.4 if on_top else 0.7,
            label=label if on_top or place == 0 else None,
        )
    axis.set_ylabel(f"{quantity.text}, difference ({quantity.unit})")
    axis.grid(True, alpha=0.3)
