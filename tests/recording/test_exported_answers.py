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


@pytest.fixture(scope="module")
def recorded_answers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("answered") / "answered.mcap"
    questions = [packed("person", name, question) for name, question in PERSON_FORM.items()]
    form = Form((*questions, packed("rest", "remark", REMARK)))
    writer = writer_of(path, replace(parse(""), form=form), {})
    last = fill(writer, make_rows(2)[:40])
    writer.write(EVENT, writer.next_record or 0, last + 1)
    writer.finish(last + 2, "complete")
    return path


def test_answers_are_read_from_their_events() -> None:
    found = answers_in([EVENT, EventRecord(4, 41, 0, "note", {"text": "a.b"})])
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
