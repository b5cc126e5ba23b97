"""Live view of one haptic device: position and velocity of the last seconds, buttons, and readiness for forces.

It is for operators, not for participants. The device is read in this process and gets no force. Esc or Q closes it.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QKeyEvent
from PySide6.QtWidgets import QLabel, QVBoxLayout

from netboard.base.errors import DeviceError
from netboard.base.looks import ColourTheme, ThemeName
from netboard.devices.contract.device import Reading
from netboard.windows.participant import window as windows
from netboard.windows.plots import dress, share_time_axis
from netboard.windows.style import StyledWindow, choose_theme

READ_MS, DRAW_MS = 4, 33
"""Interval between two readings, and between two redraws [ms]."""

SECONDS = 10.0
"""Time span of the plots [s]."""

KEPT = round(SECONDS * 1000 / READ_MS)
"""Size of the ring buffer, in readings [1]."""

AXES = (("x, out of the screen", "ball"), ("y, right", "left"), ("z, up", "right"))
"""Name of each axis, and the role of its colour in the theme."""


class MonitorWindow(StyledWindow):
    """A window that shows one device."""

    def __init__(self, read: Callable[[], Reading], title: str) -> None:
        super().__init__()
        self.setWindowTitle(title)
        self.trouble: DeviceError | None = None
        self._read = read
        self._times = np.zeros(KEPT)
        self._values = np.zeros((6, KEPT))
        self._count = 0
        self._newest: Reading | None = None
        self._plots: list[pg.PlotWidget] = []
        rows = QVBoxLayout(self)
        self._lines = [*self._plot(rows, "position", "mm"), *self._plot(rows, "velocity", "mm/s")]
        self.words = QLabel(self)
        rows.addWidget(self.words)
        share_time_axis(self._plots)
        self.resize(1000, 700)
        self._timers = [self._every(READ_MS, self.take), self._every(DRAW_MS, self.redraw)]

    def take_look(self, theme: ColourTheme, base: int) -> None:
        """Take a theme and the letter height of the main text [pixels]."""
        roles = [role for _ in self._plots for _, role in AXES]
        dress(self._plots, list(zip(self._lines, roles, strict=True)), theme, base)

    def take(self) -> None:
        """Take one reading; close the window if the device fails."""
        try:
            r = self._read()
        except DeviceError as error:
            self.trouble = error
            self.close()
            return
        at = self._count % KEPT
        self._times[at] = r.stamp_ns * 1e-9
        self._values[:, at] = np.array((r.x, r.y, r.z, r.vx, r.vy, r.vz)) * 1e3
        self._count += 1
        self._newest = r

    def redraw(self) -> None:
        """Draw all readings; the newest is at zero seconds."""
        if self._newest is None:
            return
        size = min(self._count, KEPT)
        order = np.arange(self._count - size, self._count) % KEPT
        times = self._times[order] - self._newest.stamp_ns * 1e-9
        for line, values in zip(self._lines, self._values[:, order], strict=True):
            line.setData(times, values)
        self.words.setText(in_words(self._newest))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Close the window with Esc or Q."""
        if event.key() in (Qt.Key.Key_Escape, Qt.Key.Key_Q):
            self.close()
        else:
            super().keyPressEvent(event)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802  (Qt's name)
        """Stop the timers and emit `closed`."""
        for timer in self._timers:
            timer.stop()
        super().closeEvent(event)

    def dismantle(self) -> None:
        """Take a closed window apart in order; else a part of pyqtgraph may be called when others are gone."""
        while self._plots:
            self._plots.pop().close()

    def _plot(self, rows: QVBoxLayout, name: str, unit: str) -> list[pg.PlotDataItem]:
        plot = pg.PlotWidget(self)
        plot.setLabel("left", f"{name} [{unit}]")
        plot.getAxis("left").enableAutoSIPrefix(False)
        plot.setXRange(-SECONDS, 0.0, padding=0.0)
        plot.setMouseEnabled(x=False, y=False)
        plot.hideButtons()
        plot.showGrid(x=True, y=True, alpha=0.2)
        plot.addLegend(offset=(8, 2), colCount=len(AXES))
        rows.addWidget(plot, 1)
        self._plots.append(plot)
        return [plot.plot(name=axis) for axis, _ in AXES]

    def _every(self, milliseconds: int, do: Callable[[], None]) -> QTimer:
        timer = QTimer(self, interval=milliseconds, timerType=Qt.TimerType.PreciseTimer)
        timer.timeout.connect(do)
        timer.start()
        return timer


def in_words(reading: Reading) -> str:
    """Format a reading in one line."""
    pressed = [str(bit) for bit in range(reading.buttons.bit_length()) if reading.buttons >> bit & 1]
    place = "  ".join(f"{axis} {value * 1e3:+8.2f}" for axis, value in zip("xyz", reading[1:4], strict=True))
    ready = "ready for forces" if reading.ready else "NOT ready for forces"
    return f"{place} mm      buttons: {', '.join(pressed) or 'none'}      {ready}"


def run(
    read: Callable[[], Reading],
    title: str,
    stopping: Callable[[], bool],
    picture: Path | None = None,
    theme: ThemeName = "system",
) -> None:
    """Show a device until the window is closed or the process is asked to stop."""
    windows.require_new(picture)
    windows.application()
    choose_theme(theme)
    window = MonitorWindow(read, title)
    window.show()
    windows.run(window, stopping)
    if picture is not None:
        window.redraw()
        windows.screenshot(window, picture)
    window.close()
    window.dismantle()
    if window.trouble is not None:
        raise window.trouble
