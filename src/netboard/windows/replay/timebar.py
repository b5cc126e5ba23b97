"""The time line below a replay: ball trajectory, target, marks, and a cursor that can be dragged.

Each recording has its own lane on the common time line.
"""

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFont
from PySide6.QtWidgets import QWidget

from netboard.base.looks import DARK, PINK, SKY, VERMILION, YELLOW
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.marks import KINDS, Mark, trial_starts
from netboard.recording.replay.pairing import Pairing
from netboard.windows.participant.scene import COLOURS, Colours, PictureState

MAX_POINTS = 4000
"""Most points drawn per line; more cannot be distinguished on a screen [1]."""

HEIGHT, AXIS_HEIGHT = 86, 24
"""Height of a lane, and of the axis below [pixels]."""

LANE, FREE = 1.0, 0.16
"""Height of a lane, and the share at its top that is reserved for trial numbers [1]."""

MAX_NUMBERS = 40
"""Most trial numbers that fit side by side [1]."""

LETTERS = 10
"""Letter height of the trial numbers [pixels]."""

MARKS = {
    "trial": (DARK.frame, Qt.PenStyle.SolidLine, (0.0, 1.0)),
    "release": (SKY, Qt.PenStyle.DotLine, (0.0, 1 - FREE)),
    "success": (DARK.good, Qt.PenStyle.SolidLine, (0.0, 1 - FREE)),
    "failure": (VERMILION, Qt.PenStyle.SolidLine, (0.0, 1 - FREE)),
    "stop": (YELLOW, Qt.PenStyle.DashLine, (0.0, 1 - FREE)),
    "note": (PINK, Qt.PenStyle.SolidLine, (0.0, 1.0)),
    "event": (DARK.detail, Qt.PenStyle.SolidLine, (0.0, 0.14)),
    "gap": (VERMILION, Qt.PenStyle.DashDotLine, (0.0, 1.0)),
}
"""Colour, line style and vertical span in the lane of each kind of mark; kinds differ in more than colour."""


class TimeBar(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no type hints
    """Time line of whole recordings.

    Signals
    -------
    sought : float
        Emitted with the time that the user clicks or drags to, from the start of the time line [s].
    """

    sought = Signal(float)

    def __init__(self, recordings: Sequence[LoadedRecording], pairing: Pairing, parent: QWidget | None = None) -> None:
        self._colours: Colours = COLOURS[PictureState.RUN]
        super().__init__(parent, background=self._colours.background)
        self.setFixedHeight(HEIGHT * len(recordings) + AXIS_HEIGHT)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAntialiasing(True)
        self._set_up(max(pairing.length, 1e-3), len(recordings))
        for which, recording in enumerate(recordings):
            self._draw_lane(recording, pairing, which, len(recordings))
        self._loop = pg.LinearRegionItem(brush=pg.mkBrush("#ffffff18"), pen=pg.mkPen(None), movable=False)
        self._loop.setVisible(False)
        self.addItem(self._loop, ignoreBounds=True)
        self.cursor_line = pg.InfiniteLine(0.0, movable=True, pen=pg.mkPen(self._colours.cursor, width=2))
        self.addItem(self.cursor_line, ignoreBounds=True)
        self.cursor_line.sigDragged.connect(lambda line: self.sought.emit(float(line.value())))
        self.scene().sigMouseClicked.connect(self._clicked)

    def _set_up(self, length: float, lanes: int) -> None:
        plot = self.getPlotItem()
        plot.setMenuEnabled(False)
        plot.hideButtons()
        plot.setMouseEnabled(x=True, y=False)
        plot.hideAxis("left")
        plot.getAxis("bottom").setPen(self._colours.guide)
        plot.getAxis("bottom").setTextPen(self._colours.detail)
        plot.setLimits(xMin=0.0, xMax=length)
        plot.setRange(xRange=(0.0, length), yRange=(-lanes * LANE, 0.0), padding=0.0)
        for below in range(1, lanes):
            self.addItem(pg.InfiniteLine(-below * LANE, angle=0, pen=pg.mkPen(self._colours.guide)), ignoreBounds=True)

    def _draw_lane(self, recording: LoadedRecording, pairing: Pairing, which: int, lanes: int) -> None:
        """Draw target, marks and ball of one recording."""
        times = np.linspace(0.0, pairing.length, min(MAX_POINTS, len(recording.ticks)))
        rows = np.array([recording.at(pairing.at(time)[which]) for time in times.tolist()])
        geometry = recording.config.geometry
        height = LANE * (1 - FREE) / geometry.board_length
        middle = -LANE * (which + 1) + LANE * (1 - FREE) / 2
        target = middle + recording.ticks["target"][rows] * geometry.target_distance * height
        half = geometry.target_width / 2 * height
        edges = [pg.PlotDataItem(times, target + edge) for edge in (-half, half)]
        self.addItem(pg.FillBetweenItem(*edges, brush=pg.mkBrush(self._colours.target)), ignoreBounds=True)
        bottom, top = (lanes - 1 - which) / lanes, 1 / lanes
        for mark in sorted(recording.marks, key=lambda one: KINDS.index(one.kind)):  # a success covers the next trial
            colour, style, (low, high) = MARKS[mark.kind]
            span = bottom + low * top, bottom + high * top
            pen = pg.mkPen(colour, width=1.5, style=style)
            line = pg.InfiniteLine(pairing.of(which, mark.time), pen=pen)
            line.setSpan(*span)
            self.addItem(line, ignoreBounds=True)
        if recording.config.physics.balls:
            ball = middle + recording.ticks["p"][rows] * height
            self.plot(times, ball, pen=pg.mkPen(self._colours.ball, width=1.5))
        self._number(trial_starts(recording.marks), pairing, which)

    def _number(self, trials: list[Mark], pairing: Pairing, which: int) -> None:
        """Write the trial numbers, as many as fit."""
        font = QFont(self.font())
        font.setPixelSize(LETTERS)
        for mark in trials[:: max(1, ceil(len(trials) / MAX_NUMBERS))]:
            number = pg.TextItem(str(mark.trial), color=self._colours.detail, anchor=(-0.15, 0.1))
            number.setFont(font)
            number.setPos(pairing.of(which, mark.time), -LANE * which)
            self.addItem(number, ignoreBounds=True)

    def point_at(self, time: float) -> None:
        """Move the cursor to a time [s]."""
        self.cursor_line.setValue(time)

    def show_loop(self, loop: tuple[float, float] | None) -> None:
        """Show the loop; None hides it."""
        self._loop.setVisible(loop is not None)
        if loop is not None:
            self._loop.setRegion(loop)

    def _clicked(self, event: Any) -> None:
        """Seek to the time that the user clicks."""
        if event.button() == Qt.MouseButton.LeftButton:
            self.sought.emit(float(self.getPlotItem().vb.mapSceneToView(event.scenePos()).x()))
