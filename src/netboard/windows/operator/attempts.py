"""The table of attempts: outcome, whether it counts in the analysis, and the trial that an attempt repeats."""

from collections.abc import Sequence

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QRect, Qt
from PySide6.QtGui import QColor, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import USUAL_RULE, ExclusionRule
from netboard.windows.operator.words import ATTEMPT_HEADS, WIDEST_CELLS, attempt_cells, attempt_tone
from netboard.windows.style import TONES, current_theme

Index = QModelIndex | QPersistentModelIndex
NOWHERE = QModelIndex()

CELL_MARGINS, ROW_HEIGHT = 0.6, 1.6
"""Width of a cell that is not for its text, and height of a row, in letter heights of the main text [1]."""


class AttemptModel(QAbstractTableModel):
    """Qt model of the attempts of a session."""

    def __init__(self) -> None:
        super().__init__()
        self.attempts: list[AttemptOutcome] = []
        self._rule = USUAL_RULE

    def take(self, attempts: Sequence[AttemptOutcome], rule: ExclusionRule) -> bool:
        """Append new attempts, or start again if session or rule are others; return whether there were new ones."""
        have = len(self.attempts)
        if len(attempts) < have or list(attempts[:have]) != self.attempts or rule != self._rule:
            self._rule = rule
            self.beginResetModel()
            self.attempts = []
            self.endResetModel()
            have = 0
        if len(attempts) == have:
            return False
        self.beginInsertRows(NOWHERE, have, len(attempts) - 1)
        self.attempts.extend(attempts[have:])
        self.endInsertRows()
        return True

    def rowCount(self, parent: Index = NOWHERE) -> int:  # noqa: N802  (Qt's name)
        """Return the number of attempts [1]."""
        return 0 if parent.isValid() else len(self.attempts)

    def columnCount(self, parent: Index = NOWHERE) -> int:  # noqa: N802  (Qt's name)
        """Return the number of columns [1]."""
        return 0 if parent.isValid() else len(ATTEMPT_HEADS)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        """Return the text or the colour of a cell."""
        attempt = self.attempts[index.row()]
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole):
            return attempt_cells(attempt, self._rule)[index.column()]
        if role == Qt.ItemDataRole.ForegroundRole:
            return QColor(getattr(current_theme(), TONES[attempt_tone(attempt, self._rule).value]))
        return None

    def headerData(  # noqa: N802  (Qt's name)
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> object:
        """Return the header of a column."""
        if role == Qt.ItemDataRole.DisplayRole and orientation == Qt.Orientation.Horizontal:
            return ATTEMPT_HEADS[section]
        return None


class AttemptTable(QTableView):
    """The table of attempts; it scrolls to the newest attempt while none is selected."""

    def __init__(self) -> None:
        super().__init__()
        self.attempts = AttemptModel()
        self.setModel(self.attempts)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setTabKeyNavigation(False)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setShowGrid(False)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalHeader().hide()
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        head = self.horizontalHeader()
        head.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        head.setStretchLastSection(True)
        head.setHighlightSections(False)
        head.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)

    def take_look(self, base: int) -> None:
        """Fit rows and columns to the letter height of the main text [pixels]."""
        letters = self.fontMetrics()
        for column, texts in enumerate(zip(ATTEMPT_HEADS, WIDEST_CELLS, strict=False)):
            self.setColumnWidth(column, max(map(letters.horizontalAdvance, texts)) + round(CELL_MARGINS * base))
        self.verticalHeader().setDefaultSectionSize(round(ROW_HEIGHT * base))
        self._fit_rows()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802  (Qt's name)
        """Fit the rows, whose last cell may need two lines."""
        super().resizeEvent(event)
        self._fit_rows()

    def _fit_rows(self) -> None:
        """Give each row as many lines as its last cell needs."""
        last, letters = len(ATTEMPT_HEADS) - 1, self.fontMetrics()
        room = QRect(0, 0, self.columnWidth(last) - letters.averageCharWidth(), self.height())
        spare = self.verticalHeader().defaultSectionSize() - letters.height()
        for row in range(self.attempts.rowCount()):
            words = str(self.attempts.data(self.attempts.index(row, last)))
            needed = letters.boundingRect(room, Qt.TextFlag.TextWordWrap, words).height()
            self.setRowHeight(row, needed + spare)

    def take(self, attempts: Sequence[AttemptOutcome], rule: ExclusionRule) -> None:
        """Show the attempts so far, and what they count by the rule of the analysis."""
        if self.attempts.take(attempts, rule):
            self._fit_rows()
            if self.marked is None:
                self.scrollToBottom()

    @property
    def marked(self) -> AttemptOutcome | None:
        """The selected attempt; None if none is."""
        rows = self.selectionModel().selectedRows()
        return self.attempts.attempts[rows[0].row()] if rows else None

    def step(self, by: int) -> None:
        """Move the selection by rows; without one, start below the newest attempt. Below the newest, clear it."""
        rows = self.selectionModel().selectedRows()
        count = self.attempts.rowCount()
        row = (rows[0].row() if rows else count) + by
        if row >= count:
            self.clearSelection()
            self.scrollToBottom()
        elif count:
            self.selectRow(max(row, 0))
            self.scrollTo(self.attempts.index(max(row, 0), 0))
