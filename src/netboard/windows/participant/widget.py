"""The widget that paints a `DisplayPicture`.

It is one `QWidget` with a `QPainter`. It avoids Qt's graphics scene, because Python could free an item that Qt still
uses (docs/decisions/0025-painting-without-a-scene.md). Only the rectangle in which the picture changed is repainted.
`netboard.windows.participant.scene` decides what is drawn, `netboard.windows.participant.shapes` lists the parts.
"""

from functools import cache, lru_cache
from math import ceil

from PySide6.QtCore import QEvent, QPointF, QRect, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPaintEvent, QPen, QPolygonF, QResizeEvent, QTransform
from PySide6.QtWidgets import QSizePolicy, QWidget

from netboard.windows.participant.scene import DisplayPicture, Point
from netboard.windows.participant.shapes import (
    SMALLEST_LETTERS,
    TEXT_MARGIN,
    Panel,
    Part,
    Shape,
    Text,
    TextLine,
    shapes_of,
    words_of,
)

SPILL = 2
"""Margin around a part for antialiasing and overhanging letters [pixels]."""

WRAPPED = Qt.AlignmentFlag.AlignHCenter | Qt.TextFlag.TextWordWrap


class BoardView(QWidget):
    """Widget that shows one picture at a time."""

    painted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        # `paintEvent` fills its rectangle itself, so Qt need not erase it first.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        # Keys are for the window.
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(320, 200)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.picture: DisplayPicture | None = None
        self._mm_per_pixel = 0.0
        self._to_pixels = QTransform()
        self._parts: dict[Part, QRect] = {}

    @property
    def mm_per_pixel(self) -> float:
        """Pixel size of the screen; 0 scales the picture to the window [mm]."""
        return self._mm_per_pixel

    @mm_per_pixel.setter
    def mm_per_pixel(self, size: float) -> None:
        self._mm_per_pixel = size
        self._rearrange()

    @property
    def metres_across(self) -> float:
        """Width of the visible scene at true size; 0 if the picture is scaled to the window [m]."""
        return float(self.width() * self.devicePixelRatioF() * self._mm_per_pixel * 1e-3)

    def height_at(self, place: QPointF) -> float:
        """Height in the scene of a place in the widget [m]."""
        to_metres, _ = self._to_pixels.inverted()
        return to_metres.map(place).y()

    def pixel_at(self, point: Point) -> QPointF:
        """Position in the widget of a point of the scene [pixels]."""
        return self._to_pixels.map(QPointF(*point))

    def show_picture(self, picture: DisplayPicture) -> bool:
        """Show a picture; return whether it differs, so that a repaint follows."""
        before = self.picture
        if picture == before:
            return False
        self.picture = picture
        if before is None or (picture.extent, picture.colours.background) != (before.extent, before.colours.background):
            self._rearrange()
            return True
        parts = self._arranged(picture, self._parts)
        dirty = QRect()
        for part in self._parts.keys() ^ parts.keys():
            dirty |= parts[part] if part in parts else self._parts[part]
        self._parts = parts
        dirty &= self.rect()
        self.update(dirty if not dirty.isEmpty() else self.rect())  # callers wait for `painted`
        return True

    def event(self, event: QEvent) -> bool:
        """Adapt scale and layout to another screen, whose pixels may have another size."""
        if event.type() == QEvent.Type.DevicePixelRatioChange:
            self._rearrange()
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802  (Qt's name)
        """Adapt scale and layout to the new size."""
        super().resizeEvent(event)
        self._rearrange()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Paint the parts in the requested rectangle, then emit `painted`."""
        if self.picture is not None:
            with QPainter(self) as painter:
                painter.setRenderHint(QPainter.RenderHint.Antialiasing)
                painter.fillRect(event.rect(), QColor(self.picture.colours.background))
                for part, place in self._parts.items():
                    if place.intersects(event.rect()):
                        self._paint(painter, part)
        self.painted.emit()

    def _rearrange(self) -> None:
        """Compute the scale, lay out every part and repaint the whole window."""
        if self.picture is None:
            return
        width, height = self.picture.extent
        scale = min(self.width() / width, self.height() / height)
        if self._mm_per_pixel > 0:
            scale = self.width() / self.metres_across
        self._to_pixels = QTransform(scale, 0.0, 0.0, -scale, self.width() / 2, self.height() / 2)
        self._parts = self._arranged(self.picture, {})
        self.update()

    def _arranged(self, picture: DisplayPicture, known: dict[Part, QRect]) -> dict[Part, QRect]:
        """Lay out the parts of a picture in painting order; parts already known keep their rectangle."""
        label = self.pixel_at(picture.grip.label_at) if picture.grip is not None else QPointF()
        parts = (*shapes_of(picture), *words_of(picture, self.width(), self.height(), (label.x(), label.y())))
        return {part: known.get(part) or self._room(part) for part in parts}

    def _room(self, part: Part) -> QRect:
        """Return the rectangle that a part covers [pixels]."""
        if isinstance(part, Shape):
            reach = part.radius
            corners = QPolygonF([QPointF(x, y) for x, y in part.points]).boundingRect()
            room = self._to_pixels.mapRect(corners.adjusted(-reach, -reach, reach, reach))
        else:
            room = _line_room(part) if isinstance(part, TextLine) else QRectF(*part.place)
        spill = SPILL + (part.width if isinstance(part, Shape) else 0.0)
        return room.adjusted(-spill, -spill, spill, spill).toAlignedRect()

    def _paint(self, painter: QPainter, part: Part) -> None:
        if isinstance(part, Shape):
            painter.setTransform(self._to_pixels)
            _paint_shape(painter, part)
            painter.resetTransform()
        elif isinstance(part, Panel):
            painter.fillRect(QRectF(*part.place), QColor(part.fill))
        else:
            _paint_words(painter, part)


@cache
def _font(letters: int, bold: bool) -> QFont:
    font = QFont()
    font.setPixelSize(letters)
    font.setBold(bold)
    return font


def _line_room(line: TextLine) -> QRectF:
    """Return the rectangle of a line of text; its corner is on a whole pixel, where letters are sharpest."""
    metrics = QFontMetricsF(_font(line.letters, line.bold))
    width, height = metrics.horizontalAdvance(line.words), ceil(metrics.height())
    return QRectF(round(line.middle[0] - width / 2), round(line.middle[1] - height / 2), width, height)


def _paint_shape(painter: QPainter, shape: Shape) -> None:
    """Paint a shape; the width of its edge is in pixels at any scale."""
    if shape.edge:
        style = Qt.PenStyle.DashLine if shape.dashed else Qt.PenStyle.SolidLine
        pen = QPen(QColor(shape.edge), shape.width, style, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
        pen.setCosmetic(True)
        painter.setPen(pen)
    else:
        painter.setPen(Qt.PenStyle.NoPen)
    if shape.fill:
        painter.setBrush(QColor(shape.fill))
    else:
        painter.setBrush(Qt.BrushStyle.NoBrush)
    points = [QPointF(x, y) for x, y in shape.points]
    if shape.radius > 0:
        painter.drawEllipse(points[0], shape.radius, shape.radius)
    elif shape.closed:
        painter.drawPolygon(QPolygonF(points))
    else:
        painter.drawPolyline(QPolygonF(points))


def _paint_words(painter: QPainter, part: TextLine | Text) -> None:
    """Paint a line of text, or instructions."""
    painter.setPen(QColor(part.colour))
    if isinstance(part, TextLine):
        font = _font(part.letters, part.bold)
        painter.setFont(font)
        painter.drawText(_line_room(part).topLeft() + QPointF(0.0, QFontMetricsF(font).ascent()), part.words)
    else:
        painter.setFont(_font(_fitting_letters(part), False))
        painter.drawText(_text_room(part), WRAPPED, part.words)


def _text_room(text: Text) -> QRectF:
    return QRectF(*text.place).adjusted(TEXT_MARGIN, TEXT_MARGIN, -TEXT_MARGIN, 0)


@lru_cache(maxsize=16)
def _fitting_letters(text: Text) -> int:
    """Return the size of the font with which instructions fit their place [pixels]."""
    room, letters = _text_room(text), text.letters
    while letters > SMALLEST_LETTERS:
        needed = QFontMetricsF(_font(letters, False)).boundingRect(room, WRAPPED, text.words)
        if needed.height() <= room.height():
            break
        letters -= 1
    return letters
