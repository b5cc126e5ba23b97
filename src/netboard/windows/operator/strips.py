"""Strip charts of the last ten seconds: heights, forces, ball.

The server sends the points a few at a time; a ring buffer keeps them. Axes are fixed and lines are thin and without
antialiasing, to save processor time on a computer that may also run 1 kHz loops.
"""

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QVBoxLayout, QWidget

from netboard.base.config import Config
from netboard.base.looks import ColourTheme
from netboard.base.tick import TICK_SECONDS
from netboard.network.protocol.control import TracePoint
from netboard.windows.plots import dress, share_time_axis

SECONDS = 10.0
"""Time span of the charts [s]."""

KEPT = 2000
"""Size of the ring buffer: every fifth tick of that time span [1]."""

GAP_TICKS = 50
"""Points further apart than this are not connected [1]."""


class StripCharts(QWidget):
    """Three strip charts, one above the other; axis limits and target positions come from the configuration."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self._ring = np.full((len(TracePoint._fields), KEPT), np.nan)
        self._count = 0
        self._newest = -1
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(2)
        reach, force = config.task.stylus_range * 1e3, config.safety.max_force
        half, target = config.geometry.board_length * 500, config.geometry.target_distance * 1e3
        heights = (("left", "left"), ("right", "right"), ("board", "board"))
        forces = (("left", "left_force"), ("right", "right_force"))
        self._plots: list[pg.PlotWidget] = []
        self._lines = [
            *self._strip(rows, "height [mm]", reach * 1.05, (), heights, 1e3),
            *self._strip(rows, "force [N]", force * 1.1, (-force, force), forces, 1.0),
            *self._strip(rows, "ball [mm]", half, (-target, target), (("ball", "ball"),), 1e3),
        ]
        share_time_axis(self._plots)

    def take_look(self, theme: ColourTheme, base: int) -> None:
        """Take a theme and the letter height of the main text [pixels]."""
        dress(self._plots, [(line, line.name()) for line, _, _ in self._lines], theme, base)

    def take(self, points: Sequence[TracePoint], *, restart: bool = False) -> None:
        """Append the new points; clear the buffer first if `restart`, or if a replay goes back in time."""
        if restart or (points and points[-1].tick < self._newest):
            self._ring[:] = np.nan
            self._count, self._newest = 0, -1
        new = list(takewhile(lambda point: point.tick > self._newest, reversed(points)))
        for point in reversed(new):
            if self._newest >= 0 and point.tick - self._newest > GAP_TICKS:
                self._put(TracePoint(self._newest + 1, *[np.nan] * 7))
            self._put(point)
            self._newest = point.tick

    def redraw(self) -> None:
        """Draw all points; the newest is at zero seconds."""
        size = min(self._count, KEPT)
        order = np.arange(self._count - size, self._count) % KEPT
        points = dict(zip(TracePoint._fields, self._ring[:, order], strict=True))
        times = (points["tick"] - self._newest) * TICK_SECONDS
        for line, field, scale in self._lines:
            line.setData(times, points[field] * scale)

    def _put(self, point: TracePoint) -> None:
        self._ring[:, self._count % KEPT] = point
        self._count += 1

    def _strip(
        self,
        rows: QVBoxLayout,
        name: str,
        most: float,
        marks: tuple[float, ...],
        lines: tuple[tuple[str, str], ...],
        scale: float,
    ) -> list[tuple[pg.PlotDataItem, str, float]]:
        """Make one chart; return its lines, each with its field and scale; a line's name is its role in the theme."""
        plot = pg.PlotWidget(self)
        plot.setLabel("left", name)
        plot.getAxis("left").enableAutoSIPrefix(False)
        self._plots.append(plot)
        plot.setMinimumHeight(70)
        plot.setXRange(-SECONDS, 0.0, padding=0.0)
        plot.setYRange(-most, most, padding=0.0)
        plot.setMouseEnabled(x=False, y=False)
        plot.setMenuEnabled(False)
        plot.hideButtons()
        plot.disableAutoRange()
        plot.addLine(y=0.0)
        for mark in marks:
            plot.addLine(y=mark, pen=pg.mkPen(style=pg.QtCore.Qt.PenStyle.DashLine))
        if len(lines) > 1:
            plot.addLegend(offset=(8, 2), colCount=len(lines))
        rows.addWidget(plot, 1)
        return [(plot.plot(name=name, connect="finite"), field, scale) for name, field in lines]
