"""Lamp widgets. Each is painted by hand, and only when it changes, so that many lamps cost little.

Colours are from the colour-blind-safe Okabe-Ito palette; a sign before the text repeats the level. Lamps that are fine
are dim and problems are bright, so that a glance finds them.
"""

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QSizePolicy, QWidget

from netboard.windows.operator.lamps import Lamp, LampLevel
from netboard.windows.operator.words import Tone
from netboard.windows.participant.scene import COLOURS, PictureState

PLAIN = COLOURS[PictureState.RUN]
GOOD, WATCH, BAD = "#2fc79b", "#e69f00", "#d55e00"
PANEL = "#1b2129"
"""Background of panels."""

FACES = {
    LampLevel.OFF: (PANEL, PLAIN.quiet, "\u2013"),
    LampLevel.GOOD: ("#123a30", GOOD, "\u2713"),
    LampLevel.WATCH: (WATCH, PLAIN.background, "!"),
    LampLevel.BAD: (BAD, "#ffffff", "\u2715"),
}
"""Background, text colour and sign of each level."""

TONES = {Tone.QUIET: PLAIN.quiet, Tone.PLAIN: PLAIN.headline, Tone.GOOD: GOOD, Tone.WATCH: WATCH, Tone.BAD: "#ff7a2f"}
"""Text colour of each tone."""


class LampWidget(QWidget):
    """Widget of one lamp."""

    def __init__(self, points: int = 12) -> None:
        super().__init__()
        self.lamp: Lamp | None = None
        self._points = points
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(96, round(1.9 * points))

    def sizeHint(self) -> QSize:  # noqa: N802  (Qt's name)
        """Return the preferred size [pixels]."""
        return QSize(150, round(2.4 * self._points))

    def set_lamp(self, lamp: Lamp) -> None:
        """Show a lamp; do nothing if it is unchanged."""
        if lamp == self.lamp:
            return
        before, self.lamp = self.lamp, lamp
        if before is None or lamp.tip != before.tip:
            self.setToolTip(f"<b>{lamp.name}</b><br>{lamp.tip}")
        if before is None or (lamp.level, lamp.words) != (before.level, before.words):
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Paint background, sign and text."""
        super().paintEvent(event)
        if self.lamp is None:
            return
        back, front, sign = FACES[self.lamp.level]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(back))
        area = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        painter.drawRoundedRect(area, 5, 5)
        font = QFont(self.font())
        font.setPointSizeF(self._points)
        font.setBold(self.lamp.level > LampLevel.GOOD)
        painter.setFont(font)
        painter.setPen(QColor(front))
        words = f"{sign} {self.lamp.words}" if self.lamp.words else sign
        fitting = painter.fontMetrics().elidedText(words, Qt.TextElideMode.ElideRight, round(area.width()) - 12)
        painter.drawText(area.adjusted(8, 0, -4, 0), Qt.AlignmentFlag.AlignVCenter, fitting)
        painter.end()


class StationLamps(QWidget):
    """The lamps of both stations: one row per lamp, one column per side."""

    def __init__(self, names: Sequence[str], sides: Sequence[str]) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(3)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(2, 1)
        self.columns: dict[str, list[LampWidget]] = {}
        for row, name in enumerate(names, 1):
            grid.addWidget(label(name, 12, Tone.PLAIN), row, 0)
        for column, side in enumerate(sides, 1):
            head = label(side.upper(), 13, Tone.PLAIN, bold=True)
            head.setAlignment(Qt.AlignmentFlag.AlignCenter)
            grid.addWidget(head, 0, column)
            self.columns[side] = [LampWidget() for _ in names]
            for row, widget in enumerate(self.columns[side], 1):
                grid.addWidget(widget, row, column)

    def set_lamps(self, side: str, lamps: Sequence[Lamp]) -> None:
        """Show the lamps of one side."""
        for widget, lamp in zip(self.columns[side], lamps, strict=True):
            widget.set_lamp(lamp)


class SessionLamps(QWidget):
    """The lamps of the session, side by side."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(6)
        grid.setVerticalSpacing(2)
        self.widgets = [LampWidget(15) for _ in names]
        for column, (name, widget) in enumerate(zip(names, self.widgets, strict=True)):
            grid.addWidget(label(name, 10, Tone.QUIET), 0, column)
            widget.setFixedHeight(38)
            grid.addWidget(widget, 1, column)
            grid.setColumnStretch(column, 1)

    def set_lamps(self, lamps: Sequence[Lamp]) -> None:
        """Show the lamps."""
        for widget, lamp in zip(self.widgets, lamps, strict=True):
            widget.set_lamp(lamp)


def label(words: str, points: int, tone: Tone, *, bold: bool = False) -> QLabel:
    """Make a label with a font size [pt] and a tone."""
    made = QLabel(words)
    font = QFont(made.font())
    font.setPointSize(points)
    font.setBold(bold)
    made.setFont(font)
    made.setStyleSheet(f"color: {TONES[tone]};")
    return made
