"""The widget that draws a `Picture`.

Everything that moves is an item of a pyqtgraph view box in metres, everything that is read is an item in pixels.
Only items that differ from the picture before are touched, so Qt repaints no more of the window than has changed, and
nothing at all for an equal picture. The widget decides nothing: what is drawn is decided in `netboard.display.scene`.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol, TypeVar

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QFont, QPaintEvent, QPen, QPolygonF, QResizeEvent, QTextOption
from PySide6.QtWidgets import (
    QGraphicsEllipseItem,
    QGraphicsItem,
    QGraphicsLineItem,
    QGraphicsPolygonItem,
    QGraphicsRectItem,
    QGraphicsSimpleTextItem,
    QGraphicsTextItem,
    QGraphicsView,
    QWidget,
)

from netboard.display.scene import (
    CURSOR_RADIUS,
    HANDLE_RADIUS,
    PILOT_BACK,
    PILOT_INK,
    Colours,
    Grip,
    Picture,
    Point,
)
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

ABOVE_TEXT = {"headline": 0.18, "detail": 0.26}
"""Middles of the lines above instructions [1]."""

TEXT_TOP, TEXT_WIDTH, TEXT_HEIGHT = 0.32, 0.68, 0.036
"""Where instructions begin, how wide they are, and the height of their letters, in sizes of the window [1]."""

BAND = 0.042
"""Height of the band that marks a pilot run, at the top of the window [1]."""

PATCH = 0.09
"""Side of the patch for a photodiode, in the lower right corner, in heights of the window [1]."""

WRITTEN = ("board", "text", "headline", "detail", "notice", "counter", "pilot", "patch")
"""Parts of a picture on which the words depend."""

MOST_ROUND = 2
"""Handles and cursors there can be: one a side [1]."""


class Overlay(Protocol):
    """What shows a player's hand on top of the board."""

    def show_grip(self, grip: Grip) -> None:
        """Put everything where it belongs now."""


