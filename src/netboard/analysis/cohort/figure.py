"""Figure of power and false-positive rate against the number of dyads, a panel for each measure."""

from collections.abc import Sequence
from textwrap import fill

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netboard.analysis.cohort.power import Power
from netboard.analysis.topics.figure import BLACK, BLUE, GREEN, ORANGE, PINK, SKY, STYLE, VERMILION, beside, new_figure

COLOURS = (BLUE, VERMILION, GREEN, ORANGE, SKY, PINK, BLACK)
MARKERS = "osD^vPX"
"""Markers of the contrasts, in the order of their colours."""

ACROSS = 2
"""Panels in a row [1]."""

SPREAD = 0.6
"""Horizontal distance between the first and the last contrast [dyads]."""


def draw(found: Sequence[Power], alpha: float, assumptions: str) -> Figure:
    """Draw power (filled) and false-positive rate (hollow, dashed) with Monte Carlo confidence intervals."""
    with mpl.rc_context(STYLE):
        return _drawn(found, alpha, assumptions)


def _drawn(found: Sequence[Power], alpha: float, assumptions: str) -> Figure:
    measures = list(dict.fromkeys(one.measure for one in found))
    contrasts = list(dict.fromkeys((one.contrast, one.trials) for one in found))
    rows = -(-len(measures) // ACROSS)
    figure, axes = new_figure(1.1 + 2.0 * rows, min(ACROSS, len(measures)), rows)
    for place, panel in enumerate(axes):
        panel.set_visible(place < len(measures))
    for panel, measure in zip(axes, measures, strict=False):
        for which, key in enumerate(contrasts):
            own = [one for one in found if (one.measure, one.contrast, one.trials) == (measure, *key)]
            shift = beside(len(contrasts), SPREAD)[which]
            _lines(panel, sorted(own, key=lambda one: one.dyads), which, _name(*key), shift)
        _frame(panel, measure, sorted({one.dyads for one in found}), alpha)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2)
    figure.supxlabel(fill(f"Filled: power; hollow: false positives. {assumptions}.", 130), fontsize=6.5)
    return figure


def _lines(axes: Axes, own: Sequence[Power], which: int, name: str, shift: float) -> None:
    """Draw one contrast, shifted so that it does not cover others."""
    colour, marker = COLOURS[which % len(COLOURS)], MARKERS[which % len(MARKERS)]
    for rates, face, line, label in (
        ([one.power for one in own], colour, "-", name),
        ([one.false_positives for one in own], "white", "--", f"_{name}, false positives"),
    ):
        values = [rate.value for rate in rates]
        bars = [[rate.value - rate.low for rate in rates], [rate.high - rate.value for rate in rates]]
        axes.errorbar(
            [one.dyads + shift for one in own],
            values,
            bars,
            color=colour,
            marker=marker,
            markerfacecolor=face,
            markersize=4,
            linestyle=line,
            linewidth=0.9,
            label=label,
        )


def _frame(axes: Axes, measure: str, sizes: Sequence[int], alpha: float) -> None:
    """Set title and axes of a panel."""
    for height in (alpha, 0.8):
        axes.axhline(height, color="#888888", linewidth=0.6, zorder=0)
    axes.set_title(measure, loc="left")
    axes.set_xticks(sizes)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel("dyads [1]")
    axes.set_ylabel("share of studies [1]")


def _name(contrast: str, trials: int) -> str:
    return f"{contrast}, {trials} trials" if trials else contrast
