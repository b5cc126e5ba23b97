"""Answers to questionnaires: what the participants of a recording answered at their displays."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from netboard.analysis.extraction.tables import count, number, words
from netboard.base.tables.questionnaires import FormQuestion
from netboard.network.protocol.records import EventRecord
from netboard.recording.export.answers import answers_in

FIELDS = (
    words("recording", "name of the recording in which the answer is: of its block, or of the next one"),
    words("participant", "pseudonym of the participant"),
    count("block", "number of the block that the question is about, as `block` of the blocks"),
    words("station", "left or right: the station of the participant"),
    words("other", "what moved the other end: own, person, still, or the name of a robot partner"),
    words("questionnaire", "name of the questionnaire"),
    words("question", "name of the question in it"),
    words("answer", "the answer; empty: skipped"),
    number("value", "the answer as a number; NaN: it is none, or the question asks for none", "of the question"),
    count("complete", "1: the participant finished the form"),
)
"""Columns of the table of answers: one row for each answer."""


def answers(
    name: str, events: Sequence[EventRecord], questions: Mapping[str, FormQuestion]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of the answers among the events of a recording, with the questions of its form."""
    for one in answers_in(events, questions):
        yield {
            "recording": name,
            "participant": one.participant,
            "block": one.block,
            "station": one.station,
            "other": one.partner,
            "questionnaire": one.questionnaire,
            "question": one.question,
            "answer": one.answer,
            "value": one.value,
            "complete": int(one.complete),
        }
