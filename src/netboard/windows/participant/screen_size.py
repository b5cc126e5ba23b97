"""Measure the pixel size of a screen by matching the outline of a bank card.

Bank cards have the size ID-1 (ISO/IEC 7810): 85.60 mm by 53.98 mm. The left and right keys change the outline by one
pixel, with shift by ten; Enter accepts, Esc cancels.
"""

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent, QPen

from netboard.windows.participant.scene import COLOURS, PictureState
from netboard.windows.participant.window import Window, application, in_words, numbered_screen, run

CARD_WIDTH, CARD_HEIGHT, CARD_CORNER = 85.60, 53.98, 3.18
"""Width, height and corner radius of a bank card [mm]."""

LEAST, GUESS = 0.02, 0.25
"""Smallest plausible pixel size, and the size assumed if the screen does not report one [mm]."""

HELP = (
    "Hold a bank card against the screen and match its width with \u2190 \u2192 (Shift: faster).",
    "Its height must match too; otherwise the pixels are not square.   Enter: done   Esc: cancel",
)


class CalibrationWindow(Window):
    """A window that shows the outline of a card, and a ruler; `claimed` is the pixel size that the screen reports."""

    def __init__(self, claimed: float) -> None:
        super().__init__()
        self.setWindowTitle("netboard: measure the pixel size")
        self.done = False
        self._card = round(CARD_WIDTH / (claimed if claimed > LEAST else GUESS))

    @property
    def mm_per_pixel(self) -> float:
        """Pixel size measured with the card [mm]."""
        return CARD_WIDTH / self._card

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Change the width, accept it, or cancel."""
        step = 10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
        most = round(self.width() * self.devicePixelRatioF())
        match event.key():
            case Qt.Key.Key_Right | Qt.Key.Key_Up:
                self._card = min(self._card + step, most)
            case Qt.Key.Key_Left | Qt.Key.Key_Down:
                self._card = max(self._card - step, 50)
            case Qt.Key.Key_Return | Qt.Key.Key_Enter:
                self.done = True
                self.close()
            case Qt.Key.Key_Escape | Qt.Key.Key_Q:
                self.close()
            case _:
                super().keyPressEvent(event)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Draw outline, ruler and text."""
        colours = COLOURS[PictureState.RUN]
        with QPainter(self) as painter:
            painter.fillRect(self.rect(), QColor(colours.background))
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            mm = 1 / (self.mm_per_pixel * self.devicePixelRatioF())
            middle = QPointF(self.width() / 2, self.height() * 0.42)
            card = QRectF(0, 0, CARD_WIDTH * mm, CARD_HEIGHT * mm)
            card.moveCenter(middle)
            painter.setPen(QPen(QColor(colours.hint), 1))
            painter.drawRoundedRect(card, CARD_CORNER * mm, CARD_CORNER * mm)
            self._rule(painter, QPointF(middle.x(), card.bottom() + 12 * mm), mm)
            font = painter.font()
            font.setPixelSize(max(12, round(self.height() * 0.024)))
            painter.setFont(font)
            painter.setPen(QColor(colours.headline))
            lines = (*HELP, f"mm_per_pixel = {self.mm_per_pixel:.4f}")
            for i, line in enumerate(lines):
                box = QRectF(0, self.height() * (0.80 + 0.05 * i), self.width(), self.height() * 0.05)
                painter.drawText(box, Qt.AlignmentFlag.AlignCenter, line)

    def _rule(self, painter: QPainter, top: QPointF, mm: float) -> None:
        """Draw a ruler as long as the card, with a tick mark per millimetre."""
        begin = top.x() - CARD_WIDTH / 2 * mm
        painter.setPen(QPen(QColor(COLOURS[PictureState.RUN].detail), 1))
        for i in range(int(CARD_WIDTH) + 1):
            x, length = begin + i * mm, 5 if i % 10 == 0 else 3.5 if i % 5 == 0 else 2
            painter.drawLine(QPointF(x, top.y()), QPointF(x, top.y() + length * mm))


def calibrate(number: int) -> tuple[float | None, str]:
    """Return the measured pixel size [mm], or None if cancelled, and the description of the screen."""
    application()
    screen = numbered_screen(number)
    pixels = screen.size().width() * screen.devicePixelRatio()
    window = CalibrationWindow(screen.physicalSize().width() / pixels if pixels else 0.0)
    window.setGeometry(screen.geometry())
    window.showFullScreen()
    run(window, lambda: False)
    return window.mm_per_pixel if window.done else None, in_words(number, screen)
