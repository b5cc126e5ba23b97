"""Widgets of the launcher: a form that is made from declarations, the table of processes, notices."""

from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QGridLayout,
    QHeaderView,
    QLabel,
    QLineEdit,
    QScrollArea,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from netboard.windows.launcher.model import Notice, ProcessRow
from netboard.windows.launcher.settings_form import FormField
from netboard.windows.operator.lamp_widget import PANEL, PLAIN, TONES
from netboard.windows.operator.words import Tone, TonedText

COLUMNS = ("process", "state", "time and log", "machine")


def style(base: int) -> str:
    """Return the style sheet for a size of letters [pixels]."""
    quiet, text, frame = TONES[Tone.QUIET], PLAIN.headline, PLAIN.guide
    return f"""
QWidget {{ background: {PLAIN.background}; color: {text}; font-size: {base}px; }}
QLabel#badge {{ font-size: {round(1.6 * base)}px; font-weight: bold; padding: {base // 3}px; border-radius: 8px; }}
QLabel#help, QLabel#unit, QLabel#command {{ color: {quiet}; font-size: {round(0.86 * base)}px; }}
QLabel#notice {{ padding: {base // 3}px {base}px; border-radius: 6px; }}
QLabel#problem {{ color: {TONES[Tone.BAD]}; }}
QLineEdit, QComboBox, QPlainTextEdit, QTableWidget, QListWidget {{ background: {PANEL}; border: 2px solid {frame};
    border-radius: 5px; padding: {base // 5}px; selection-background-color: {PLAIN.target}; }}
QLineEdit:focus, QComboBox:focus, QPlainTextEdit:focus, QTableWidget:focus, QListWidget:focus, QPushButton:focus
    {{ border-color: {PLAIN.cursor}; }}
QPlainTextEdit {{ font-family: monospace; font-size: {round(0.86 * base)}px; }}
QPushButton {{ background: {PANEL}; border: 2px solid {frame}; border-radius: 5px;
    padding: {base // 3}px {round(0.7 * base)}px; }}
QPushButton:checked {{ background: {PLAIN.target}; }}
QPushButton#start {{ background: #123a30; }}
QPushButton#halt {{ background: #d55e00; color: white; font-weight: bold; }}
QHeaderView::section {{ background: {PLAIN.background}; color: {quiet}; border: none; padding: 2px; }}
QScrollArea {{ border: none; }}
"""


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
            font = name.font()
            font.setBold(not field.usual)  # a value that is not the default
            name.setFont(font)
            unit, help_text = QLabel(field.unit), QLabel(field.help)
            unit.setObjectName("unit")
            help_text.setObjectName("help")
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
            box = QComboBox()
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
        box, line = QComboBox(), QLineEdit()
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
        if rows == self._rows:
            return
        self._rows = rows
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
                item.setForeground(QColor(TONES[tone]))
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
            line.setObjectName("notice")
            line.setWordWrap(True)
            line.setStyleSheet(f"background: {'#5c2a00' if notice.stays else PANEL};")
            self._rows.addWidget(line)


def show_badge(where: QLabel, line: TonedText) -> None:
    """Show the state in its colour."""
    back = {Tone.GOOD: "#123a30", Tone.WATCH: "#e69f00", Tone.BAD: "#d55e00"}.get(line.tone, PANEL)
    front = {Tone.WATCH: PLAIN.background, Tone.BAD: "white"}.get(line.tone, TONES[line.tone])
    if where.text() != line.words:
        where.setText(line.words)
    look = f"background: {back}; color: {front};"
    if where.styleSheet() != look:
        where.setStyleSheet(look)
