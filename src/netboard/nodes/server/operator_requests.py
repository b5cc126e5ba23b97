"""Commands of operators: each is accepted or refused, carried out, answered and recorded."""

from netboard.base.errors import NetboardError
from netboard.base.plural import plural
from netboard.nodes.ports import emergency
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.server.block_changes import BlockChanges
from netboard.nodes.server.operators import Decision, Situation, form_of, note_of
from netboard.nodes.server.state import REST, SessionState
from netboard.task.trials.state_machine import Cause, Phase


class OperatorRequests:
    """Takes operators' commands."""

    def __init__(self, state: SessionState, blocks: BlockChanges) -> None:
        self._state, self._blocks = state, blocks

    def forget_silent_commander(self) -> None:
        """Let the next operator that commands be the commander, if the present one has left or is silent."""
        operators = self._state.operators
        if operators.commander and not self._state.ports.control.is_present(operators.commander):
            operators.leave()

    def handle_command(self, request: CommandRequest) -> Cause:
        """Decide on a command, carry it out, reply and record it; return the cause for the trial state machine."""
        state, command = self._state, request.command
        control, operators, sequence = state.ports.control, state.operators, state.sequence
        self.forget_silent_commander()
        missing = tuple(one for one in state.find_missing() if one != REST)  # an operator need not await its end
        situation = Situation(state.phase, missing, sequence.last, sequence.planned)
        decision = operators.decide(request, situation)
        if decision.accepted:
            decision = self._carry_out(request, decision)
        control.reply(request, decision.accepted, decision.reason)
        outcome = {"accepted": str(decision.accepted).lower(), "reason": decision.reason}
        details = {"name": command.name, "argument": command.argument, "by": request.name, **outcome}
        state.note("command", {name: value for name, value in details.items() if value})
        if decision.accepted and decision.cause:
            state.supervisor.command_carried_out(decision.cause)
        if decision.accepted and decision.cause == Cause.PAUSE:
            state.supervisor.paused_by_operator(request.name)
        return decision.cause

    def _carry_out(self, request: CommandRequest, decision: Decision) -> Decision:
        """Carry out the part of a command that the trial state machine does not; refuse it if that fails."""
        state, name, argument = self._state, request.command.name, request.command.argument
        try:
            match name:
                case "end":
                    state.end_requested = True
                    return Decision(True, state.loss and f"{state.loss}; they are not repeated")
                case "pause":
                    state.supervisor.await_operator()
                case emergency.STOP:
                    state.update_arming(state.emergency_stop.halt("emergency stop by an operator"))
                    return Decision(True, "all forces are zero until an operator releases it")
                case emergency.RELEASE:
                    return self._release()
                case "arm" | "disarm":
                    state.update_arming([])
                case "open":
                    state.sequence.open(form_of(argument, state.block.config.session))
                    self._blocks.open()
                case "confirm":
                    return Decision(True, state.confirmations.confirm(argument, request.name, state.shown_stand_ins()))
                case "note":
                    state.attempts.note(*note_of(argument, state.number))
                case _:
                    return self._change_block(request, decision)
        except NetboardError as error:
            return Decision(False, str(error))
        return decision

    def _change_block(self, request: CommandRequest, decision: Decision) -> Decision:
        """Carry out a command on what the block still waits for, and on what follows it."""
        state, name = self._state, request.command.name
        match name:
            case "repeat" | "veto" | "repeat_lost":
                return self._change_repeats(name, request.command.argument, decision)
            case "skip_form":
                return Decision(True, self._blocks.skip_form(request.name))
            case "stop_after_block" if state.phase == Phase.FINISHED and not self._blocks.coming:
                state.end_requested = state.operators.end_after
            case "next":
                self._blocks.skip_block()
                return decision if state.phase == Phase.FINISHED else Decision(True, cause=Cause.STOP)
        return decision

    def _change_repeats(self, name: str, argument: str, decision: Decision) -> Decision:
        """Order or cancel repeats; those of all lost trials are ordered one at each of the next ticks."""
        state = self._state
        if name == "repeat_lost":
            trials = state.attempts.repeat_lost(state.phase)
            return Decision(True, f"{plural(len(trials), 'trial is', 'trials are')} repeated at the end of the block")
        trial = state.attempts.ask(name, argument, int(state.stage[0]["trial"]), state.phase)
        how = "is repeated" if name == "repeat" else "is not repeated"
        return Decision(True, f"trial {trial} {how} at the end of the block", decision.cause)

    def _release(self) -> Decision:
        """Release the emergency stop, if there is one."""
        state = self._state
        if not (released := state.emergency_stop.release()):
            return Decision(True, "there is no emergency stop to release")
        state.supervisor.stop_released()
        state.update_arming(released)
        return Decision(True, "the emergency stop is released")
