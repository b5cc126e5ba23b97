"""The operator's controls: command buttons labelled with their keys, the emergency stop, and the note field.

Tab goes from button to button, and Enter presses one. Space never does: it is the emergency stop, which has the keys of
the whole window.
"""

import json
from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLineEdit, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from netboard.base.settings import parse_json
from netboard.base.tick import TICK_SECONDS
from netboard.windows.operator.commands import COMMANDS, CONFIRM_KEY, RELEASING, STOP_KEYS, OperatorCommand
from netboard.windows.operator.lamp_widget import label
from netboard.windows.operator.words import Tone
from netboard.windows.style import set_role

COLUMNS = 9
"""Buttons per row [1]."""

MAX_NOTE = 2000
"""Maximum length of a note, in characters [1]."""


class CommandButton(QPushButton):
    """The button of one command."""

    def __init__(self, command: OperatorCommand) -> None:
        super().__init__()
        self.command = command
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setProperty("scale", "fine")
        self.ask(False)

    def ask(self, sure: bool) -> None:
        """Ask for a second press as confirmation, or stop asking."""
        words = (
            f"{self.command.label}?\npress {self.command.key} again"
            if sure
            else f"{self.command.label}\n{self.command.key}"
        )
        if words == self.text():
            return
        self.setText(words)
        set_role(self, "fill", "watch" if sure else "")

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Press the button with Enter; Space is the emergency stop."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.click()
        else:
            super().keyPressEvent(event)

    def allow(self, reason: str) -> None:
        """Enable the button if there is no reason against its command; else say it in the tooltip."""
        self.setEnabled(not reason)
        tip = f"{self.command.tip} ({reason})" if reason else self.command.tip
        if tip != self.toolTip():
            self.setToolTip(tip)


class StopPanel(QWidget):
    """The emergency stop, and its release; `stopped` is emitted when the button goes down, not when it is released."""

    stopped = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.button = QPushButton(f"EMERGENCY STOP\n{' or '.join(STOP_KEYS)}")
        self.button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # Esc and Space press it everywhere
        self.button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.button.setProperty("fill", "stop")
        self.button.setProperty("scale", "title")
        self.button.pressed.connect(self.stopped)
        self.release = CommandButton(RELEASING)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.addWidget(self.button, 1)
        rows.addWidget(self.release)


class CommandBar(QWidget):
    """The buttons of all other commands."""

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(6)
        self.buttons = [CommandButton(command) for command in COMMANDS]
        for place, button in enumerate(self.buttons):
            grid.addWidget(button, *divmod(place, COLUMNS))
            grid.setColumnStretch(place % COLUMNS, 1)


class ConfirmationField(QLineEdit):
    """A field for the words that confirm stand-ins, hidden unless some must be confirmed; `written` carries them."""

    written = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        prepare_field(self, MAX_NOTE)
        self.returnPressed.connect(self._send)
        self.hide()

    def show_words(self, awaited: Sequence[str]) -> None:
        """Ask for these words; hide the field if there are none."""
        self.setPlaceholderText(f"REAL: press {CONFIRM_KEY}, write: {', '.join(awaited)}")
        self.setToolTip(self.placeholderText())
        self.setVisible(bool(awaited))

    def _send(self) -> None:
        if words := self.text().strip():
            self.written.emit(words)
        self.clear()
        self.clearFocus()


def prepare_field(text: QLineEdit, characters: int) -> None:
    """Let a text field take the keyboard only when it is clicked or called."""
    text.setMaxLength(characters)
    text.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)  # a menu would take the stop's key
    text.setFocusPolicy(Qt.FocusPolicy.ClickFocus)


class NoteField(QWidget):
    """A text field for notes, stamped with the tick of their first letter, because writing takes time.

    `written` carries the note as JSON: its text, and that tick. The console window keeps `tick` up to date.
    """

    written = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.tick = 0
        self._begun: int | None = None
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.text = QLineEdit()
        prepare_field(self.text, MAX_NOTE)
        self.text.setPlaceholderText("Note: press F4, type, press Enter. It is stamped when you begin to type.")
        self.stamp = label("", tone=Tone.QUIET)
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

    def put_back(self, note: str) -> None:
        """Put a note that was not received back, before what has been written since."""
        lost = parse_json(note)
        self._begun = lost["tick"]
        self.text.setText(f"{lost['text']} {self.text.text()}".rstrip())
        self._edited(self.text.text())

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
