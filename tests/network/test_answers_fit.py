"""The answers to every form without flaws fit their message."""

import pytest

from netboard.base.tables.questionnaires import MAX_NUMBER, MAX_QUESTIONS, MAX_TEXT, FormQuestion, flaws_of_form
from netboard.network.protocol.codec import encode
from netboard.network.protocol.views import QuestionnaireAnswers

TEXT = FormQuestion(kind="text", text="Why?")
NUMBER = FormQuestion(kind="number", text="How old?")


@pytest.mark.parametrize("letter", ["x", "\u00e9", "\U0001d7cf"])
def test_largest_answers_to_a_form_without_flaws_can_be_sent(letter: str) -> None:
    choice = FormQuestion(kind="choice", text="Who?", choices=("no", letter * 40))
    longest = {TEXT: letter * MAX_TEXT, NUMBER: letter * MAX_NUMBER, choice: letter * 40}
    questions = {"a.why": TEXT, "a.what": TEXT, "a.who": TEXT, "a.age": NUMBER}
    while len(questions) < MAX_QUESTIONS:
        more = questions | {f"a.{letter * 9}{len(questions)}": choice}
        if list(flaws_of_form(more)):
            break
        questions = more
    given = {name: longest[question] for name, question in questions.items()}
    assert encode(QuestionnaireAnswers("right", 2**40, given, 1e9, complete=True))
    assert len(questions) > 12
