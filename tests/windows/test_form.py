"""The form of a participant's display: each kind of question, with mouse and keys, finished or not."""

from typing import Any

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from netboard.base.tables.questionnaires import FormQuestion
from netboard.windows.participant.form import FormWidget, ScaleField
from netboard.windows.participant.language import load_words
from netboard.windows.participant.window import BoardWindow, application

LIKERT = FormQuestion(kind="likert", text="How well?", low="badly", high="well", steps=5)
SCALE = FormQuestion(kind="vas", text="How much?", low="little", high="much", skip=False)
CHOICE = FormQuestion(kind="choice", text="Who?", choices=("a person", "a program"))
NUMBER = FormQuestion(kind="number", text="How old?", minimum=18, maximum=99, unit="years")
TEXT = FormQuestion(kind="text", text="Why?")


class OpenForm:
    """A form in a window, and the answers that it has given."""

    def __init__(self, **questions: FormQuestion) -> None:
        application()
        self.window = BoardWindow("form")
        self.window.resize(1000, 600)
        self.window.show()
        self.given: list[tuple[dict[str, Any], float, bool]] = []
        self.widget = FormWidget(self.window, questions, load_words("en"))
        self.widget.done.connect(lambda *answers: self.given.append(answers))
        self.window.cover(self.widget)

    def key(self, key: Qt.Key) -> None:
        QTest.keyClick(self.widget.field, key)


def test_each_kind_is_answered_with_the_keyboard() -> None:
    form = OpenForm(likert=LIKERT, scale=SCALE, choice=CHOICE)
    for key in (
        Qt.Key.Key_4,
        Qt.Key.Key_Return,
        Qt.Key.Key_Right,
        Qt.Key.Key_Return,
        Qt.Key.Key_Down,
        Qt.Key.Key_Return,
    ):
        form.key(key)
    (answers, seconds, complete), *more = form.given
    assert not more
    assert (answers, complete) == ({"likert": "4", "scale": "52", "choice": "a person"}, True)
    assert seconds >= 0


def test_mark_of_a_scale_follows_the_mouse() -> None:
    form = OpenForm(scale=SCALE)
    field = form.widget.field
    assert isinstance(field, ScaleField)
    assert field.answer() == ""
    for x, found in ((0, "0"), (field.width() // 2, "50"), (field.width() - 1, "100")):
        QTest.mouseClick(field, Qt.MouseButton.LeftButton, pos=QPoint(x, 20))
        assert field.answer() == found


def test_number_and_text_are_written() -> None:
    form = OpenForm(number=NUMBER, text=TEXT)
    form.widget.field.put("17")
    form.key(Qt.Key.Key_Return)
    assert form.widget.field.answer() == "17", "out of its limits, so the form does not go on"
    form.widget.field.put("18,5")
    form.key(Qt.Key.Key_Return)
    QTest.keyClicks(form.widget.field, "quiet" + "x" * 600)
    form.widget.close_unfinished()
    answers, _, complete = form.given[0]
    assert (answers["number"], answers["text"][:6], len(answers["text"]), complete) == ("18.5", "quietx", 500, False)


def test_question_that_must_be_answered_cannot_be_left() -> None:
    form = OpenForm(scale=SCALE, likert=LIKERT)
    form.key(Qt.Key.Key_Return)
    assert form.widget.field.answer() == ""
    assert form.given == []
    assert form.widget._skip.isHidden()
    form.key(Qt.Key.Key_Left)
    form.key(Qt.Key.Key_Return)
    assert not form.widget._skip.isHidden()
    form.widget._skip.click()
    assert form.given[0][0] == {"scale": "48", "likert": ""}


def test_back_keeps_the_answers() -> None:
    form = OpenForm(likert=LIKERT, choice=CHOICE)
    form.key(Qt.Key.Key_2)
    form.key(Qt.Key.Key_Return)
    form.widget._back.click()
    assert form.widget.field.answer() == "2"


@pytest.mark.parametrize("key", [Qt.Key.Key_Q, Qt.Key.Key_Escape])
def test_keys_that_close_the_window_do_not_close_it_under_a_form(key: Qt.Key) -> None:
    form = OpenForm(likert=LIKERT)
    form.key(key)
    assert form.window.isVisible()
    assert form.given == []
