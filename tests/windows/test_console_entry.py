"""The session form: which answers it accepts."""

import json
from dataclasses import fields, replace

import pytest

from netboard.base.config import Config, parse
from netboard.base.tables.experiment import Session
from netboard.windows.operator.form_fields import FormAnswers, as_json, first_entry, problems

GOOD = FormAnswers("S03", "P05", "P06", "right", "left", "left", consent=True, pilot=False)


def test_form_answers_are_valid_session_settings() -> None:
    assert {field.name for field in fields(FormAnswers)} <= {field.name for field in fields(Session)}
    answers = json.loads(as_json(GOOD))
    text = "[session]\n" + "\n".join(f"{name} = {json.dumps(value)}" for name, value in answers.items())
    assert parse(text).session == replace(Config().session, **answers)


def test_consent_is_never_prefilled_from_the_configuration() -> None:
    assert not first_entry(replace(Session(), consent=True)).consent


def test_valid_answers_have_no_problems() -> None:
    assert problems(GOOD) == {}
    assert problems(replace(GOOD, consent=False, pilot=True)) == {}


@pytest.mark.parametrize("wrong", ["", "Anna Bauer", "../S01", "S01/", "é", "P 07", "x" * 65])
@pytest.mark.parametrize("name", ["name", "participant_a", "participant_b"])
def test_labels_are_pseudonyms(name: str, wrong: str) -> None:
    assert set(problems(replace(GOOD, **{name: wrong}))) == {name}


def test_both_participants_must_have_different_ids() -> None:
    assert "both" in problems(replace(GOOD, participant_b="P05"))["participant_b"]


def test_real_session_requires_consent() -> None:
    assert set(problems(replace(GOOD, consent=False))) == {"consent"}
