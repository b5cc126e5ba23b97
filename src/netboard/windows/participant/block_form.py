"""The form of a block at its display: when it opens and closes, and its answers until they are sent.

It opens when the block is over, and closes when the participant has finished it or the session goes on. While no views
arrive, it is hidden and keeps what was filled in. Answers belong to one session: those that could not be sent are
dropped when another one begins, which may have a block of the same number.
"""

import logging
from collections.abc import Callable, Mapping

from netboard.base.config import Side
from netboard.base.tables.questionnaires import FormQuestion
from netboard.network.protocol.codec import encode
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.stage.view import View
from netboard.windows.participant.form import FormWidget
from netboard.windows.participant.window import BoardWindow
from netboard.windows.participant.words import DisplayTexts

log = logging.getLogger(__name__)


class BlockForm:
    """Opens and closes the form of a block, and keeps its answers until they are sent."""

    def __init__(self, station: Side, window: BoardWindow, words: DisplayTexts) -> None:
        self._station, self._window, self._words = station, window, words
        self._questions: Mapping[str, FormQuestion] = {}
        self._session, self._block = "", 0
        self._widget: FormWidget | None = None
        self._answered = False  # since the block was over
        self._unsent: list[bytes] = []

    def begin_block(self, session: str, block: int, questions: Mapping[str, FormQuestion]) -> None:
        """Take the questions of a block, which may be none."""
        if session != self._session:
            self.drop()
        self._session, self._block, self._questions = session, block, questions

    def follow(self, view: View) -> None:
        """Open or show the form if the block is over; otherwise close it, because the session goes on."""
        if view.phase != "finished" or view.block != self._block:
            self._answered = False  # a block that is begun again is asked again
            self.close()
        elif self._widget is not None:
            self._widget.show()
        elif self._questions and not self._answered:
            self._open()

    def hide(self) -> None:
        """Hide the form until views arrive again."""
        if self._widget is not None:
            self._widget.hide()

    def close(self) -> None:
        """Close the form; what was filled in counts."""
        if self._widget is not None:
            self._widget.close_unfinished()

    def send(self, send: Callable[[bytes], bool]) -> None:
        """Send the answers; those for which `send` returns False are kept for the next call."""
        while self._unsent and send(self._unsent[0]):
            del self._unsent[0]

    def drop(self) -> None:
        """Drop the form and unsent answers, which nobody can receive any more."""
        if self._widget is not None or self._unsent:
            log.warning("answers were not sent: no server of their session is connected")
        self._remove()
        self._unsent.clear()
        self._answered = False

    def _open(self) -> None:
        block, form = self._block, FormWidget(self._window, self._questions, self._words)
        form.done.connect(lambda given, seconds, complete: self._take(block, given, seconds, complete))
        self._window.cover(form)
        self._widget = form

    def _take(self, block: int, given: dict[str, str], seconds: float, complete: bool) -> None:
        """Take the answers to a form, and remove it."""
        self._unsent.append(encode(QuestionnaireAnswers(self._station, block, given, seconds, complete)))
        self._answered = complete
        self._remove()

    def _remove(self) -> None:
        if self._widget is not None:
            self._widget.hide()
            self._widget.deleteLater()
        self._widget = None
