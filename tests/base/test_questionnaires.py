"""Questions, and which texts can be answers to them."""

import json

import pytest

from netboard.base.errors import ConfigError
from netboard.base.tables.questionnaires import (
    PERSON_FORM,
    Form,
    FormQuestion,
    flaws,
    flaws_of_form,
    packed,
    problem_of,
    problems_of,
    questions_of,
)

LIKERT, SCALE = FormQuestion(kind="likert", text="How?", steps=5), FormQuestion(kind="vas", text="How much?")
CHOICE = FormQuestion(kind="choice", text="Who?", choices=("I", "you"))
NUMBER = FormQuestion(kind="number", text="How old?", minimum=18, maximum=99)
TEXT = FormQuestion(kind="text", text="Why?")


@pytest.mark.parametrize(
    ("question", "answer"),
    [(LIKERT, "5"), (SCALE, "0"), (SCALE, "100"), (CHOICE, "you"), (NUMBER, "18.5"), (TEXT, "x" * 500), (SCALE, "")],
)
def test_valid_answer_has_no_problem(question: FormQuestion, answer: str) -> None:
    assert problem_of(question, answer) == ""


@pytest.mark.parametrize(
    ("question", "answer", "said"),
    [
        (LIKERT, "6", "expected 1 to 5"),
        (LIKERT, "2.5", "expected 1 to 5"),
        (SCALE, "-1", "expected 0 to 100"),
        (SCALE, "nan", "expected 0 to 100"),
        (CHOICE, "she", "expected one of I, you"),
        (NUMBER, "17", "expected 18 to 99"),
        (NUMBER, "many", "expected a number"),
        (TEXT, "x" * 501, "at most 500"),
    ],
)
def test_impossible_answer_is_explained(question: FormQuestion, answer: str, said: str) -> None:
    assert said in problem_of(question, answer)


def test_answer_to_an_unknown_question_is_a_problem() -> None:
    assert list(problems_of({"a.b": SCALE}, {"a.b": "3", "a.c": "3"})) == ["a.c: no such question"]


def test_form_gives_its_questions_back_in_their_order() -> None:
    form = Form(tuple(packed("person", name, question) for name, question in PERSON_FORM.items()))
    assert questions_of(form) == {f"person.{name}": question for name, question in PERSON_FORM.items()}
    assert list(questions_of(form)) == ["person.opinion", "person.confidence"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no JSON", "JSON object with an id"),
        ("[1]", "JSON object with an id"),
        ('{"kind": "vas"}', "JSON object with an id"),
        (json.dumps({"id": "a.b", "kind": "essay", "text": "?"}), "kind"),
        (json.dumps({"id": "a.b", "kind": "choice", "text": "?"}), "choices"),
    ],
)
def test_damaged_form_is_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=r"\[form") as found:
        questions_of(Form((text,)))
    assert said in str(found.value)


def test_flaws_of_questions_are_found() -> None:
    assert list(flaws(CHOICE)) == list(flaws(SCALE)) == []
    assert "two or more" in next(flaws(FormQuestion(kind="choice", text="?", choices=("a", "a"))))
    assert "expected none" in next(flaws(FormQuestion(kind="vas", text="?", choices=("a", "b"))))
    assert "more than the minimum" in next(flaws(FormQuestion(kind="number", text="?", minimum=5, maximum=5)))


def many(**counts: int) -> dict[str, FormQuestion]:
    kinds = {"text": TEXT, "scale": SCALE}
    return {f"a.{kind}{number}": kinds[kind] for kind, count in counts.items() for number in range(count)}


def test_form_whose_answers_would_not_fit_a_message_has_flaws() -> None:
    assert list(flaws_of_form(many(text=3, scale=29))) == []
    assert "expected at most 8192: ask fewer free texts" in next(flaws_of_form(many(text=5)))
    assert "33 questions" in next(flaws_of_form(many(scale=33)))
    long = FormQuestion(kind="choice", text="?", choices=("no", "x" * 500))
    assert "expected at most 8192" in next(flaws_of_form({f"a.{number}": long for number in range(17)}))
