"""What operators ask of a session: each command is decided, carried out, answered and recorded."""

from netboard.base.errors import NetboardError
from netboard.nodes.ports import emergency
from netboard.nodes.ports.control_port import Wish
from netboard.nodes.server.block_changes import BlockChanges
from netboard.nodes.server.commands import Decision, Situation, form_of, note_of
from netboard.nodes.server.state import SessionState
from netboard.task.trials.state_machine import Cause, Phase


class OperatorRequests:
    """Takes operators' commands."""

    def __init__(self, state: SessionState, blocks: BlockChanges) -> None:
        self._state, self._blocks = state, blocks

    def obey(self, wish: Wish) -> Cause:
        """Decide on a command, carry it out, reply and record it; return the cause for the trial state machine."""
        state, command = self._state, wish.command
        control, desk, programme = state.ports.control, state.desk, state.programme
        if desk.commander and not control.is_there(desk.commander):
            desk.leave()
        situation = Situation(state.phase, state.lacks(), programme.last, programme.planned)
        decision = desk.decide(command.name, wish.who, wish.name, situation)
        if decision.accepted:
            decision = self._carry_out(command.name, command.argument, decision)
        control.reply(wish, decision.accepted, decision.reason)
        outcome = {"accepted": str(decision.accepted).lower(), "reason": decision.reason}
        details = {"name": command.name, "argument": command.argument, "by": wish.name, **outcome}
        state.note("command", {name: value for name, value in details.items() if value})
        if decision.accepted and decision.cause:
            state.watch.obeyed()
        elif not decision.accepted:
            state.watch.refused(decision.reason)
        return decision.cause

    def _carry_out(self, name: str, argument: str, decision: Decision) -> Decision:
        """Carry out the part of a command that the trial state machine does not; refuse it if that fails."""
        state = self._state
        try:
            match name:
                case "end":
                    state.end_requested = True
                case emergency.STOP:
                    state.set_alarm(state.alarm.halt("emergency stop by an operator"))
                case emergency.RELEASE:
                    state.watch.await_operator()
                    state.set_alarm(state.alarm.release())
                case "arm" | "disarm":
                    state.set_alarm([])
                case "open":
                    state.programme.open(form_of(argument, state.block.config.session))
                    self._blocks.open()
                case "repeat" | "veto":
                    trial = state.ledger.ask(name, argument, int(state.stage[0]["trial"]))
                    how = "is repeated" if name == "repeat" else "is not repeated"
                    return Decision(True, f"trial {trial} {how} at the end of the block", decision.cause)
                case "note":
                    state.ledger.note(*note_of(argument, state.number))
                case "next":
                    self._blocks.skip_block()
                    return decision if state.phase == Phase.FINISHED else Decision(True, cause=Cause.STOP)
        except NetboardError as error:
            return Decision(False, str(error))
        return decision
