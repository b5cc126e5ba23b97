"""The session's form: pseudonyms, hands, seats, consent, pilot or real.

It is a page of the console's window, not a window of its own: lamps and the emergency stop stay visible, and every
shortcut keeps working.
"""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShortcut
from PySide6.QtWidgets import (
    QButtonGroup,
    QCheckBox,
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from netboard.base.tables.experiment import Session
from netboard.windows.operator.form_fields import FormAnswers, as_json, problems, stand_in_problem
from netboard.windows.operator.lamp_widget import label, say
from netboard.windows.operator.words import Tone, TonedText

MAX_WORDS = 500
"""Longest confirmation of stand-ins [1]."""


class ChoiceButtons(QWidget):
    """Buttons side by side of which exactly one is checked."""

    def __init__(self, labels: dict[str, str], answer: str) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self._group = QButtonGroup(self)
        self.buttons: dict[str, QPushButton] = {}
        for name, text in labels.items():
            button = QPushButton(text)
            button.setObjectName(name)
            button.setCheckable(True)
            button.setChecked(name == answer)
            self._group.addButton(button)
            self.buttons[name] = button
            row.addWidget(button)
        row.addStretch(1)

    @property
    def answer(self) -> str:
        """Name of the checked button."""
        return next(name for name, button in self.buttons.items() if button.isChecked())


class SessionForm(QWidget):
    """The form of a session; `filled` carries the complete answers as JSON, `dismissed` means not now.

    It shows what the hands hold. `confirmed` carries the words with which the operator confirms a stand-in.
    """

    filled = Signal(str)
    confirmed = Signal(str)
    dismissed = Signal()

    def __init__(self, entry: FormAnswers) -> None:
        super().__init__()
        self.texts = {name: self._text(getattr(entry, name)) for name in ("name", "participant_a", "participant_b")}
        hands = {"right": "right", "left": "left"}
        self.hand_a, self.hand_b = ChoiceButtons(hands, entry.hand_a), ChoiceButtons(hands, entry.hand_b)
        self.seat_a = ChoiceButtons({"left": "A left, B right", "right": "A right, B left"}, entry.seat_a)
        self.kind = ChoiceButtons({"real": "REAL", "pilot": "PILOT"}, "pilot" if entry.pilot else "real")
        self.consent = QCheckBox("Both participants have given written consent")
        self.consent.setChecked(entry.consent)
        self.rig = label("")
        self.rig.setMinimumWidth(1)  # a long line must not make the window wider
        self.words = self._text("")
        self.words.setMaxLength(MAX_WORDS)
        self.words.hide()
        self._stand_ins: Sequence[str] = ()
        self.trouble = label("", tone=Tone.BAD, bold=True)
        self.trouble.setWordWrap(True)
        self.trouble.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Ignored)  # squeezes no field
        self.trouble.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._lay_out()
        for key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            enter = QShortcut(key, self, context=Qt.ShortcutContext.WidgetWithChildrenShortcut, autoRepeat=False)
            enter.activated.connect(self.send)

    @property
    def entry(self) -> FormAnswers:
        """The answers so far."""
        texts = {name: text.text().strip() for name, text in self.texts.items()}
        return FormAnswers(
            **texts,
            hand_a=self.hand_a.answer,
            hand_b=self.hand_b.answer,
            seat_a=self.seat_a.answer,
            consent=self.consent.isChecked(),
            pilot=self.kind.answer == "pilot",
        )

    def propose(self, name: str, *, pilot: bool, session: Session) -> None:
        """Begin the form of another session: its name and kind, and what its plan proposes, without consent."""
        self.kind.buttons["pilot" if pilot else "real"].setChecked(True)
        self.consent.setChecked(False)
        self.words.clear()
        self.texts["name"].setText(name)
        self.texts["participant_a"].setText(session.participant_a)
        self.texts["participant_b"].setText(session.participant_b)
        self.hand_a.buttons[session.hand_a].setChecked(True)
        self.hand_b.buttons[session.hand_b].setChecked(True)
        self.seat_a.buttons[session.seat_a].setChecked(True)

    def show_rig(self, lines: Sequence[str], stand_ins: Sequence[str]) -> None:
        """Show what the hands hold; ask for the words that confirm stand-ins, unless it is a pilot."""
        self._stand_ins = stand_ins
        tone = Tone.WATCH if stand_ins else Tone.PLAIN
        say(self.rig, TonedText("\n".join(lines), tone))
        self.words.setPlaceholderText(f"REAL: write {', '.join(stand_ins)}")
        self.words.setVisible(bool(stand_ins) and self.kind.answer == "real")

    def send(self) -> None:
        """Check the answers; send them, or show what is wrong first."""
        entry, words = self.entry, self.words.text()
        found = problems(entry) | stand_in_problem(entry, words, self._stand_ins)
        self.show_problem(next(iter(found.values()), ""))
        if found:
            field = next(iter(found))
            {"consent": self.consent, "words": self.words, **self.texts}[field].setFocus()
            return
        self.filled.emit(as_json(entry))
        if self._stand_ins and not entry.pilot:
            self.confirmed.emit(words)

    def show_problem(self, trouble: str) -> None:
        """Show what is wrong; an empty text clears the message."""
        self.trouble.setText(trouble)

    def _text(self, words: str) -> QLineEdit:
        text = QLineEdit(words)
        text.setMaxLength(64)
        text.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)  # a menu would take the stop's key
        return text

    def _lay_out(self) -> None:
        rows = QVBoxLayout(self)
        rows.setContentsMargins(28, 8, 28, 8)
        head = QGridLayout()
        head.setHorizontalSpacing(28)
        head.addWidget(label("Open the session", "title", bold=True), 0, 0)
        head.addWidget(label("Pseudonyms only. Do not store real names on this computer.", tone=Tone.QUIET), 1, 0)
        head.addWidget(self.rig, 2, 0, 1, 2)
        head.setColumnStretch(1, 1)
        rows.addLayout(head)
        grid = QGridLayout()
        grid.setVerticalSpacing(7)
        grid.setHorizontalSpacing(20)
        fields = (
            ("Session", self.texts["name"], self.kind),
            ("Participants", _named("A", self.texts["participant_a"]), _named("B", self.texts["participant_b"])),
            ("Dominant hands", _named("A", self.hand_a), _named("B", self.hand_b)),
            ("Seats", self.seat_a, None),
            ("Consent", self.consent, None),
        )
        for row, (text, first, second) in enumerate(fields):
            grid.addWidget(label(text), row, 0)
            grid.addWidget(first, row, 1, 1, 1 if second else 2)
            if second:
                grid.addWidget(second, row, 2)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(2, 1)
        rows.addLayout(grid)
        rows.addWidget(self.trouble, 1)
        buttons = QHBoxLayout()
        send, later = QPushButton("Open session   Enter"), QPushButton("Not now   F3")
        later.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # their keys work in the whole form
        send.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        send.clicked.connect(self.send)
        later.clicked.connect(self.dismissed)
        buttons.addWidget(send)
        buttons.addWidget(later)
        buttons.addWidget(self.words, 4)
        buttons.addStretch(1)
        rows.addLayout(buttons)


def _named(words: str, field: QWidget) -> QWidget:
    """Put a label before a field."""
    both = QWidget()
    row = QHBoxLayout(both)
    row.setContentsMargins(0, 0, 0, 0)
    row.addWidget(label(words, bold=True))
    row.addWidget(field, 1)
    return both
