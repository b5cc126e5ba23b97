"""The widget that draws a `Picture`.

Everything that moves is an item of a pyqtgraph view box in metres, everything that is read is an item in pixels.
Only items that differ from the picture before are touched, so Qt repaints no more of the window than has changed, and
nothing at all for an equal picture. The widget decides nothing: what is drawn is decided in `netboard.display.scene`.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QFont, QPaintEvent, QPen, QPolygonF, QResizeEvent
from PySide6.QtWidgets import (
    QGraphicsEllipseItem,
    QGraphicsItem,
    QGraphicsLineItem,
    QGraphicsPolygonItem,
    QGraphicsSimpleTextItem,
    QGraphicsView,
    QWidget,
)

from netboard.display.scene import CURSOR_RADIUS, HANDLE_RADIUS, Colours, Picture, Point
from netboard.errors import NetboardError

Item = TypeVar("Item", bound=QGraphicsItem)

LINES = {
    "headline": (0.075, 0.052),
    "detail": (0.140, 0.034),
    "notice": (0.900, 0.034),
    "counter": (0.955, 0.024),
}
"""Each line of words: its middle and its height, in heights of the window [1]."""

ALONE = {"headline": 0.46, "detail": 0.54}
"""Middles of the lines when there is nothing but words [1]."""

MOST_ROUND = 2
"""Handles and cursors there can be: one a side [1]."""


class BoardView(pg.GraphicsView):  # type: ignore[misc]  # pyqtgraph has no type hints
    """A view of the board that shows one picture at a time.

    Signals
    -------
    painted
        After every paint event.
    """

    painted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, background=None)
        self.setAntialiasing(True)
        self.setViewportUpdateMode(QGraphicsView.ViewportUpdateMode.BoundingRectViewportUpdate)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(320, 200)
        self.picture: Picture | None = None
        self._metres = pg.ViewBox(lockAspect=True, enableMouse=False, enableMenu=False, defaultPadding=0.0)
        self.setCentralItem(self._metres)
        self._guide = self._placed(QGraphicsLineItem())
        self._board = self._placed(QGraphicsPolygonItem())
        self._target = self._placed(QGraphicsPolygonItem())
        self._handles = [self._placed(_disc(HANDLE_RADIUS)) for _ in range(MOST_ROUND)]
        self._ball = self._placed(QGraphicsEllipseItem())
        self._cursors = [self._placed(_disc(CURSOR_RADIUS)) for _ in range(MOST_ROUND)]
        self._words = {name: QGraphicsSimpleTextItem() for name in LINES}
        for item in self._words.values():
            self.scene().addItem(item)

    def _placed(self, item: Item) -> Item:
        """Put an item into the metric view."""
        self._metres.addItem(item, ignoreBounds=True)
        return item

    def show_picture(self, picture: Picture) -> bool:
        """Show a picture; tell whether it was another one, so that a repaint will follow."""
        before = self.picture
        if picture == before:
            return False
        self.picture = picture
        if before is None or picture.extent != before.extent:
            width, height = picture.extent
            self._metres.setRange(QRectF(-width / 2, -height / 2, width, height), padding=0)
        if before is None or picture.colours != before.colours:
            self._paint_with(picture.colours)
        self._move(picture)
        self._write(picture)
        return True

    def _paint_with(self, colours: Colours) -> None:
        """Give every item its colour."""
        self.setBackground(colours.background)
        self._guide.setPen(_pen(colours.guide, 2, Qt.PenStyle.DashLine))
        self._board.setBrush(QColor(colours.board))
        self._board.setPen(_pen(colours.edge, 1.5))
        self._target.setBrush(QColor(colours.target))
        self._target.setPen(_pen(colours.target, 1.5))
        self._ball.setBrush(QColor(colours.ball))
        self._ball.setPen(QPen(Qt.PenStyle.NoPen))
        for handle in self._handles:
            handle.setBrush(QColor(colours.background))
            handle.setPen(QPen(Qt.PenStyle.NoPen))
        for cursor in self._cursors:
            cursor.setBrush(QBrush(Qt.BrushStyle.NoBrush))
            cursor.setPen(_pen(colours.cursor, 3))
        for name, item in self._words.items():
            item.setBrush(QColor({"headline": colours.headline, "counter": colours.quiet}.get(name, colours.detail)))

    def _move(self, picture: Picture) -> None:
        """Put every item where the picture has it."""
        self._board.setPolygon(_polygon(picture.board))
        self._target.setPolygon(_polygon(picture.target))
        _set_round(self._handles, picture.handles)
        _set_round(self._cursors, picture.cursors)
        self._ball.setVisible(picture.ball is not None)
        if picture.ball is not None:
            radius = picture.ball_radius
            self._ball.setRect(-radius, -radius, 2 * radius, 2 * radius)
            self._ball.setPos(*picture.ball)
        self._guide.setVisible(picture.guide is not None)
        if picture.guide is not None:
            self._guide.setLine(-picture.guide, 0.0, picture.guide, 0.0)

    def _write(self, picture: Picture) -> None:
        """Write the words, centred on their lines."""
        width, height = self.width(), self.height()
        for name, item in self._words.items():
            middle, size = LINES[name]
            if not picture.board:
                middle = ALONE.get(name, middle)
            font = QFont(self.font())
            font.setPixelSize(max(8, round(size * height)))
            item.setFont(font)
            item.setText(getattr(picture, name))
            box = item.boundingRect()
            item.setPos(round((width - box.width()) / 2), round(middle * height - box.height() / 2))

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: N802  (Qt's name)
        """Keep the words in their places."""
        super().resizeEvent(event)
        picture: Picture | None = getattr(self, "picture", None)  # pyqtgraph resizes before it has been set
        if picture is not None:
            self._write(picture)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Paint, and say so."""
        super().paintEvent(event)
        self.painted.emit()


def screenshot(widget: QWidget, path: Path) -> None:
    """Write what a widget shows to a PNG file.

    Raises
    ------
    NetboardError
        If the file exists already, or cannot be written.
    """
    if path.exists():
        raise NetboardError(f"{path} exists; a screenshot never overwrites a file")
    path.parent.mkdir(parents=True, exist_ok=True)
    if not widget.grab().save(str(path), "PNG"):
        raise NetboardError(f"cannot write a screenshot to {path}")


def _disc(radius: float) -> QGraphicsEllipseItem:
    """Make a disc about its own origin."""
    return QGraphicsEllipseItem(-radius, -radius, 2 * radius, 2 * radius)


def _pen(colour: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Make a pen whose width is in pixels, whatever the scale."""
    pen = QPen(QColor(colour), width, style, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
    pen.setCosmetic(True)
    return pen


def _polygon(points: Iterable[Point]) -> QPolygonF:
    """Hand the points over to Qt."""
    return QPolygonF([QPointF(x, y) for x, y in points])


def _set_round(items: list[QGraphicsEllipseItem], centres: tuple[Point, ...]) -> None:
    """Put as many of the items as there are centres on them, and hide the rest."""
    for i, item in enumerate(items):
        item.setVisible(i < len(centres))
        if i < len(centres):
            item.setPos(*centres[i])
