"""Answers of participants in exports: one row each, with the true partner beside them."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import parse
from netboard.base.tables.questionnaires import ANSWERS, PERSON_FORM, Form, FormQuestion, packed
from netboard.network.protocol.records import EventRecord
from netboard.recording.export import bids
from netboard.recording.export.answers import answers_in
from netboard.recording.export.tables import ANSWERS as TABLE
from netboard.recording.export.tables import OpenRecording
from netboard.recording.files.reader import Recording
from netboard.testing.difficult_recording import make_rows
from rehearsed import fill, writer_of

REMARK = FormQuestion(kind="text", text="What else?")
DETAILS = {
    "station": "right",
    "block": "1",
    "label": "dyadic",
    "participant": "B",
    "partner": "lqg",
    "complete": "true",
    "seconds": "7.250",
    "person.opinion": "a person",
    "person.confidence": "80",
    "rest.remark": "",
}
EVENT = EventRecord(3, 40, 1_000_000_000, ANSWERS, DETAILS)


def recorded(
    path: Path, questions: dict[str, FormQuestion], details: dict[str, str], time_ns: int = 10**9, *settings: str
) -> Path:
    """Record a session with the answers to a form; the questions are given by their id."""
    form = Form(tuple(packed(*name.split("."), question) for name, question in questions.items()))
    writer = writer_of(path, replace(parse("", "test", settings), form=form), {})
    last = fill(writer, make_rows(2)[:40])
    writer.write(replace(EVENT, details=details, time_ns=time_ns), writer.next_record or 0, last + 1)
    writer.finish(last + 2, "complete")
    return path


@pytest.fixture(scope="module")
def recorded_answers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    questions = {f"person.{name}": question for name, question in PERSON_FORM.items()} | {"rest.remark": REMARK}
    return recorded(tmp_path_factory.mktemp("answered") / "answered.mcap", questions, DETAILS)


def test_answers_are_read_from_their_events() -> None:
    found = answers_in([EVENT, EventRecord(4, 41, 0, "note", {"text": "a.b"})], {})
    assert [(one.questionnaire, one.question, one.answer) for one in found] == [
        ("person", "opinion", "a person"),
        ("person", "confidence", "80"),
        ("rest", "remark", ""),
    ]
    assert {(one.participant, one.partner, one.complete, one.seconds) for one in found} == {("B", "lqg", True, 7.25)}
    assert [one.value for one in found[1:]] == [80.0, pytest.approx(np.nan, nan_ok=True)]


def test_table_has_the_truth_beside_each_answer(recorded_answers: Path) -> None:
    with Recording(recorded_answers) as recording:
        (rows,) = TABLE.portions(OpenRecording(recording))
    assert rows["answer"].tolist() == ["a person", "80", ""]
    assert rows["partner"].tolist() == ["lqg"] * 3
    assert rows["value"].tolist()[1] == 80.0


def test_bids_has_a_phenotype_of_each_questionnaire(recorded_answers: Path, tmp_path: Path) -> None:
    bids.write([recorded_answers], tmp_path / "out", lambda *_: None)
    folder = tmp_path / "out" / "phenotype"
    assert sorted(path.name for path in folder.iterdir()) == ["person.json", "person.tsv", "rest.json", "rest.tsv"]
    with (folder / "person.tsv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file, delimiter="\t")
    assert (row["opinion"], row["partner"], row["confidence"], row["block"]) == ("a person", "lqg", "80", "1")
    assert row["participant_id"].startswith("sub-")
    sidecar = json.loads((folder / "person.json").read_text(encoding="utf-8"))
    assert sidecar["confidence"]["Levels"] == {"0": "a guess", "100": "certain"}
    with (folder / "rest.tsv").open(encoding="utf-8") as file:
        assert next(csv.DictReader(file, delimiter="\t"))["remark"] == "n/a"


def test_bids_keeps_answers_under_their_questions_if_a_questionnaire_has_changed(tmp_path: Path) -> None:
    scale = FormQuestion(kind="vas", text="How much?")
    about = {name: text for name, text in DETAILS.items() if "." not in name}
    forms = [{"rating.demand": "10", "rating.effort": "20"}, {"rating.effort": "30", "rating.delay": "40"}]
    paths = [
        recorded(tmp_path / f"{number}.mcap", dict.fromkeys(given, scale), about | given, 10**9 + number)
        for number, given in enumerate(forms)
    ]
    bids.write(paths, tmp_path / "out", lambda *_: None)
    with (tmp_path / "out" / "phenotype" / "rating.tsv").open(encoding="utf-8") as file:
        found = [(row["demand"], row["effort"], row["delay"]) for row in csv.DictReader(file, delimiter="\t")]
    assert found == [("10", "20", "n/a"), ("n/a", "30", "40")]


def test_bids_has_numbers_where_a_question_asks_for_one(tmp_path: Path) -> None:
    """A quote before a negative number would make a text of it; before a text it keeps spreadsheets from running it."""
    questions = {
        "mood.change": FormQuestion(kind="number", text="Warmer or colder?", minimum=-10.0),
        "mood.pull": FormQuestion(kind="number", text="How far?", minimum=-10.0),
        "mood.remark": REMARK,
        "mood.side": FormQuestion(kind="choice", text="Which way?", choices=("-1", "1")),
    }
    given = {"mood.change": "-5", "mood.pull": "-0.5", "mood.remark": "-5", "mood.side": "-1"}
    about = {name: text for name, text in DETAILS.items() if "." not in name}
    bids.write([recorded(tmp_path / "mood.mcap", questions, about | given)], tmp_path / "out", lambda *_: None)
    row = (tmp_path / "out" / "phenotype" / "mood.tsv").read_text(encoding="utf-8").splitlines()[1].split("\t")
    assert row[-4:] == ["-5", "-0.5", "'-5", "'-1"]


@pytest.mark.parametrize("text", ["007", "1e5", "nan", "infinity"])
def test_free_text_is_never_a_number(tmp_path: Path, text: str) -> None:
    """An answer that came late is to a question of an earlier form: it is a number if it looks like a finite one."""
    about = {name: value for name, value in DETAILS.items() if "." not in name}
    given = about | {"rest.remark": text, "rest.rating": "7", "earlier.rating": "5", "earlier.remark": "infinity"}
    questions = {"rest.remark": REMARK, "rest.rating": FormQuestion()}
    path = recorded(tmp_path / "text.mcap", questions, given)
    with Recording(path) as recording:
        (rows,) = TABLE.portions(OpenRecording(recording))
        found = answers_in(recording.events(), questions)
    assert rows["answer"].tolist()[0] == text
    for values in (rows["value"].tolist(), [one.value for one in found]):
        assert values == pytest.approx([np.nan, 7.0, 5.0, np.nan], nan_ok=True)
    bids.write([path], tmp_path / "out", lambda *_: None)
    row = (tmp_path / "out" / "phenotype" / "rest.tsv").read_text(encoding="utf-8").splitlines()[1].split("\t")
    assert row[-2:] == [text, "7"]


def test_bids_knows_who_answered_in_a_block_without_them(tmp_path: Path) -> None:
    """An answer may come when the next block has begun, in which its participant does not play."""
    questions = {"rest.remark": REMARK}
    second = ("block.right=still", "block.number=2", "block.blocks=2")
    paths = [
        recorded(tmp_path / "first.mcap", questions, DETAILS | {"block": "0"}, 10**9),
        recorded(tmp_path / "second.mcap", questions, DETAILS, 2 * 10**9, *second),
    ]
    bids.write(paths, tmp_path / "out", lambda *_: None)
    with (tmp_path / "out" / "phenotype" / "rest.tsv").open(encoding="utf-8") as file:
        first, second = (row["participant_id"] for row in csv.DictReader(file, delimiter="\t"))
    assert first == second == "sub-D01B"
