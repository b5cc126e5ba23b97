"""Who is asked after a block, what of the answers is recorded, and what a log shows of them."""

from dataclasses import replace
from pathlib import Path

import pytest
from stepped_session import STUDY, SteppedSession

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, parse
from netboard.base.errors import NetboardError, WireError
from netboard.base.tables.questionnaires import ANSWERS, PERSON_FORM, Form, packed
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.network.transport import sockets
from netboard.nodes.server.event_log import line_of
from netboard.nodes.server.questionnaires import Questionnaires, participant_at, partner_of
from netboard.nodes.server.record_keeping import ANSWERS_NS

FORM = Form(tuple(packed("person", name, question) for name, question in PERSON_FORM.items()), wait=60.0)
ASKING = STUDY + '[questionnaires]\nopinion = { after = ["dyadic"], form = "person", wait = 60 }\n'
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


def test_unfinished_form_of_a_second_display_does_not_follow_answers() -> None:
    forms, _ = asked()
    forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))
    with pytest.raises(WireError, match="the left display has an unfinished form of block 1, which has answers"):
        forms.take(QuestionnaireAnswers("left", 1, {}, 3.0, False))
    forms.take(QuestionnaireAnswers("right", 1, {}, 3.0, False))
    forms.take(QuestionnaireAnswers("right", 1, {"person.opinion": "a person"}, 3.0, False))
    with pytest.raises(WireError, match="which has answers"):
        forms.take(QuestionnaireAnswers("right", 1, {}, 3.0, False))
    more = forms.take(QuestionnaireAnswers("right", 1, GIVEN, 3.0, False))
    assert more["person.confidence"] == "80", "the display was restarted, and its participant has answered more"
    assert forms.unsent == {"right"}, "it may still hold an open form"
    assert forms.take(QuestionnaireAnswers("right", 1, GIVEN, 3.0, True))["complete"] == "true"
    assert forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True)), "a participant may answer again"


def test_block_that_is_begun_again_waits_for_no_answers_until_it_is_over() -> None:
    forms, config = asked()
    forms.take(QuestionnaireAnswers("left", 1, GIVEN, 3.0, True))
    forms.withdraw()
    assert (forms.notice, forms.open, list(forms.close())) == ("", False, [])
    forms.ask(config)
    assert forms.take(QuestionnaireAnswers("left", 1, {}, 3.0, False))["complete"] == "false"
    assert forms.notice.startswith("questionnaire: waiting for left and right")


def test_displays_may_hold_a_form_until_they_have_sent_it() -> None:
    forms, _ = asked()
    list(forms.close("lab1:17"))
    assert forms.unsent == {"left", "right"}
    forms.take(QuestionnaireAnswers("left", 1, {}, 3.0, False))
    forms.take(QuestionnaireAnswers("right", 1, GIVEN, 3.0, True))
    assert not forms.unsent


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


def test_what_displays_send_at_the_goodbye_is_recorded_before_the_session_ends(
    tmp_path: Path, context: sockets.Context
) -> None:
    run = SteppedSession(tmp_path, context, study=ASKING)
    run.start()
    run.finish_block()
    run.do("stop_after_block")
    run.session._blocks.close_form()
    records, control = run.session.records, run.state.ports.control
    records.end()
    records.continue_ending(now_ns())
    assert "session_ended" not in [event.name for event in run.events()], "the displays have not answered yet"
    for station in SIDES:
        control.answers.append(QuestionnaireAnswers(station, 1, {"opinion.opinion": "a person"}, 3.0, False))
    records.continue_ending(now_ns())
    names = [event.name for event in run.events()]
    assert names[-3:] == [ANSWERS, ANSWERS, "session_ended"]
    run.close()


def test_session_ends_without_displays_that_send_nothing(tmp_path: Path, context: sockets.Context) -> None:
    run = SteppedSession(tmp_path, context, study=ASKING)
    run.start()
    run.finish_block()
    run.session.records.end()
    run.session.records.continue_ending(now_ns() + ANSWERS_NS + 1)
    assert run.events()[-1].name == "session_ended"
    run.close()


def test_resumed_session_names_the_answers_that_a_lost_server_waited_for(
    tmp_path: Path, context: sockets.Context
) -> None:
    run = SteppedSession(tmp_path, context, study=ASKING)
    run.start()
    run.finish_block()
    run.state.ports.control.answers.append(
        QuestionnaireAnswers("left", 1, {"opinion.opinion": "a person", "opinion.confidence": "80"}, 3.0, True)
    )
    run.session.records.take_answers()
    run.session.records.keep(now_ns())
    run.session.records.close()  # without an end
    run.state.ports.log.close()
    said: list[str] = []
    _, attempts = run.planned.resume(lambda words: not said.append(words))
    assert "answers to the questionnaires of block 1 are lost" in said[0]
    lost = [{"station": "right", "block": "1", "reason": "the server had ended"}]
    assert list(attempts.lost_answers()) == lost
    attempts.close()
