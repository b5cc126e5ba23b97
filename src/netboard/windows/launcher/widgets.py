"""Widgets of the launcher: a form that is made from declarations, the table of processes, notices."""

from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPolygonF
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QGridLayout,
    QHeaderView,
    QLabel,
    QLineEdit,
    QScrollArea,
    QStyle,
    QStyleOptionComboBox,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from netboard.windows.launcher.model import Notice, ProcessRow
from netboard.windows.launcher.settings_form import FormField
from netboard.windows.operator.words import Tone
from netboard.windows.style import TONES, current_theme

COLUMNS = ("process", "state", "time and log", "machine")


ARROW = 0.5
"""Width of the arrow of a `ChoiceBox`, in heights of its letters [1]."""


class ChoiceBox(QComboBox):
    """A combo box whose arrow is as large as its letters: Qt's own has the same few pixels on every screen."""

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Draw the box, and the arrow."""
        super().paintEvent(event)
        area = self.arrow_area()
        half, middle = area.width() / 2, area.center()
        corners = (QPointF(-half, -half / 2), QPointF(half, -half / 2), QPointF(0.0, half / 2))
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().buttonText() if self.isEnabled() else self.palette().mid())
        painter.drawPolygon(QPolygonF([middle + corner for corner in corners]))
        painter.end()

    def arrow_area(self) -> QRectF:
        """Return where the arrow is [pixels]."""
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        control, part = QStyle.ComplexControl.CC_ComboBox, QStyle.SubControl.SC_ComboBoxArrow
        middle = QRectF(self.style().subControlRect(control, option, part, self)).center()
        width = ARROW * self.fontMetrics().height()
        return QRectF(middle.x() - width / 2, middle.y() - width / 4, width, width / 2)


class DeclaredForm(QScrollArea):
    """A form of fields; `entered` carries a field and its new text."""

    entered = Signal(object, str)

    def __init__(self) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.inputs: dict[str, QLineEdit | QComboBox] = {}

    def show_fields(self, fields: Sequence[FormField]) -> None:
        """Show these fields in place of all others."""
        inner = QWidget()
        grid = QGridLayout(inner)
        grid.setColumnStretch(1, 1)
        grid.setVerticalSpacing(2)
        self.inputs = {}
        for row, field in enumerate(fields):
            name = QLabel(field.key.name.replace("_", " "))
            name.setProperty("weight", "" if field.usual else "bold")  # a value that is not the default
            unit, help_text = QLabel(field.unit), QLabel(field.help)
            for small in (unit, help_text):
                small.setProperty("scale", "fine")
                small.setProperty("tone", Tone.QUIET.value)
            help_text.setWordWrap(True)
            self.inputs[field.key.name] = entry = self._input(field)
            name.setBuddy(entry)
            grid.addWidget(name, 2 * row, 0)
            grid.addWidget(entry, 2 * row, 1)
            grid.addWidget(unit, 2 * row, 2)
            grid.addWidget(help_text, 2 * row + 1, 1, 1, 2)
        grid.setRowStretch(2 * len(fields), 1)
        self.setWidget(inner)

    def _input(self, field: FormField) -> QLineEdit | QComboBox:
        if field.choices:
            box = ChoiceBox()
            box.addItems([*field.choices, *([] if field.text in field.choices else [field.text])])
            box.setCurrentText(field.text)
            box.textActivated.connect(partial(self.entered.emit, field))
            box.setAccessibleName(field.help)
            return box
        if field.suggestions:
            return self._suggesting(field)
        line = QLineEdit(field.text)
        line.editingFinished.connect(lambda: self._finished(field, line))
        line.setAccessibleName(field.help)
        return line

    def _suggesting(self, field: FormField) -> QComboBox:
        """Make an input with words to choose from, that takes any other text, too."""
        box, line = ChoiceBox(), QLineEdit()
        box.setEditable(True)
        box.setLineEdit(line)
        box.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        box.addItems(field.suggestions)
        box.setCurrentText(field.text)
        line.setModified(False)
        line.editingFinished.connect(lambda: self._finished(field, line))
        box.textActivated.connect(partial(self.entered.emit, field))
        box.setAccessibleName(field.help)
        return box

    def _finished(self, field: FormField, line: QLineEdit) -> None:
        if line.isModified():  # leaving a field also finishes it
            line.setModified(False)
            self.entered.emit(field, line.text())


class ProcessTable(QTableWidget):
    """The processes and tasks; `toggled` carries the name of one that is to be started or stopped."""

    toggled = Signal(str)

    def __init__(self) -> None:
        super().__init__(0, len(COLUMNS))
        self.setHorizontalHeaderLabels(COLUMNS)
        self.verticalHeader().hide()
        self.setShowGrid(False)
        self.setTabKeyNavigation(False)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setStretchLastSection(True)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.activated.connect(lambda _: self.toggled.emit(self.selected))
        self._rows: list[ProcessRow] = []
        self._theme = current_theme()

    @property
    def selected(self) -> str:
        """Name of the selected process; empty if none is."""
        row = self.currentRow()
        return self._rows[row].name if 0 <= row < len(self._rows) else ""

    def select(self, name: str) -> None:
        """Select a process."""
        self.selectRow([row.name for row in self._rows].index(name))

    def show_rows(self, rows: list[ProcessRow]) -> None:
        """Show these rows; the selection stays."""
        if (rows, current_theme()) == (self._rows, self._theme):
            return
        self._rows, self._theme = rows, current_theme()
        self.setRowCount(len(rows))
        for number, row in enumerate(rows):
            texts = (row.name, row.state.words, row.detail, row.machine)
            for column, words in enumerate(texts):
                item = self.item(number, column)
                if item is None:
                    item = QTableWidgetItem()
                    self.setItem(number, column, item)
                item.setText(words)
                tone = row.state.tone if column == 1 else Tone.PLAIN
                item.setForeground(QColor(getattr(current_theme(), TONES[tone.value])))
        if self.currentRow() < 0 and rows:
            self.selectRow(0)


class NoticeList(QWidget):
    """Notices below each other; those that stay say how they are read."""

    def __init__(self) -> None:
        super().__init__()
        self._rows = QVBoxLayout(self)
        self._rows.setContentsMargins(0, 0, 0, 0)
        self._shown: list[Notice] = []

    def show_notices(self, notices: Sequence[Notice]) -> None:
        """Show the last three."""
        wanted = list(notices[-3:])
        if wanted == self._shown:
            return
        self._shown = wanted
        while (item := self._rows.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.deleteLater()
        for notice in wanted:
            line = QLabel(notice.words + ("    [Ctrl+D: read]" if notice.stays else ""))
            line.setProperty("fill", "watch" if notice.stays else "plain")
            line.setWordWrap(True)
            self._rows.addWidget(line)
