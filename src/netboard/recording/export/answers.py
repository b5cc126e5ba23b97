"""Answers of participants to questionnaires, from the events of recordings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

from netboard.base.tables.questionnaires import ABOUT_ANSWERS, ANSWERS, NUMBERS, FormQuestion
from netboard.network.protocol.records import EventRecord


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer to one question. `answer` is empty if the question was skipped."""

    participant: str
    station: str
    block: int  # number of the block that the question is about
    label: str
    partner: str  # what moved the other end: own, person, still, or the name of a robot partner
    questionnaire: str
    question: str
    answer: str
    value: float  # the answer as a number; NaN if it is none, or the question asks for none
    complete: bool  # whether the participant finished the form
    seconds: float  # how long the form was open [s]
    time_ns: int  # server time of the event [ns]


def answers_in(events: Sequence[EventRecord], questions: Mapping[str, FormQuestion]) -> tuple[Answer, ...]:
    """Return all answers in the events of a recording, in their order.

    ``questions``: those of the recording's form. An answer that came late may be to a question of an earlier form.
    """
    return tuple(answer for event in events if event.name == ANSWERS for answer in _answers_of(event, questions))


def _answers_of(event: EventRecord, questions: Mapping[str, FormQuestion]) -> Iterator[Answer]:
    """Yield the answers of one event."""
    about = {name: event.details.get(name, "") for name in ABOUT_ANSWERS}
    for name, given in event.details.items():
        questionnaire, dot, question = name.partition(".")
        if name not in ABOUT_ANSWERS and dot:
            yield Answer(
                participant=about["participant"],
                station=about["station"],
                block=int(about["block"]),
                label=about["label"],
                partner=about["partner"],
                questionnaire=questionnaire,
                question=question,
                answer=given,
                value=_number(given) if name not in questions or questions[name].kind in NUMBERS else nan,
                complete=about["complete"] == "true",
                seconds=float(about["seconds"]),
                time_ns=event.time_ns,
            )


def _number(text: str) -> float:
    """Return a finite number; NaN if the text is none."""
    try:
        value = float(text)
    except ValueError:
        return nan
    return value if isfinite(value) else nan