class BoardView(pg.GraphicsView):  # type: ignore[misc]  # pyqtgraph has no type hints
    """A view of the board that shows one picture at a time.

    Signals
    -------
    painted
        After every paint event.

    Attributes
    ----------
    mm_per_pixel : float
        Size of a pixel of the screen; 0 lets the picture fill the window [mm].
    """

    painted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, background=None)
        self.setAntialiasing(True)
        self.setViewportUpdateMode(QGraphicsView.ViewportUpdateMode.BoundingRectViewportUpdate)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(320, 200)
        self.picture: Picture | None = None
        self.overlay: Overlay | None = None
        self._mm_per_pixel = 0.0
        self._metres = pg.ViewBox(lockAspect=True, enableMouse=False, enableMenu=False, defaultPadding=0.0)
        self.setCentralItem(self._metres)
        self._guide = self.placed(QGraphicsLineItem())
        self._board = self.placed(QGraphicsPolygonItem())
        self._target = self.placed(QGraphicsPolygonItem())
        self._fill = self.placed(QGraphicsPolygonItem())
        self._handles = [self.placed(_disc(HANDLE_RADIUS)) for _ in range(MOST_ROUND)]
        self._bar = self.placed(QGraphicsPolygonItem())
        self._level = self.placed(QGraphicsPolygonItem())
        self._arrows = [self.placed(QGraphicsPolygonItem()) for _ in range(MOST_ROUND)]
        self._ball = self.placed(QGraphicsEllipseItem())
        self._cursors = [self.placed(_disc(CURSOR_RADIUS)) for _ in range(MOST_ROUND)]
        self._words = {name: QGraphicsSimpleTextItem() for name in LINES}
        self._text = QGraphicsTextItem()
        self._band, self._patch = QGraphicsRectItem(), QGraphicsRectItem()
        self._pilot = QGraphicsSimpleTextItem()
        for item in (*self._words.values(), self._text, self._band, self._pilot, self._patch):
            self.scene().addItem(item)
        self._paint_marks()

    @property
    def mm_per_pixel(self) -> float:
        """Size of a pixel of the screen; 0 lets the picture fill the window [mm]."""
        return self._mm_per_pixel

    @mm_per_pixel.setter
    def mm_per_pixel(self, size: float) -> None:
        self._mm_per_pixel = size
        if self.picture is not None:
            self._zoom(self.picture)

    @property
    def metres_across(self) -> float:
        """Width of what the window shows, where that is in true size; else 0 [m]."""
        return float(self.width() * self.devicePixelRatioF() * self._mm_per_pixel * 1e-3)

    def _zoom(self, picture: Picture) -> None:
        """Show the whole extent, or as much of the metric view as is as large as the window in truth."""
        width, height = picture.extent
        if self._mm_per_pixel > 0:
            width, height = self.metres_across, self.metres_across * self.height() / self.width()
        self._metres.setRange(QRectF(-width / 2, -height / 2, width, height), padding=0)

    def placed(self, item: Item) -> Item:
        """Put an item into the metric view."""
        self._metres.addItem(item, ignoreBounds=True)
        return item

    def height_at(self, place: QPointF) -> float:
        """Height of a place on the surface, given in pixels [m]."""
        scene, _ = self.viewportTransform().inverted()
        return float(self._metres.mapSceneToView(scene.map(place)).y())

    def pixel_at(self, point: Point) -> QPointF:
        """Where a point of the metric view is, in pixels."""
        place: QPointF = self._metres.mapViewToScene(QPointF(*point))
        return place

    def show_picture(self, picture: Picture) -> bool:
        """Show a picture; tell whether it was another one, so that a repaint will follow."""
        before = self.picture
        if picture == before:
            return False
        self.picture = picture
        if before is None or picture.extent != before.extent:
            self._zoom(picture)
        if before is None or picture.colours != before.colours:
            self._paint_with(picture.colours)
        self._move(picture)
        if before is None or any(_differ(name, picture, before) for name in WRITTEN):
            self._write(picture)
        if self.overlay is not None and picture.grip is not None:
            self.overlay.show_grip(picture.grip)
        return True

    def _paint_marks(self) -> None:
        """Give their colours to what always has the same: the band of a pilot run, the instructions' margin."""
        none = QPen(Qt.PenStyle.NoPen)
        self._band.setPen(none)
        self._band.setBrush(QColor(PILOT_BACK))
        self._pilot.setBrush(QColor(PILOT_INK))
        bold = QFont(self.font())
        bold.setBold(True)
        self._pilot.setFont(bold)
        self._patch.setPen(none)
        for shape in (self._fill, self._level, *self._arrows):
            shape.setPen(none)
        centred = QTextOption(Qt.AlignmentFlag.AlignHCenter)
        centred.setWrapMode(QTextOption.WrapMode.WordWrap)
        self._text.document().setDefaultTextOption(centred)

    def _paint_with(self, colours: Colours) -> None:
        """Give every item its colour."""
        self.setBackground(colours.background)
        self._guide.setPen(cosmetic_pen(colours.guide, 2, Qt.PenStyle.DashLine))
        self._board.setBrush(QColor(colours.board))
        self._board.setPen(cosmetic_pen(colours.edge, 1.5))
        self._target.setBrush(QColor(colours.target))
        self._target.setPen(cosmetic_pen(colours.target, 1.5))
        self._fill.setBrush(QColor(colours.fill))
        self._level.setBrush(QColor(colours.fill))
        self._bar.setBrush(QColor(colours.background))
        self._bar.setPen(cosmetic_pen(colours.detail, 1.5))
        for arrow in self._arrows:
            arrow.setBrush(QColor(colours.hint))
        self._text.setDefaultTextColor(QColor(colours.headline))
        self._ball.setBrush(QColor(colours.ball))
        self._ball.setPen(QPen(Qt.PenStyle.NoPen))
        for handle in self._handles:
            handle.setBrush(QColor(colours.background))
            handle.setPen(QPen(Qt.PenStyle.NoPen))
        for cursor in self._cursors:
            cursor.setBrush(QBrush(Qt.BrushStyle.NoBrush))
            cursor.setPen(cosmetic_pen(colours.cursor, 3))
        for name, item in self._words.items():
            item.setBrush(QColor({"headline": colours.headline, "counter": colours.quiet}.get(name, colours.detail)))

    def _move(self, picture: Picture) -> None:
        """Put every item where the picture has it."""
        self._board.setPolygon(polygon(picture.board))
        self._target.setPolygon(polygon(picture.target))
        self._fill.setPolygon(polygon(picture.fill))
        self._bar.setPolygon(polygon(picture.bar))
        self._level.setPolygon(polygon(picture.level))
        for i, arrow in enumerate(self._arrows):
            arrow.setPolygon(polygon(picture.arrows[i] if i < len(picture.arrows) else ()))
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
        places = {} if picture.board else ABOVE_TEXT if picture.text else ALONE
        for name, item in self._words.items():
            middle, size = LINES[name]
            letters = round(size * height)
            _write_line(item, getattr(picture, name), letters, QPointF(width / 2, places.get(name, middle) * height))
        font = QFont(self.font())
        font.setPixelSize(max(8, round(TEXT_HEIGHT * min(height, width / 1.4))))
        self._text.setFont(font)
        self._text.setTextWidth(TEXT_WIDTH * width)
        self._text.setPlainText(picture.text)
        self._text.setPos((1 - TEXT_WIDTH) / 2 * width, TEXT_TOP * height)
        band = round(BAND * height)
        self._band.setVisible(bool(picture.pilot))
        self._band.setRect(0, 0, width, band)
        _write_line(self._pilot, picture.pilot, round(0.7 * band), QPointF(width / 2, band / 2))
        side = round(PATCH * height)
        self._patch.setVisible(picture.patch is not None)
        self._patch.setRect(width - side, height - side, side, side)
        self._patch.setBrush(QColor("#ffffff" if picture.patch else "#000000"))

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: N802  (Qt's name)
        """Keep the scale and the words in their places."""
        super().resizeEvent(event)
        picture: Picture | None = getattr(self, "picture", None)  # pyqtgraph resizes before it has been set
        if picture is not None:
            self._zoom(picture)
            self._write(picture)
            if self.overlay is not None and picture.grip is not None:
                self.overlay.show_grip(picture.grip)

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


def cosmetic_pen(colour: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Make a pen whose width is in pixels, whatever the scale."""
    pen = QPen(QColor(colour), width, style, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
    pen.setCosmetic(True)
    return pen


def polygon(points: Iterable[Point]) -> QPolygonF:
    """Hand the points over to Qt."""
    return QPolygonF([QPointF(x, y) for x, y in points])


def _differ(name: str, one: Picture, other: Picture) -> bool:
    """Whether a part of two pictures makes the words different; of the board, only whether there is one."""
    a, b = getattr(one, name), getattr(other, name)
    return bool(a) != bool(b) if name == "board" else a != b


def _write_line(item: QGraphicsSimpleTextItem, words: str, letters: int, middle: QPointF) -> None:
    """Write a line about a place, in pixels."""
    font = QFont(item.font())
    font.setPixelSize(max(8, letters))
    item.setFont(font)
    item.setText(words)
    box = item.boundingRect()
    item.setPos(round(middle.x() - box.width() / 2), round(middle.y() - box.height() / 2))


def _set_round(items: list[QGraphicsEllipseItem], centres: tuple[Point, ...]) -> None:
    """Put as many of the items as there are centres on them, and hide the rest."""
    for i, item in enumerate(items):
        item.setVisible(i < len(centres))
        if i < len(centres):
            item.setPos(*centres[i])
