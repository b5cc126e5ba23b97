"""The time line below a replay: the ball's way, the target, what happened, and a line that can be dragged."""

from typing import Any

import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QWidget

from netboard.config import Config
from netboard.display.scene import COLOURS, Mood
from netboard.display.timeline import marks, seconds

MOST_POINTS = 4000
"""More points than that are not to be told apart on a screen; then only every n-th tick is drawn [1]."""

HEIGHT = 110

MARKS = {
    "release": ("#56b4e9", Qt.PenStyle.DotLine),
    "success": ("#2fc79b", Qt.PenStyle.SolidLine),
    "failure": ("#d55e00", Qt.PenStyle.SolidLine),
    "stop": ("#f0e442", Qt.PenStyle.DashLine),
}
"""Colour and line of each kind of mark: they differ in both, or in brightness."""


class TimeBar(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no type hints
    """A whole recording at a glance.

    Signals
    -------
    sought : float
        The user points at a time, from the start of the recording [s].
    """

    sought = Signal(float)

    def __init__(self, ticks: NDArray[Any], config: Config, parent: QWidget | None = None) -> None:
        colours = COLOURS[Mood.RUN]
        super().__init__(parent, background=colours.background)
        self.setFixedHeight(HEIGHT)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAntialiasing(True)
        self._draw(ticks, config)
        self.cursor_line = pg.InfiniteLine(0.0, movable=True, pen=pg.mkPen(colours.cursor, width=2))
        self.addItem(self.cursor_line, ignoreBounds=True)
        self.cursor_line.sigDragged.connect(lambda line: self.sought.emit(float(line.value())))
        self.scene().sigMouseClicked.connect(self._clicked)

    def _draw(self, ticks: NDArray[Any], config: Config) -> None:
        """Draw what does not move."""
        colours = COLOURS[Mood.RUN]
        every = max(1, len(ticks) // MOST_POINTS)
        times = seconds(ticks)[::every]
        geometry = config.geometry
        target = ticks["target"][::every] * geometry.target_distance
        half_target, half = geometry.target_width / 2, geometry.board_length / 2
        plot = self.getPlotItem()
        plot.setMenuEnabled(False)
        plot.hideButtons()
        plot.setMouseEnabled(x=True, y=False)
        plot.hideAxis("left")
        plot.getAxis("bottom").setPen(colours.guide)
        plot.getAxis("bottom").setTextPen(colours.detail)
        length = max(float(seconds(ticks)[-1]), 1e-3)
        plot.setLimits(xMin=0.0, xMax=length)
        plot.setRange(xRange=(0.0, length), yRange=(-half, half), padding=0.0)
        edges = [pg.PlotDataItem(times, target + edge) for edge in (-half_target, half_target)]
        self.addItem(pg.FillBetweenItem(*edges, brush=pg.mkBrush(colours.target)), ignoreBounds=True)
        for mark in marks(ticks):
            colour, style = MARKS[mark.kind]
            self.addItem(pg.InfiniteLine(mark.time, pen=pg.mkPen(colour, width=1.5, style=style)), ignoreBounds=True)
        if config.physics.balls:
            self.plot(times, ticks["p"][::every], pen=pg.mkPen(colours.ball, width=1.5))

    def point_at(self, time: float) -> None:
        """Move the line.

        Parameters
        ----------
        time : float
            From the start of the recording [s].
        """
        self.cursor_line.setValue(time)

    def _clicked(self, event: Any) -> None:
        """Seek where the user clicks."""
        if event.button() == Qt.MouseButton.LeftButton:
            self.sought.emit(float(self.getPlotItem().vb.mapSceneToView(event.scenePos()).x()))
