"""The form of a block that is over: who has still to answer it, and the answers.

The next block waits until everybody who took part has answered, for `Form.wait` at most, or until an operator skips the
form. A participant who does not answer is named in an event; what they had filled in by then comes when the form
closes, and is recorded then.
"""

from collections.abc import Iterator

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import NetboardError, WireError
from netboard.base.tables.questionnaires import problems_of, questions_of
from netboard.network.protocol.control import FORM_AWAITED
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.stage.curtain import make_curtain
from netboard.task.journal.entries import FormAwaited


class Questionnaires:
    """The forms of a session, and who has answered them."""

    def __init__(self) -> None:
        self._asked: dict[int, Config] = {}  # the blocks whose form was asked
        self._waiting: dict[Side, int] = {}  # the block that each station has still to answer
        self.unsent: set[Side] = set()  # stations whose display may hold an open form
        # Blocks and stations with answers, and with a finished form.
        self._given: set[tuple[int, Side]] = set()
        self._finished: set[tuple[int, Side]] = set()
        self._until_ns = 0

    def ask(self, config: Config) -> None:
        """Ask the form of a block that is over."""
        if not config.form.questions:
            return
        self._asked[config.block.number] = config
        away = make_curtain(config).away
        self._waiting = {side: config.block.number for side in SIDES if side not in away}
        self.unsent = set(self._waiting)
        again = {(block, side) for side, block in self._waiting.items()}
        self._given, self._finished = self._given - again, self._finished - again
        self._until_ns = now_ns() + round(config.form.wait * 1e9)

    def take(self, answers: QuestionnaireAnswers) -> dict[str, str]:
        """Return answers as event details; raise WireError if they do not belong to a form, or must not replace others.

        A station may have two displays, or one that was restarted: an unfinished form does not follow a finished one,
        nor one without answers one that has some.
        """
        station: Side = "left" if answers.station == "left" else "right"
        config = self._asked.get(answers.block)
        if config is None:
            raise WireError(f"the {station} display may not answer: block {answers.block} has no form that was asked")
        questions = questions_of(config.form)
        for problem in problems_of(questions, answers.given):
            raise WireError(f"the {station} display answers {problem}")
        place, empty = (answers.block, station), not any(answers.given.values())
        if not answers.complete and (place in self._finished or (empty and place in self._given)):
            raise WireError(f"the {station} display has an unfinished form of block {answers.block}, which has answers")
        if not empty:
            self._given.add(place)
        if answers.complete:
            self._finished.add(place)
            if self._waiting.get(station) == answers.block:
                del self._waiting[station]
        if answers.block == max(self._asked) and station not in self._waiting:
            self.unsent.discard(station)
        return {
            "station": station,
            "block": str(answers.block),
            "label": config.block.label,
            "participant": participant_at(config, station),
            "partner": partner_of(config, station),
            "complete": str(answers.complete).lower(),
            "seconds": f"{answers.seconds:.3f}",
            **{name: answers.given.get(name, "") for name in questions},
        }

    def close(self, skipped_by: str = "") -> Iterator[dict[str, str]]:
        """Stop waiting, and yield who has not answered as event details; ``skipped_by``: the operator who asked so."""
        by = {"skipped_by": skipped_by} if skipped_by else {}
        for station, block in self._waiting.items():
            yield {"station": station, "block": str(block), **by}
        self._waiting.clear()

    def withdraw(self) -> None:
        """Stop waiting: the block goes on, and its form will be asked again."""
        self._waiting.clear()

    @property
    def awaited(self) -> FormAwaited:
        """Whose answers are awaited, for the journal."""
        return FormAwaited(max(self._waiting.values(), default=0), tuple(self._waiting))

    def require_awaited(self) -> str:
        """Return in words whose answers are awaited; raise NetboardError if none are."""
        if not self._waiting:
            raise NetboardError("no questionnaire waits for answers")
        return self._awaited

    @property
    def _awaited(self) -> str:
        """The stations whose answers are awaited; in a blinded block only that there are some."""
        blinded = any(self._asked[block].block.blinded for block in self._waiting.values())
        return "the participants" if blinded else " and ".join(self._waiting)

    @property
    def open(self) -> bool:
        """Whether the next block still waits for answers."""
        return bool(self._waiting) and now_ns() < self._until_ns

    @property
    def notice(self) -> str:
        """What an operator must know about the form; empty: nothing."""
        if not self._waiting:
            return ""
        left = max(0.0, (self._until_ns - now_ns()) * 1e-9)
        return f"{FORM_AWAITED}{self._awaited}, {left:.0f} s at most"


def participant_at(config: Config, station: Side) -> str:
    """Return the pseudonym of the participant at a station in a block."""
    who = config.session
    if config.block.configuration == "bimanual":
        letter = config.block.performer
    else:
        letter = "A" if who.seat_a == station else "B"
    return who.participant_a if letter == "A" else who.participant_b


def partner_of(config: Config, station: Side) -> str:
    """Return what moved the other end: ``own`` hand, ``person``, ``still``, or the name of a robot partner."""
    block = config.block
    if block.configuration == "bimanual":
        return "own"
    return block.right if station == "left" else block.left
