"""What follows a tick in which something began or was decided: its events, and what the session does about it.

Events are recorded right after their tick, so that the log has one order however many ticks are finished at once.
"""

from typing import final

from netboard.nodes.server.block_changes import BlockChanges
from netboard.nodes.server.event_log import change_of
from netboard.nodes.server.record_keeping import RecordKeeping
from netboard.nodes.server.state import RING_ROWS, SessionState
from netboard.stage.curtain import Pause
from netboard.stage.perturbing import PERTURBATION, begins_perturbation, perturbation_of
from netboard.task.trials.state_machine import STAGE_FAULT, Cause, Phase


@final
class Decisions:
    """Records what the stage has decided, and lets the session follow it."""

    def __init__(self, state: SessionState, blocks: BlockChanges, records: RecordKeeping) -> None:
        self._state, self._blocks, self._records = state, blocks, records

    def record(self, number: int) -> None:
        """Record what began or was decided in a tick."""
        state = self._state
        row, config = state.rows[number % RING_ROWS], state.block.config
        if begins_perturbation(row, config):
            details = perturbation_of(row, config)
            state.note(PERTURBATION, details | self._blocks.details.of(int(row["trial"])), number)
        if row["event"]:
            self._record_decision(number)

    def _record_decision(self, number: int) -> None:
        """Record what the stage has decided, and start or end a recording where it has started or ended a block."""
        state = self._state
        row, stage = state.rows[number % RING_ROWS], state.stage[0]
        cause = Cause(int(row["event"]))
        details = change_of(row, stage) | self._blocks.details.of(int(row["trial"]))
        if cause == Cause.FAULT:
            if row["command"] != row["event"]:  # nobody commanded it: the stage itself found an impossible state
                state.supervisor.paused_by(STAGE_FAULT)
            elif state.emergency_stop.halted:
                state.supervisor.pause = Pause.STOP
            details["notice"] = state.supervisor.notice
        state.note(cause.name.lower(), details, number)
        halted = bool(state.emergency_stop.halted)
        for name, judged in state.attempts.record_decision(state.rows, number, stage, halted=halted):
            state.note(name, judged, number)
        if cause == Cause.START:
            self._records.start()
            state.questionnaires = ""
        elif int(stage["phase"]) == Phase.FINISHED:
            self._block_over(cause, number)
        elif int(row["phase"]) == Phase.FINISHED:
            self._blocks.reopen_block()
        if int(stage["phase"]) == Phase.PAUSED:
            state.operators.pause_after = False  # the attempt is over

    def _block_over(self, cause: Cause, number: int) -> None:
        """Ask for the questionnaires of a block that is over; an operator who has stopped it decides what follows."""
        state = self._state
        state.operators.pause_after = False
        if state.sequence.last:
            state.allow_arming(False)
        if cause == Cause.LAST:
            self._blocks.finish_block(number)
        elif state.operators.end_after:
            state.end_requested = True
        if asked := state.block.config.block.questionnaires:
            state.questionnaires = asked
            state.note("questionnaire", {"text": asked})
        state.forms.ask(state.block.config)
