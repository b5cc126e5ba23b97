"""The look of live plots: axes, letters and grid in the colours and sizes of a theme."""

from collections.abc import Sequence
from typing import Any

import pyqtgraph as pg
from PySide6.QtGui import QFont

from netboard.base.looks import FINE, ColourTheme

AXIS_WIDTH, AXIS_HEIGHT = 4.8, 2.7
"""Width of the vertical axes, so that the time axes align, and height of the labelled time axis, in letter heights of
the main text [1]."""

LINE_LETTERS = 14
"""Letter height of the main text per pixel of a line's width [pixels]."""


def dress(plots: Sequence[Any], lines: Sequence[tuple[Any, str]], theme: ColourTheme, base: int) -> None:
    """Give plots and lines their look; each line comes with its role in the theme. ``base``: letter height [pixels].

    The lowest plot has the values and the label of the time axis.
    """
    small = QFont()
    small.setPixelSize(round(FINE * base))
    for plot in plots:
        plot.setBackground(theme.background)
        for place in ("left", "bottom"):
            axis = plot.getAxis(place)
            axis.setTickFont(small)
            axis.setPen(theme.line)
            axis.setTextPen(theme.detail)
            axis.label.setFont(small)
            axis.setLabel(axis.labelText, color=theme.text, **{"font-size": f"{base}px"})
        plot.getAxis("left").setWidth(round(AXIS_WIDTH * base))
        if plot.getAxis("bottom").label.isVisible():
            plot.getAxis("bottom").setHeight(round(AXIS_HEIGHT * base))
        legend = plot.getPlotItem().legend
        for _, name in () if legend is None else legend.items:
            name.setText(name.text, color=theme.text, size=f"{base}px")
        for item in plot.getPlotItem().items:
            if isinstance(item, pg.InfiniteLine):
                item.setPen(pg.mkPen(theme.line, style=item.pen.style()))
    for line, role in lines:
        line.setPen(pg.mkPen(getattr(theme, role), width=max(1, round(base / LINE_LETTERS))))


def share_time_axis(plots: Sequence[Any]) -> None:
    """Label the time axis of the lowest plot only."""
    *upper, lowest = plots
    for plot in upper:
        plot.getAxis("bottom").setStyle(showValues=False, tickLength=0)
    lowest.setLabel("bottom", "time [s]")
    lowest.getAxis("bottom").enableAutoSIPrefix(False)
