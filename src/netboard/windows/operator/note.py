"""The operator's note field. A note is stamped with its first letter, because writing takes time."""

import json

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QWidget

from netboard.base.tick import TICK_SECONDS
from netboard.windows.operator.lamp_widget import PANEL, PLAIN, label
from netboard.windows.operator.words import Tone

LONGEST = 2000
"""Maximum length of a note, in characters [1]."""


class NoteBox(QWidget):
    """A text field for notes.

    Signals
    -------
    written
        Emitted with the note as JSON: its text, and the tick of its first letter.

    Attributes
    ----------
    tick : int
        The newest known tick; the console window keeps it up to date [1].
    """

    written = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.tick = 0
        self._begun: int | None = None
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.text = QLineEdit()
        self.text.setMaxLength(LONGEST)
        self.text.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)  # a menu would take the stop's key
        self.text.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.text.setPlaceholderText("Note: press F4, write, press Enter. Its time is that of the first letter.")
        self.text.setStyleSheet(
            f"QLineEdit {{ background: {PANEL}; color: {PLAIN.headline}; border: 2px solid {PLAIN.guide};"
            f" border-radius: 5px; padding: 5px; font-size: 16px; }}"
            f"QLineEdit:focus {{ border-color: {PLAIN.cursor}; }}"
        )
        self.stamp = label("", 12, Tone.QUIET)
        self.stamp.setMinimumWidth(150)
        row.addWidget(self.text, 1)
        row.addWidget(self.stamp)
        self.text.textEdited.connect(self._edited)
        self.text.returnPressed.connect(self._send)

    def toggle(self) -> None:
        """Focus the field, or leave it and keep its text."""
        if self.text.hasFocus():
            self.text.clearFocus()
        else:
            self.text.setFocus()

    def _edited(self, words: str) -> None:
        """Stamp the first letter; clear the stamp of an empty note."""
        if not words:
            self._begun = None
        elif self._begun is None:
            self._begun = self.tick
        self.stamp.setText("" if self._begun is None else f"started at {self._begun * TICK_SECONDS:.1f} s")

    def _send(self) -> None:
        words = self.text.text().strip()
        if words and self._begun is not None:
            self.written.emit(json.dumps({"text": words, "tick": self._begun}))
        self.text.clear()
        self._edited("")
        self.text.clearFocus()
