"""What a window does not show whole, and which of its controls no key reaches."""

from collections.abc import Iterator

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QApplication,
    QComboBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QTableView,
    QWidget,
)

from netboard.windows.operator.lamp_widget import LampWidget
from netboard.windows.participant.shapes import TextLine
from netboard.windows.participant.widget import BoardView

LEAST_LETTERS = 11
"""Least letter height of any text [pixels]."""

CONTROLS = (QAbstractButton, QLineEdit, QComboBox, QPlainTextEdit, QAbstractItemView)


def cut_texts(window: QWidget) -> list[str]:
    """Return the texts that a window shows in part only, or in letters that are too small."""
    found: list[str] = []
    for widget in window.findChildren(QWidget):
        if widget.isVisibleTo(window) and not widget.visibleRegion().isEmpty():
            found += _cut(widget)
    return found


def _cut(widget: QWidget) -> Iterator[str]:
    match widget:
        case LampWidget():
            if not widget.fits:
                yield widget.words
        case QLabel() | QAbstractButton():
            if widget.text() and not _has_room(widget, widget.text()):
                yield widget.text()
        case QTableView():
            yield from _cut_cells(widget)
        case BoardView():
            for part, place in widget._parts.items():
                if isinstance(part, TextLine) and not widget.rect().contains(place):
                    yield part.words
        case QLineEdit():
            words = widget.text() or widget.placeholderText()
            if widget.fontMetrics().horizontalAdvance(words) > widget.width():
                yield words


def _has_room(widget: QLabel | QAbstractButton, text: str) -> bool:
    """Return whether a text fits into its widget, and its letters are large enough."""
    letters, room = widget.fontMetrics(), widget.contentsRect()
    wraps = isinstance(widget, QLabel) and widget.wordWrap()
    if wraps:
        needed = QSize(room.width(), widget.heightForWidth(widget.width()))
        fits = needed.height() <= widget.height() and _longest(widget, text) <= room.width()
    else:
        needed = letters.size(0, text)
        fits = needed.width() <= room.width() and needed.height() <= widget.height()
    return fits and widget.font().pixelSize() >= LEAST_LETTERS


def _longest(widget: QWidget, text: str) -> int:
    """Return the width of the longest word [pixels]."""
    return max(widget.fontMetrics().horizontalAdvance(word) for word in text.split())


def _cut_cells(table: QTableView) -> Iterator[str]:
    """Yield the cells in the visible rows, and the heads, that do not fit."""
    model, head = table.model(), table.horizontalHeader()
    for column in range(model.columnCount()):
        name = str(model.headerData(column, Qt.Orientation.Horizontal))
        if head.fontMetrics().horizontalAdvance(name) > head.sectionSize(column):
            yield name
        for row in range(model.rowCount()):
            index = model.index(row, column)
            place = table.visualRect(index)
            if table.viewport().rect().contains(place) and (words := str(index.data() or "")):
                room = QRect(0, 0, place.width(), 10_000)
                needed = table.fontMetrics().boundingRect(room, Qt.TextFlag.TextWordWrap, words)
                if needed.width() > place.width() or needed.height() > place.height():
                    yield words


def unreached(window: QWidget) -> list[str]:
    """Return the controls that can be used now, and neither Tab nor a key that is written on them reaches."""
    window.setFocus()
    reached: set[QWidget | None] = set()
    while window.focusNextChild() and (now := QApplication.focusWidget()) not in reached:
        reached.add(now)
    keys = {
        one.key().toString(QKeySequence.SequenceFormat.PortableText)
        for one in window.findChildren(QShortcut)
        if one.isEnabled()
    }
    controls = [one for one in window.findChildren(QWidget) if isinstance(one, CONTROLS) and _usable(one, window)]
    return [_words_on(one) for one in controls if not _among(one, reached) and not _named(one, keys)]


def _among(widget: QWidget, reached: set[QWidget | None]) -> bool:
    """Return whether a control was reached, or chooses by arrows or digits in a group of which one was."""
    group = widget.group() if isinstance(widget, QAbstractButton) else None
    others = group.buttons() if group is not None else []
    return bool(reached & {widget, widget.parentWidget(), *others})


def _usable(widget: QWidget, window: QWidget) -> bool:
    """Return whether a control can be used, and is not a part of another one."""
    inner = isinstance(widget.parentWidget(), QComboBox) or isinstance(widget, QHeaderView)
    return widget.isVisibleTo(window) and widget.isEnabled() and not inner


def _words_on(widget: QWidget) -> str:
    words = getattr(widget, "text", lambda: "")() or getattr(widget, "placeholderText", lambda: "")()
    return words or type(widget).__name__


def _named(widget: QWidget, keys: set[str]) -> bool:
    """Return whether a key that reaches a control is written on it."""
    words = _words_on(widget).replace(",", " ").split()
    return any(word in keys for word in words)
