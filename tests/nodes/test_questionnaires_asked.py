"""Who is asked after a block, what of the answers is recorded, and what a log shows of them."""

from dataclasses import replace

import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import NetboardError, WireError
from netboard.base.tables.questionnaires import ANSWERS, PERSON_FORM, Form, packed
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.nodes.server.event_log import line_of
from netboard.nodes.server.questionnaires import Questionnaires, participant_at, partner_of

FORM = Form(tuple(packed("person", name, question) for name, question in PERSON_FORM.items()), wait=60.0)
GIVEN = {"person.opinion": "a person", "person.confidence": "80"}


def asked(text: str = "", form: Form = FORM) -> tuple[Questionnaires, Config]:
    config = replace(parse('[session]\nparticipant_a = "P1"\nparticipant_b = "P2"\n' + text), form=form)
    forms = Questionnaires()
    forms.ask(config)
    return forms, config


def test_next_block_waits_until_both_have_answered() -> None:
    forms, _ = asked()
    assert forms.open
    assert forms.notice.startswith("questionnaire: waiting for left and right, 60 s at most")
    forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))
    assert "left" not in forms.notice
    forms.take(QuestionnaireAnswers("right", 1, GIVEN, 3.0, True))
    assert not forms.open
    assert forms.notice == ""
    assert list(forms.close()) == []


def test_block_without_a_form_waits_for_nobody() -> None:
    forms, _ = asked(form=Form())
    assert not forms.open
    with pytest.raises(WireError, match="block 1 has no form"):
        forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))


def test_wait_is_limited_and_names_who_has_not_answered() -> None:
    forms, _ = asked(form=replace(FORM, wait=0.0))
    assert not forms.open
    assert list(forms.close()) == [{"station": "left", "block": "1"}, {"station": "right", "block": "1"}]


def test_operator_who_skips_the_form_is_named_with_each_station_that_has_not_answered() -> None:
    forms, _ = asked()
    forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))
    assert forms.require_awaited() == "right"
    assert list(forms.close("lab1:17")) == [{"station": "right", "block": "1", "skipped_by": "lab1:17"}]
    assert not forms.open
    with pytest.raises(NetboardError, match="no questionnaire waits"):
        forms.require_awaited()
    late = forms.take(QuestionnaireAnswers("right", 1, GIVEN, 3.0, True))
    assert late["complete"] == "true", "answers that come later are kept"


def test_partial_answers_that_come_later_are_kept() -> None:
    forms, _ = asked()
    list(forms.close())
    details = forms.take(QuestionnaireAnswers("right", 1, {"person.opinion": "a program"}, 3.0, False))
    assert (details["complete"], details["person.opinion"], details["person.confidence"]) == ("false", "a program", "")


def test_next_block_still_waits_for_a_form_that_closed_unfinished() -> None:
    forms, _ = asked()
    for complete in (True, False):
        assert forms.open
        forms.take(QuestionnaireAnswers("left" if complete else "right", 1, GIVEN, 3.0, complete))
    assert forms.open
    assert list(forms.close()) == [{"station": "right", "block": "1"}]


def test_answers_have_participant_and_true_partner() -> None:
    forms, config = asked('seat_a = "right"\n[block]\nright = "lqg"\n')
    details = forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))
    assert (details["participant"], details["partner"], details["person.opinion"]) == ("P2", "lqg", "a person")
    assert not forms.open, "a robot partner is not asked"
    assert partner_of(config, "right") == "person"


def test_bimanual_block_asks_its_performer_only() -> None:
    forms, config = asked('[block]\nconfiguration = "bimanual"\nperformer = "B"\nstation = "right"\n')
    assert forms.notice.startswith("questionnaire: waiting for right")
    assert (participant_at(config, "right"), partner_of(config, "right")) == ("P2", "own")


@pytest.mark.parametrize(
    ("given", "said"), [({"person.age": "3"}, "no such question"), ({"person.confidence": "300"}, "expected 0 to 100")]
)
def test_answers_that_do_not_belong_to_the_form_are_refused(given: dict[str, str], said: str) -> None:
    forms, _ = asked()
    with pytest.raises(WireError, match=said):
        forms.take(QuestionnaireAnswers("left", 1, given, 3.0, True))
    assert forms.notice.startswith("questionnaire: waiting for left and right")


def test_log_shows_neither_answers_nor_the_partner() -> None:
    forms, _ = asked('[block]\nright = "lqg"\n')
    line = line_of(ANSWERS, forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True)))
    assert line == "answers station=left block=1 complete=true"
