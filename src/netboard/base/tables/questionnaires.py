"""Questionnaires at the participants' displays: the kinds of questions, and the form of a block.

A study declares questionnaires of `FormQuestion`. The plan puts those that follow a block into its table ``[form]``,
so that a display gets the form with the configuration of the block. Answers are texts, as a participant gave them; an
answer that was skipped is empty. No text of a published questionnaire is in the package.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Literal, get_args

from pydantic import StrictBool

from netboard.base.errors import ConfigError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, Number, about, check

QuestionKind = Literal["likert", "vas", "choice", "text", "number"]
"""Kind of a question."""

KINDS: dict[QuestionKind, str] = {
    "likert": "one of some steps between two ends; the answer is its number, from 1",
    "vas": "visual analogue scale: a place on a line between two ends; the answer is 0 to 100",
    "choice": "one of some choices; the answer is its text",
    "text": "free text of at most 500 characters",
    "number": "a number within limits",
}
"""The kinds, and what their answers are, for the documentation."""

if tuple(KINDS) != get_args(QuestionKind):
    raise RuntimeError(f"KINDS: found {', '.join(KINDS)}, expected {', '.join(get_args(QuestionKind))}")

NUMBERS: tuple[QuestionKind, ...] = ("likert", "vas", "number")
"""The kinds whose answers are numbers."""

MAX_TEXT = 500
"""Most characters of a free text [1]."""

MAX_NUMBER = 20
"""Most characters of a number that is written at a display [1]."""

MAX_QUESTIONS, MAX_ANSWER_BYTES = 32, 8192
"""Most questions of a form, and most bytes of the message with its answers [1]."""

ENVELOPE_BYTES, PAIR_BYTES = 32, 6
"""Bytes of that message beside ids and answers, at most: those of all fields together, and of each pair [1]."""

LETTER_BYTES = 4
"""Bytes of a character in UTF-8, at most [1]."""

FULL_SCALE = 100
"""Upper end of a visual analogue scale [1]."""


@dataclass(frozen=True, slots=True)
class FormQuestion:
    """A question to participants."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    kind: Annotated[QuestionKind, about('kind of question: "likert", "vas", "choice", "text" or "number"')] = "vas"
    text: Annotated[str, about("the question", min_length=1)] = "?"
    low: Annotated[str, about("word at the low end of a likert or vas scale")] = ""
    high: Annotated[str, about("word at the high end")] = ""
    steps: Annotated[int, about("steps of a likert scale", "1", ge=2, le=11)] = 7
    choices: Annotated[tuple[str, ...], about("choices of a choice, two or more", max_length=9, strict=False)] = ()
    minimum: Annotated[float, about("least answer of a number", allow_inf_nan=False)] = 0.0
    maximum: Annotated[float, about("greatest answer of a number", allow_inf_nan=False)] = 100.0
    unit: Annotated[str, about("unit of a number, as shown")] = ""
    skip: Annotated[StrictBool, about("true: a participant may skip it")] = True


