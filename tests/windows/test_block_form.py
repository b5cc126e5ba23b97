"""The form of a block at a display with a small server: when it is asked, and that its answers arrive."""

from dataclasses import replace

import pytest
from display_parts import DisplayRig, until

from netboard.base.config import Config
from netboard.base.tables.questionnaires import Form, FormQuestion, packed
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.network.transport import sockets
from netboard.windows.participant.scene import PictureState

pytestmark = pytest.mark.integration

QUESTIONS = {
    "a.first": FormQuestion(kind="choice", text="Who?", choices=("a person", "a program")),
    "a.second": FormQuestion(kind="vas", text="How sure?"),
}
ASKED = replace(Config(), form=Form(tuple(packed(*name.split("."), question) for name, question in QUESTIONS.items())))


class FormRig(DisplayRig):
    """A display whose block has a form of two questions."""

    @property
    def form(self):
        """The open form, or None."""
        from netboard.windows.participant.form import FormWidget

        found = [one for one in self.window.findChildren(FormWidget) if not one.isHidden()]
        return found[0] if found else None

    def asks(self, **view):
        """Return whether the form opens when the block is over."""
        return until(self.app, lambda: self.server.show(**{"phase": "finished", **view}) and self.form is not None)

    def goes_on(self, **view):
        """Return whether the form closes when the session goes on."""
        return until(self.app, lambda: self.server.show(**{"phase": "idle", **view}) and self.form is None)

    def answer(self):
        """Answer both questions."""
        for answer in ("a program", "70"):
            self.form.field.put(answer)
            self.form._forward()

    def answers(self, count=1):
        """Return the answers that the server has received, as soon as there are so many."""

        def found():
            self.server.has_received(QuestionnaireAnswers)
            return [one for one in self.server.messages if isinstance(one, QuestionnaireAnswers)]

        assert until(self.app, lambda: len(found()) >= count)
        return [(one.block, one.given, one.complete) for one in found()]


GIVEN = {"a.first": "a program", "a.second": "70"}


@pytest.fixture
def rig(app):
    made = FormRig(app)
    made.serve()
    made.welcome(ASKED)
    yield made
    made.close()


@pytest.fixture
def impatient_rig(app):
    """A rig with a short link timeout."""
    made = FormRig(app, link_timeout_ms=150.0)
    made.serve()
    made.welcome(ASKED)
    yield made
    made.close()


def test_form_is_asked_once_after_a_block(rig):
    assert rig.asks()
    rig.answer()
    assert rig.answers() == [(1, GIVEN, True)]
    painted = rig.client.tally.painted
    assert until(rig.app, lambda: rig.server.show(phase="finished", best=1.0) and rig.client.tally.painted > painted)
    assert rig.form is None


def test_form_of_the_next_session_is_asked_too(rig):
    assert rig.asks()
    rig.answer()
    assert rig.answers() == [(1, GIVEN, True)]
    rig.welcome(ASKED, session="s2")
    assert rig.asks()
    rig.answer()
    assert rig.answers(2) == [(1, GIVEN, True)] * 2


def test_form_of_a_block_that_was_begun_again_is_asked_again(rig):
    assert rig.asks()
    rig.answer()
    assert rig.shows(PictureState.RUN, phase="running")
    assert rig.asks()


def test_form_closes_with_what_was_filled_in_when_the_session_goes_on(rig):
    assert rig.asks()
    rig.form.field.put("a program")
    assert rig.goes_on()
    assert rig.answers() == [(1, {"a.first": "a program", "a.second": ""}, False)]


def test_answers_that_cannot_be_sent_are_sent_later(rig, monkeypatch):
    send, refused = sockets.send, []

    def full(socket, frame):
        refused.append(frame)
        return False

    assert rig.asks()
    monkeypatch.setattr(sockets, "send", full)
    rig.answer()
    assert until(rig.app, lambda: len(refused) > 1)
    monkeypatch.setattr(sockets, "send", send)
    assert rig.answers() == [(1, GIVEN, True)]


def test_answers_of_another_session_are_dropped(rig, monkeypatch, caplog):
    assert rig.asks()
    monkeypatch.setattr(sockets, "send", lambda socket, frame: False)
    rig.answer()
    rig.welcome(ASKED, session="s2")
    monkeypatch.undo()
    assert "answers were not sent" in caplog.text
    assert rig.asks()
    rig.answer()
    assert rig.answers() == [(1, GIVEN, True)], "only those of the new session"


def test_form_keeps_what_was_filled_in_while_the_link_is_lost(impatient_rig):
    rig = impatient_rig
    assert rig.asks()
    rig.form.field.put("a program")
    assert rig.shows(PictureState.LOST)
    assert rig.form is None
    assert rig.asks()
    assert rig.form.field.answer() == "a program"
    rig.answer()
    assert rig.answers() == [(1, GIVEN, True)]


def test_closing_the_display_sends_what_was_filled_in(rig):
    assert rig.asks()
    rig.form.field.put("a program")
    rig.client.close()
    assert rig.answers() == [(1, {"a.first": "a program", "a.second": ""}, False)]


def test_end_of_the_session_sends_what_was_filled_in(rig):
    assert rig.asks()
    rig.form.field.put("a program")
    rig.server.send(Goodbye("the session is over"))
    assert rig.answers() == [(1, {"a.first": "a program", "a.second": ""}, False)]
    assert rig.form is None
