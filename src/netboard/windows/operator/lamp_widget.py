"""Lamp widgets. Each is painted by hand, and only when it changes, so that many lamps cost little.

A sign before the text repeats the level. Lamps that are fine are dim and problems are bright, so that a glance finds
them.
"""

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QSizePolicy, QWidget

from netboard.windows.operator.lamps import Lamp, LampLevel
from netboard.windows.operator.words import Tone, TonedText
from netboard.windows.style import current_theme, fills_of, set_role

FACES = {
    LampLevel.OFF: ("quiet", "\u2013"),
    LampLevel.GOOD: ("good", "\u2713"),
    LampLevel.WATCH: ("watch", "!"),
    LampLevel.BAD: ("bad", "\u2715"),
}
"""Fill and sign of each level."""

WIDEST = "\u2715 LIMITED +3.30 N"
"""A long text of a lamp, which fits."""

HIGH = 1.3
"""Height of a lamp, in lines of its text [1]."""

MARGIN = 0.4
"""Space beside the text of a lamp, in its letter heights [1]."""


class LampWidget(QWidget):
    """Widget of one lamp."""

    def __init__(self) -> None:
        super().__init__()
        self.lamp: Lamp | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)

    def sizeHint(self) -> QSize:  # noqa: N802  (Qt's name)
        """Return the preferred size [pixels]."""
        return self.minimumSizeHint()

    def minimumSizeHint(self) -> QSize:  # noqa: N802  (Qt's name)
        """Return the smallest size, in which most texts fit [pixels]."""
        letters = QFontMetrics(self._font(bold=True))
        width = letters.horizontalAdvance(WIDEST) + round(2 * MARGIN * letters.height())
        return QSize(width, round(HIGH * letters.height()))

    def set_lamp(self, lamp: Lamp) -> None:
        """Show a lamp; do nothing if it is unchanged."""
        if lamp == self.lamp:
            return
        before, self.lamp = self.lamp, lamp
        if before is None or lamp.tip != before.tip:
            self.setToolTip(f"<b>{lamp.name}</b><br>{lamp.tip}")
        if before is None or (lamp.level, lamp.words) != (before.level, before.words):
            self.setAccessibleName(f"{lamp.name}: {lamp.words}")
            self.update()

    @property
    def words(self) -> str:
        """The text with the sign of the level."""
        if self.lamp is None:
            return ""
        return f"{FACES[self.lamp.level][1]} {self.lamp.words}".strip()

    @property
    def fits(self) -> bool:
        """Whether the text is shown whole."""
        bold = self.lamp is not None and self.lamp.level > LampLevel.GOOD
        letters = QFontMetrics(self._font(bold=bold))
        return letters.horizontalAdvance(self.words) <= self.width() - 2 * MARGIN * letters.height()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802  (Qt's name)
        """Adapt the size to another font."""
        super().changeEvent(event)
        if event.type() in (QEvent.Type.FontChange, QEvent.Type.StyleChange):
            self.updateGeometry()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Paint background, sign and text."""
        super().paintEvent(event)
        if self.lamp is None:
            return
        back, front = fills_of(current_theme())[FACES[self.lamp.level][0]]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(back))
        area = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        painter.drawRoundedRect(area, 5, 5)
        painter.setFont(self._font(bold=self.lamp.level > LampLevel.GOOD))
        painter.setPen(QColor(front))
        margin = MARGIN * painter.fontMetrics().height()
        room = area.adjusted(margin, 0, -margin, 0)
        fitting = painter.fontMetrics().elidedText(self.words, Qt.TextElideMode.ElideRight, round(room.width()) + 2)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter | Qt.TextFlag.TextDontClip, fitting)
        painter.end()

    def _font(self, *, bold: bool) -> QFont:
        font = QFont(self.font())
        font.setBold(bold)
        return font


class StationLamps(QWidget):
    """The lamps of both stations: one row per lamp, one column per side, below who and what is at that seat."""

    def __init__(self, names: Sequence[str], sides: Sequence[str]) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(3)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(2, 1)
        self.columns: dict[str, list[LampWidget]] = {}
        self.seats: dict[str, QLabel] = {}
        for row, name in enumerate(names, 1):
            grid.addWidget(label(name), row, 0)
            grid.setRowStretch(row, 1)
        for column, side in enumerate(sides, 1):
            self.seats[side] = seat = label("")
            seat.setWordWrap(True)
            seat.setAlignment(Qt.AlignmentFlag.AlignTop)
            seat.setMinimumWidth(1)
            grid.addWidget(seat, 0, column)
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
        grid.setVerticalSpacing(1)
        self.widgets = [LampWidget() for _ in names]
        for column, (name, widget) in enumerate(zip(names, self.widgets, strict=True)):
            grid.addWidget(label(name, "fine", Tone.QUIET), 0, column)
            widget.setProperty("scale", "strong")
            grid.addWidget(widget, 1, column)
            grid.setColumnStretch(column, 1)

    def set_lamps(self, lamps: Sequence[Lamp]) -> None:
        """Show the lamps."""
        for widget, lamp in zip(self.widgets, lamps, strict=True):
            widget.set_lamp(lamp)


def label(words: str, scale: str = "", tone: Tone = Tone.PLAIN, *, bold: bool = False) -> QLabel:
    """Make a label with a size of the type scale and a tone."""
    made = QLabel(words)
    made.setProperty("scale", scale)
    made.setProperty("weight", "bold" if bold else "")
    made.setProperty("tone", tone.value)
    return made


def say(where: QLabel, line: TonedText, role: str = "tone") -> None:
    """Write a line to a label if it has changed, with its tone as the role of its text or of its fill."""
    if where.text() != line.words:
        where.setText(line.words)
        where.setToolTip(line.words)
    set_role(where, role, line.tone.value)
    if role == "fill":
        set_role(where, "tone", "")
