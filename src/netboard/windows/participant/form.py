"""The form of a participant's display: the questions of a block, one after the other.

It covers the board while it is open, and is made only then. A question is answered with mouse, finger or keys: digits
choose, arrows move the mark of a scale, Enter goes on. A question that may be skipped has a button for that.
"""

from collections.abc import Mapping

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from netboard.base.clock import now_ns
from netboard.base.tables.questionnaires import FULL_SCALE, MAX_NUMBER, MAX_TEXT, FormQuestion, problem_of
from netboard.windows.participant.scene import Colours
from netboard.windows.participant.words import DisplayTexts

LETTERS_SHARE, SMALLEST_LETTERS = 1 / 30, 14
"""Size of the letters as a share of the height of the form, and their smallest size [1, pixels]."""

STEP = 2
"""Change of a scale by an arrow key, in its hundredths [1]."""


class ChoiceField(QWidget):
    """One of some buttons, in a row with words at its ends, or in a column."""

    changed = Signal()

    def __init__(self, answers: tuple[str, ...], ends: tuple[str, str], direction: QBoxLayout.Direction) -> None:
        super().__init__()
        rows = QBoxLayout(direction, self)
        self._group = QButtonGroup(self)
        self._answers = answers
        for number, text in enumerate(answers):
            button = QPushButton(text)
            button.setCheckable(True)
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            self._group.addButton(button, number)
            rows.addWidget(button)
        if any(ends):
            rows.insertWidget(0, QLabel(ends[0]))
            rows.addWidget(QLabel(ends[1]))
        self._group.idClicked.connect(lambda _: self.changed.emit())
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def answer(self) -> str:
        """Return the text of the chosen button."""
        chosen = self._group.checkedId()
        return self._answers[chosen] if chosen >= 0 else ""

    def put(self, answer: str) -> None:
        """Choose a button."""
        if answer in self._answers:
            self._group.button(self._answers.index(answer)).setChecked(True)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Choose with a digit or an arrow key."""
        last, chosen = len(self._answers) - 1, self._group.checkedId()
        if event.text().isdecimal() and event.text().isascii() and 0 < int(event.text()) <= last + 1:
            chosen = int(event.text()) - 1
        elif event.key() in (Qt.Key.Key_Right, Qt.Key.Key_Down):
            chosen = min(chosen + 1, last)
        elif event.key() in (Qt.Key.Key_Left, Qt.Key.Key_Up):
            chosen = max(chosen - 1, 0)
        else:
            super().keyPressEvent(event)
            return
        self._group.button(chosen).setChecked(True)
        self.changed.emit()


class ScaleField(QWidget):
    """A visual analogue scale: a line without a mark until it is touched."""

    changed = Signal()

    def __init__(self, low: str, high: str, colours: Colours) -> None:
        super().__init__()
        self._low, self._high, self._colours = low, high, colours
        self._value = -1
        self.setMinimumHeight(120)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def answer(self) -> str:
        """Return the place of the mark."""
        return str(self._value) if self._value >= 0 else ""

    def put(self, answer: str) -> None:
        """Move the mark."""
        self._value = int(answer) if answer else -1
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802  (Qt's name)
        """Return a wide and low size."""
        return QSize(600, 140)

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802  (Qt's name)
        """Put the mark there."""
        self._put_at(event.position().x())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802  (Qt's name)
        """Drag the mark."""
        self._put_at(event.position().x())

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Move the mark with the arrow keys, from the middle."""
        steps = {Qt.Key.Key_Left: -STEP, Qt.Key.Key_Right: STEP}.get(Qt.Key(event.key()))
        if steps is None:
            super().keyPressEvent(event)
            return
        self._value = min(max((FULL_SCALE // 2 if self._value < 0 else self._value) + steps, 0), FULL_SCALE)
        self._tell()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802  (Qt's name)
        """Paint the line, the words at its ends, and the mark."""
        line, height = self._line(), self.fontMetrics().height()
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(QColor(self._colours.edge), 3))
            painter.drawLine(line.topLeft(), line.topRight())
            for end in (line.left(), line.right()):
                painter.drawLine(QPointF(end, line.top() - 10), QPointF(end, line.top() + 10))
            half = line.width() / 2
            below = QRectF(line.left(), line.top() + 20, half, 2 * height)
            painter.setPen(QColor(self._colours.headline))
            painter.drawText(below, Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextWordWrap, self._low)
            painter.drawText(
                below.translated(half, 0), Qt.AlignmentFlag.AlignRight | Qt.TextFlag.TextWordWrap, self._high
            )
            if self._value >= 0:
                x = line.left() + line.width() * self._value / FULL_SCALE
                painter.setPen(QPen(QColor(self._colours.ball), 6))
                painter.drawLine(QPointF(x, line.top() - 22), QPointF(x, line.top() + 14))

    def _line(self) -> QRectF:
        return QRectF(30, self.height() / 3, self.width() - 60, 0)

    def _put_at(self, x: float) -> None:
        line = self._line()
        share = (x - line.left()) / max(line.width(), 1.0)
        self._value = round(FULL_SCALE * min(max(share, 0.0), 1.0))
        self._tell()

    def _tell(self) -> None:
        self.update()
        self.changed.emit()


class NumberField(QWidget):
    """A number, with its unit."""

    changed = Signal()

    def __init__(self, unit: str) -> None:
        super().__init__()
        rows = QHBoxLayout(self)
        self._edit = QLineEdit(maxLength=MAX_NUMBER)
        self._edit.textChanged.connect(lambda _: self.changed.emit())
        rows.addWidget(self._edit)
        rows.addWidget(QLabel(unit))
        self.setFocusProxy(self._edit)

    def answer(self) -> str:
        """Return the number; a comma is read as a decimal point."""
        return self._edit.text().strip().replace(",", ".")

    def put(self, answer: str) -> None:
        """Write a number."""
        self._edit.setText(answer)


class TextField(QPlainTextEdit):
    """Free text; Enter begins a new line."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setTabChangesFocus(True)
        self.textChanged.connect(self._cut)

    def answer(self) -> str:
        """Return the text."""
        return self.toPlainText().strip()

    def put(self, answer: str) -> None:
        """Write a text."""
        self.setPlainText(answer)

    def _cut(self) -> None:
        """Keep at most as many characters as an answer may have."""
        if len(self.toPlainText()) > MAX_TEXT:
            self.setPlainText(self.toPlainText()[:MAX_TEXT])
            self.moveCursor(self.textCursor().MoveOperation.End)
        self.changed.emit()


def field_of(question: FormQuestion, colours: Colours) -> ChoiceField | ScaleField | NumberField | TextField:
    """Return the place for the answer to a question."""
    match question.kind:
        case "likert":
            steps = tuple(str(step) for step in range(1, question.steps + 1))
            return ChoiceField(steps, (question.low, question.high), QBoxLayout.Direction.LeftToRight)
        case "choice":
            return ChoiceField(question.choices, ("", ""), QBoxLayout.Direction.TopToBottom)
        case "vas":
            return ScaleField(question.low, question.high, colours)
        case "number":
            return NumberField(question.unit)
        case "text":
            return TextField()


class FormWidget(QWidget):
    """The questions of a block.

    `done` comes once, with the answers, the time it took [s], and whether the participant finished.
    """

    done = Signal(dict, float, bool)

    def __init__(self, parent: QWidget, questions: Mapping[str, FormQuestion], words: DisplayTexts) -> None:
        super().__init__(parent)
        self._questions, self._words, self._colours = dict(questions), words, Colours()
        self._names = list(questions)
        self._given = dict.fromkeys(questions, "")
        self._at, self._opened_ns, self._over = 0, now_ns(), False
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setCursor(Qt.CursorShape.ArrowCursor)
        self._count, self._text, self._hint = QLabel(), QLabel(wordWrap=True), QLabel(wordWrap=True)
        self._place = QVBoxLayout()
        self._back, self._skip, self._next = QPushButton(words.form_back), QPushButton(words.form_skip), QPushButton()
        self._back.clicked.connect(lambda: self._go(-1))
        self._skip.clicked.connect(self._leave_out)
        self._next.clicked.connect(self._forward)
        self._rows, buttons = QVBoxLayout(self), QHBoxLayout()
        for button in (self._back, self._skip, self._next):
            buttons.addWidget(button)
        self._rows.addWidget(self._count)
        self._rows.addStretch(1)
        self._rows.addWidget(self._text)
        self._rows.addLayout(self._place)
        self._rows.addWidget(self._hint)
        self._rows.addStretch(2)
        self._rows.addLayout(buttons)
        self.field = self._show_question()

    def close_unfinished(self) -> None:
        """Close the form because the session goes on; what was filled in counts."""
        self._keep()
        self._finish(complete=False)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802  (Qt's name)
        """Give the keys to the present question, also after the form was hidden."""
        super().showEvent(event)
        self.field.setFocus()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802  (Qt's name)
        """Fit letters and margins to the size."""
        super().resizeEvent(event)
        letters = max(round(self.height() * LETTERS_SHARE), SMALLEST_LETTERS)
        edge, colours = self.width() // 8, self._colours
        self._rows.setContentsMargins(edge, 2 * letters, edge, 2 * letters)
        self.setStyleSheet(
            f"QWidget {{ background: {colours.background}; color: {colours.headline}; font-size: {letters}px; }}"
            f"QPushButton {{ background: {colours.guide}; padding: {letters // 2}px; border: 2px solid {colours.guide};"
            f" border-radius: 6px; }} QPushButton:checked {{ border-color: {colours.ball}; color: {colours.ball}; }}"
            f"QPushButton:focus {{ border-color: {colours.edge}; }}"
            f"QPushButton:disabled {{ color: {colours.quiet}; background: {colours.background}; }}"
            f"QLineEdit, QPlainTextEdit {{ border: 2px solid {colours.guide}; padding: {letters // 3}px; }}"
        )

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Go on with Enter; keep all other keys from the window, which some of them would close."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self._next.isEnabled():
            self._forward()

    def _show_question(self) -> ChoiceField | ScaleField | NumberField | TextField:
        """Show the present question."""
        question = self._questions[self._names[self._at]]
        self._count.setText(f"{self._at + 1} / {len(self._names)}")
        self._text.setText(question.text)
        field = field_of(question, self._colours)
        field.put(self._given[self._names[self._at]])
        field.changed.connect(self._check)
        self._place.addWidget(field)
        field.setFocus()
        self.field = field
        self._check()
        return field

    def _check(self) -> None:
        """Allow to go on if the question has a valid answer."""
        question, answer = self._questions[self._names[self._at]], self.field.answer()
        problem, last = problem_of(question, answer), self._at == len(self._names) - 1
        limits = f"{question.minimum:g} - {question.maximum:g}"
        self._hint.setText(limits if question.kind == "number" else "")
        self._next.setText(self._words.form_done if last else self._words.form_next)
        self._next.setEnabled(bool(answer) and not problem)
        self._back.setEnabled(self._at > 0)
        self._skip.setVisible(question.skip)

    def _keep(self) -> None:
        """Keep the answer to the present question, unless it is not valid."""
        name, answer = self._names[self._at], self.field.answer()
        if not problem_of(self._questions[name], answer):
            self._given[name] = answer

    def _leave_out(self) -> None:
        self.field.put("")
        self._given[self._names[self._at]] = ""
        self._go(1)

    def _forward(self) -> None:
        self._keep()
        self._go(1)

    def _go(self, steps: int) -> None:
        """Go to another question, or finish after the last."""
        if steps < 0:
            self._keep()
        if self._at + steps >= len(self._names):
            self._finish(complete=True)
            return
        self._at += steps
        self._place.removeWidget(self.field)
        self.field.deleteLater()
        self._show_question()

    def _finish(self, complete: bool) -> None:
        """Give the answers once."""
        if not self._over:
            self._over = True
            self.hide()
            self.done.emit(dict(self._given), (now_ns() - self._opened_ns) * 1e-9, complete)