@dataclass(frozen=True, slots=True)
class Form:
    """Questions that the participants answer at their displays after the block."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    questions: Annotated[
        tuple[str, ...],
        about(
            "each question with its id, QUESTIONNAIRE.NAME, as a JSON object", max_length=MAX_QUESTIONS, strict=False
        ),
    ] = ()
    wait: Annotated[
        Number, about("how long the next block waits for the answers; then it begins without them", "s", ge=0, le=3600)
    ] = 120.0


def packed(questionnaire: str, name: str, question: FormQuestion) -> str:
    """Return a question as an entry of `Form.questions`.

    Parameters
    ----------
    questionnaire, name : str
        Names of the questionnaire and of the question.
    """
    return json.dumps({"id": f"{questionnaire}.{name}", **asdict(question)}, ensure_ascii=False)


def questions_of(form: Form) -> dict[str, FormQuestion]:
    """Return the questions of a form by their id, ``QUESTIONNAIRE.NAME``.

    Raises
    ------
    ConfigError
        If a question is not valid.
    """
    found: dict[str, FormQuestion] = {}
    for text in form.questions:
        try:
            values = json.loads(text)
            name = str(values.pop("id"))
        except (ValueError, AttributeError, KeyError, TypeError) as error:
            raise ConfigError(f"[form] questions: found {text!r}, expected a JSON object with an id") from error
        found[name] = check(FormQuestion, values, ("form", name))
        if problem := next(flaws(found[name]), ""):
            raise ConfigError(f"[form] {name}: {problem}")
    return found


def flaws(question: FormQuestion) -> Iterator[str]:
    """Find what is wrong in a question whose keys are valid."""
    if question.kind == "choice" and len({*question.choices}) < max(2, len(question.choices)):
        yield "choices: expected two or more different ones for a choice"
    if question.kind != "choice" and question.choices:
        yield f'choices: found some with kind "{question.kind}", expected none'
    if question.kind == "number" and question.minimum >= question.maximum:
        yield f"maximum: found {question.maximum:g}, expected more than the minimum, {question.minimum:g}"


def flaws_of_form(questions: Mapping[str, FormQuestion]) -> Iterator[str]:
    """Find reasons why the answers to some questions do not fit one message."""
    if len(questions) > MAX_QUESTIONS:
        yield f"found {len(questions)} questions after one block, expected at most {MAX_QUESTIONS}"
    pairs = (PAIR_BYTES + len(name.encode()) + _most_bytes(question) for name, question in questions.items())
    size = ENVELOPE_BYTES + sum(pairs)
    if size > MAX_ANSWER_BYTES:
        yield (
            f"found answers of up to {size} bytes after one block, expected at most {MAX_ANSWER_BYTES}: "
            "ask fewer free texts, or shorten names and choices"
        )


def _most_bytes(question: FormQuestion) -> int:
    """Return the bytes of the longest answer to a question [1]."""
    match question.kind:
        case "choice":
            return max((len(choice.encode()) for choice in question.choices), default=0)
        case "text":
            return LETTER_BYTES * MAX_TEXT
        case "number":
            return LETTER_BYTES * MAX_NUMBER
        case "likert" | "vas":
            return len(str(FULL_SCALE))


def problem_of(question: FormQuestion, answer: str) -> str:
    """Return why a text cannot be the answer to a question; empty if it can.

    Parameters
    ----------
    answer : str
        The text; empty: skipped.
    """
    if not answer:
        return ""
    if question.kind == "choice":
        return "" if answer in question.choices else f"found {answer!r}, expected one of {', '.join(question.choices)}"
    if question.kind == "text":
        return "" if len(answer) <= MAX_TEXT else f"found {len(answer)} characters, expected at most {MAX_TEXT}"
    low, high = limits_of(question)
    try:
        value = float(answer)
    except ValueError:
        return f"found {answer!r}, expected a number"
    if not low <= value <= high or (question.kind == "likert" and value != int(value)):
        return f"found {answer}, expected {low:g} to {high:g}"
    return ""


def limits_of(question: FormQuestion) -> tuple[float, float]:
    """Return the least and the greatest answer of a likert or visual analogue scale [1], or of a number [its unit]."""
    if question.kind == "number":
        return question.minimum, question.maximum
    return (1.0, float(question.steps)) if question.kind == "likert" else (0.0, float(FULL_SCALE))


def problems_of(questions: Mapping[str, FormQuestion], answers: Mapping[str, str]) -> Iterator[str]:
    """Find answers that do not belong to some questions, or cannot be answers to them.

    Parameters
    ----------
    answers : mapping of str to str
        Answers by the id of their question; an empty one was skipped.
    """
    for name, answer in answers.items():
        if name not in questions:
            yield f"{name}: no such question"
        elif problem := problem_of(questions[name], answer):
            yield f"{name}: {problem}"


ANSWERS, UNANSWERED = "answers", "questionnaire_unanswered"
"""Events of a recording: the answers of a station, and a station without any when the wait was over."""

ABOUT_ANSWERS = ("station", "block", "label", "participant", "partner", "complete", "seconds")
"""Details of `ANSWERS` beside the answers themselves, which are named by the ids of their questions."""

PUBLIC_DETAILS = {ANSWERS: ("station", "block", "complete")}
"""Events of which logs and streams have only these details, because the others are private."""

RESERVED = ("participant_id", "session_id", *ABOUT_ANSWERS)
"""Columns of exported answers, which no question may be named after."""

PERSON_FORM: dict[str, FormQuestion] = {
    "opinion": FormQuestion(
        kind="choice", text="Who moved the other end of the board?", choices=("a person", "a program"), skip=False
    ),
    "confidence": FormQuestion(kind="vas", text="How sure are you?", low="a guess", high="certain", skip=False),
}
"""Who the partner was, in the participant's opinion, and how sure of it the participant is."""

SHIPPED: dict[str, dict[str, FormQuestion]] = {"person": PERSON_FORM}
"""Questions that a questionnaire can have by a name, in place of its own."""


def public_details(event: str, details: Mapping[str, str]) -> dict[str, str]:
    """Return the details of an event that may be shown, and sent to others than the logger."""
    return {name: details[name] for name in PUBLIC_DETAILS.get(event, tuple(details))}
