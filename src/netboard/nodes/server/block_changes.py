"""Transitions of a session from block to block: open, begin a block, show its last page, begin the next."""

from collections.abc import Iterable
from dataclasses import asdict

from netboard.base.tables.questionnaires import UNANSWERED
from netboard.network.protocol.records import BLOCK_BEGAN
from netboard.nodes.server.state import SessionState
from netboard.task.studies.factors import TrialDetails

PAGE_TICKS = 1500
"""Ticks between the last trial of a block and the next block, so that participants see that the block is over [1]."""


class BlockChanges:
    """Opens the session and changes its blocks."""

    def __init__(self, state: SessionState) -> None:
        self._state = state
        self._due = -1
        self.details = TrialDetails(state.block.config)  # a session may end before its form is complete

    def begin_session(self) -> None:
        """Open the session, or wait for its form."""
        state = self._state
        if state.attempts.opened or not state.sequence.planned or state.block.config.session.ready:
            self.open()
        else:
            state.enter_block()

    def open(self) -> None:
        """Open the session: record everything from now on."""
        state = self._state
        state.attempts.open(state.sequence.block.config, state.session)  # if refused, nothing of the form is kept
        state.operators.opened = state.event_log.opened = True
        self._begin_block()
        self._record_unanswered(state.attempts.lost_answers())
        state.event_log.record_held(state.number)

    def finish_block(self, number: int) -> None:
        """Begin the next block some time after the last trial, which ended at this tick.

        If the block has lost too many trials, wait for the operator, who may have them repeated.
        """
        if not self._state.awaits_decision:
            self._due = number + PAGE_TICKS

    def reopen_block(self) -> None:
        """Go on with the block, which was over: a trial of it is repeated."""
        self._due = -1
        state = self._state
        state.questionnaires = ""
        state.forms.withdraw()
        state.supervisor.reopened()
        if state.supervisor.autostart:
            state.allow_arming(True)

    def skip_block(self) -> None:
        """Begin the next block with the next tick."""
        self._due = self._state.number + 1
        self._state.operators.end_after = False
        self._state.attempts.give_up()

    @property
    def coming(self) -> bool:
        """Whether a change of the block is coming."""
        return self._due >= 0

    def change_if_due(self, number: int) -> None:
        """Begin the next block if that is due at this tick, or end the session if an operator asked for that."""
        if not 0 <= self._due <= number or self._state.forms.open:
            return
        self.close_form()
        self._due = -1
        state = self._state
        if state.operators.end_after:
            state.end_requested = True
        elif not state.sequence.last:
            state.sequence.next()
            self._begin_block()

    def close_form(self) -> None:
        """Stop waiting for the answers to the form of the block that is over."""
        self._record_unanswered(self._state.forms.close())

    def skip_form(self, by: str) -> str:
        """Stop waiting because an operator asks so; return whose answers are missing, in words."""
        awaited = self._state.forms.require_awaited()
        self._record_unanswered(self._state.forms.close(by))
        return f"the session goes on without answers from {awaited}"

    def _record_unanswered(self, missing: Iterable[dict[str, str]]) -> None:
        for details in missing:
            self._state.note(UNANSWERED, details)

    def _begin_block(self) -> None:
        """Begin the current block of the sequence: all following records belong to it."""
        self._due = -1
        state = self._state
        state.enter_block()
        config = state.block.config
        self.details = TrialDetails(config)  # what the plan says of a trial
        state.attempts.begin(config, state.number)
        stepping = {name: str(value) for name, value in asdict(state.block.stage.choice).items()}
        label = {"number": str(config.block.number), "blocks": str(config.block.blocks), "label": config.block.label}
        state.note(BLOCK_BEGAN, {**label, **stepping, "config": state.block.texts.full})
        state.note_peers()  # the recording of this block is another file than that in which they joined
