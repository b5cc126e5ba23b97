"""What a player sees of the own hand, as Qt items over the board. `netboard.display.grip` decides what is drawn."""

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QFont, QPainterPath, QPen, QPolygonF
from PySide6.QtWidgets import QGraphicsPathItem, QGraphicsPolygonItem, QGraphicsSimpleTextItem

from netboard.display.scene import Colours, Grip, Point
from netboard.display.widget import BoardView, cosmetic_pen, polygon

FORCE = "#cc79a7"
"""Of spring and arrow; from the Okabe-Ito palette, as the other colours."""

HINTS = (0.805, 0.845)
"""Middles of the two lines of the hint, in heights of the window [1]."""

HINT_HEIGHT, HINT_WIDTH = 0.026, 0.019
"""Height of a hint's letters, at most so much of the window's height and of its width [1]."""

LABEL_HEIGHT = 0.034
"""Height of the letters of the force's size, in heights of the window [1]."""


class GripItems:
    """The items of one board.

    Parameters
    ----------
    board : BoardView
        Where they are drawn.
    """

    def __init__(self, board: BoardView) -> None:
        self._board = board
        self._spring = board.placed(QGraphicsPathItem())
        self._mark = board.placed(QGraphicsPathItem())
        self._arrow = board.placed(QGraphicsPolygonItem())
        self._label, *self._hints = (QGraphicsSimpleTextItem() for _ in range(1 + len(HINTS)))
        for item in (self._label, *self._hints):
            board.scene().addItem(item)
        self._spring.setPen(cosmetic_pen(FORCE, 2))
        self._mark.setPen(cosmetic_pen(Colours().headline, 4))
        self._arrow.setPen(QPen(Qt.PenStyle.NoPen))
        self._arrow.setBrush(QColor(FORCE))
        self._label.setBrush(QColor(FORCE))
        for item in self._hints:
            item.setBrush(QColor(Colours().detail))

    def show_grip(self, grip: Grip) -> None:
        """Put every item where it belongs now."""
        self._spring.setPath(_path(grip.spring))
        self._mark.setPath(_path(grip.mark))
        self._arrow.setPolygon(polygon(grip.arrow))
        width, height = self._board.width(), self._board.height()
        _write(self._label, grip.label, LABEL_HEIGHT * height, self._board.pixel_at(grip.label_at))
        letters = min(HINT_HEIGHT * height, HINT_WIDTH * width)
        for item, words, middle in zip(self._hints, grip.hint, HINTS, strict=True):
            _write(item, words, letters, QPointF(width / 2, middle * height))


def _path(points: tuple[Point, ...]) -> QPainterPath:
    """A line from point to point; empty for none."""
    path = QPainterPath()
    if points:
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in points]))
    return path


def _write(item: QGraphicsSimpleTextItem, words: str, letters: float, middle: QPointF) -> None:
    """Write words about a place, in pixels."""
    font = QFont(item.font())
    font.setPixelSize(max(8, round(letters)))
    item.setFont(font)
    item.setText(words)
    box = item.boundingRect()
    item.setPos(round(middle.x() - box.width() / 2), round(middle.y() - box.height() / 2))
