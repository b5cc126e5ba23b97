"""Quality of the recordings: falls and exclusions of every block, and completion times over the sessions.

The numbers come from `netboard.analysis.results.quality`.
"""

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study, pooled
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import look_of, new_mosaic, styled, titled
from netboard.analysis.figures.measures import legend
from netboard.analysis.results.groups import Condition, conditions
from netboard.analysis.results.quality import Quality, quality

TITLE = "What was recorded"

_READABLE = 30
"""Largest number of dyads with numbers in the squares [1]."""


@styled
def picture(study: Study) -> Picture:
    """Draw the quality of the recordings."""
    found = quality(study)
    if not len(found.blocks):
        return Picture("quality", TITLE, "There is no recording.", None)
    dyads = found.blocks["dyad"].nunique()
    tall = 0.55 + 0.2 * min(dyads, 40)
    figure, axes = new_mosaic(2.6 + tall, [["falls", "excluded"], ["times", "times"]], height_ratios=[tall, 2.2])
    _counts(axes["falls"], found, "fell")
    titled(axes["falls"], "A", "attempts that fell [1]")
    _counts(axes["excluded"], found, "excluded")
    titled(axes["excluded"], "B", "attempts excluded [1]")
    _times(axes["times"], found, study)
    titled(axes["times"], "C", "completion time through the session")
    legend(figure, of_blocks(study), "outside lower center")
    return Picture("quality", TITLE, _caption(found, dyads), figure)


def of_blocks(study: Study) -> tuple[Condition, ...]:
    """Return the conditions of blocks, without the levels of factors that vary within them."""
    return conditions(pooled(study, [factor.name for factor in study.factors if factor.scope == "trial"]))


def _counts(axes: Axes, found: Quality, column: str) -> None:
    """Draw a square for each block, darker for higher counts; blocks without a recording are empty."""
    table = found.blocks.pivot(index="dyad", columns="block", values=column)
    values = table.to_numpy(float)
    most = max(float(np.nanmax(values)), 1.0)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=1.6 * most, aspect="auto", label=f"_{column}")
    if not np.nansum(values):
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", va="center", fontsize=7.5)
    if len(table) <= _READABLE:
        for row, column_number in zip(*np.nonzero(np.nan_to_num(values)), strict=True):
            axes.text(column_number, row, f"{values[row, column_number]:.0f}", ha="center", va="center", fontsize=6.5)
    axes.set_yticks(range(len(table)), table.index if len(table) <= _READABLE else [""] * len(table), fontsize=7)
    step = _step(table.shape[1])
    axes.set_xticks(range(0, table.shape[1], step), table.columns[::step], fontsize=7)
    axes.set_xlabel("block of the plan [1]")
    axes.set_ylabel("dyad")


def _step(blocks: int) -> int:
    """Return the step between labelled blocks on an axis, starting with the first."""
    return max(1, blocks // 9)


def _times(axes: Axes, found: Quality, study: Study) -> None:
    """Draw the geometric mean of each block, joined within a dyad."""
    for dyad, own in found.blocks.groupby("dyad"):
        axes.plot(own["block"], own["time"], color="#BBBBBB", linewidth=0.6, zorder=1, label=f"_{dyad}")
    for condition in of_blocks(study):
        look = look_of(condition)
        own = found.blocks[found.blocks["condition"] == condition.label]
        axes.plot(
            own["block"],
            own["time"],
            linestyle="none",
            marker=look.marker,
            markersize=4,
            color=look.colour,
            markerfacecolor=look.face,
            zorder=2,
            label=f"_{condition.name}",
        )
    axes.set_ylim(bottom=0.0)
    blocks = np.unique(found.blocks["block"])
    axes.set_xticks(blocks[:: _step(len(blocks))])
    axes.set_xlim(blocks[0] - 0.5, blocks[-1] + 0.5)
    axes.set_xlabel("block of the plan [1]")
    axes.set_ylabel("completion time [s]")


def _caption(found: Quality, dyads: int) -> str:
    total = found.blocks[["attempts", "success", "fell", "timed_out", "excluded", "counts", "missing"]].sum()
    reasons = "; ".join(f"{why}: {number}" for why, number in found.reasons.items())
    return (
        f"Blocks of {dyads} {'dyad' if dyads == 1 else 'dyads'}: {total['attempts']} attempts, of which "
        f"{total['success']} succeeded, {total['fell']} fell and {total['timed_out']} timed out; {total['excluded']} "
        f"are excluded{f' ({reasons})' if reasons else ''}, {total['counts']} trials count, {total['missing']} ticks "
        "are missing. A, B: how many in each block. C: geometric mean of each block's trials that count, a line for "
        f"each dyad. {_drift(found)}"
    )


def _drift(found: Quality) -> str:
    """Return a sentence on the drift of times from block to block."""
    if not np.isfinite(found.drift.value):
        return "No drift can be told from conditions."
    ends = f" [{_percent(found.drift.low)}, {_percent(found.drift.high)}]" if np.isfinite(found.drift.low) else ""
    interval = f", 95 % t interval over {found.drift.n} dyads" if ends else ""
    return (
        f"Within a performer and a condition, times change by {_percent(found.drift.value)}{ends} from block to "
        f"block{interval}."
    )


def _percent(ratio: float) -> str:
    return f"{100 * (ratio - 1):+.1f} %"
