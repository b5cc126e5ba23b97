"""Figures of the study of partners: completion times beside each kind of partner, and of each two kinds."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from netboard.analysis.topics.measures import Levels
from netboard.base.looks import BLUE, PRINT_BODY, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HAPTICS = {"full": ("haptics on", BLUE, -0.16), "none": ("haptics off", VERMILION, 0.16)}
"""Label, colour and offset of each force condition."""

PANELS = {
    "completion time": "Completion time [s]",
    "cooperative share": "Cooperative share [%]",
    "effort of the participant": "Effort of the participant [N² s]",
}
"""Measures of the figure, with the labels of their axes."""


TICKS = {
    "completion time": (1, 2, 3, 5, 10, 20, 50),
    "effort of the participant": (0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100),
}
"""Ticks of the measures that are on a logarithmic axis."""


def draw_beside(found: Mapping[tuple[str, str, str], Levels], names: Sequence[str]) -> "Figure":
    """Draw the means with their confidence intervals, and each participant, beside each kind of partner."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 0.42 * len(names) + 1.6), layout="constrained")
    axes = figure.subplots(1, len(PANELS), sharey=True)
    for axis, (measure, label) in zip(axes, PANELS.items(), strict=True):
        for place, kind in enumerate(names):
            for force, (_, colour, offset) in HAPTICS.items():
                if (one := found.get((measure, kind, force))) is not None:
                    _draw_level(axis, one, place + offset, colour)
        axis.set_xlabel(label)
        axis.grid(axis="x", color="0.9")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    for axis, measure in zip(axes, PANELS, strict=True):
        if ticks := TICKS.get(measure):
            axis.set_xscale("log")
            axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
    axes[0].set_yticks(range(len(names)), names)
    axes[0].invert_yaxis()
    handles = [axes[0].plot([], [], "o", color=colour, label=label)[0] for label, colour, _ in HAPTICS.values()]
    figure.legend(handles=handles, loc="outside upper right", ncols=2, frameon=False)
    return figure


def _draw_level(axis: Any, one: Levels, place: float, colour: str) -> None:
    """Draw the participants, their mean and its confidence interval."""
    scale = 100.0 if one.measure.within == "share" else 1.0
    axis.plot(scale * one.values, np.full(len(one.values), place), ".", color=colour, alpha=0.3, markersize=4)
    axis.plot([scale * one.mean.low, scale * one.mean.high], [place, place], color=colour, linewidth=2)
    axis.plot(scale * one.mean.value, place, "o", color=colour, markersize=5)


def draw_pairs(times: Mapping[frozenset[str], str], names: Sequence[str]) -> "Figure":
    """Draw the mean completion time of each two kinds."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    size = 0.62 * len(names)
    figure = Figure(figsize=(size + 2.6, size + 1.2), layout="constrained")
    axis = figure.subplots()
    cells = [[times.get(frozenset((one, other)), "-") for other in names] for one in names]
    values = np.array([[float(cell) if cell[0].isdigit() else np.nan for cell in row] for row in cells])
    image = axis.imshow(values, cmap="viridis_r", norm=LogNorm(1.5, 15.0))
    for (row, column), value in np.ndenumerate(values):
        text = "–" if np.isnan(value) else f"{value:.1f}"
        axis.text(column, row, text, ha="center", va="center", fontsize=PRINT_BODY, color="w" if value > 4.5 else "k")
    axis.set_xticks(range(len(names)), names, rotation=45, ha="right")
    axis.set_yticks(range(len(names)), names)
    bar = figure.colorbar(image, ax=axis, label="Mean completion time [s]", shrink=0.8)
    bar.set_ticks([2, 3, 5, 10, 15], labels=["2", "3", "5", "10", "15"])
    bar.ax.minorticks_off()
    return figure
