"""The supervisor of a block: decides which command the stage gets when no operator has given one.

Peers come and go, the log falls behind: each tick, all of it becomes one `Cause` and one line for operators.
Pure: it gets everything as arguments and only decides.
"""

from dataclasses import dataclass

from netboard.task.trials.state_machine import TABLE, Cause, Phase

READY_TICKS = 500
"""Ticks for which everything must have been ready before a block starts or resumes by itself [1]."""

PERSISTENT_TICKS = 100
"""Ticks for which a problem must last during a pause to be named later as the cause of the pause [1]."""


@dataclass
class Supervisor:
    """Decides the command of each tick."""

    autostart: bool  # start when everything is ready, and resume after a fault when everything is ready again
    notice: str = ""
    _ready_since: int | None = None
    _resumes: bool = False  # whether the pause ends by itself when everything is ready again
    _released: bool = False
    _replaced: str = ""
    _cause: str = ""
    _trouble: str = ""
    _trouble_since: int = 0
    _seen: tuple[Phase, tuple[str, ...], str] | None = None
    _refused_when: tuple[Phase, tuple[str, ...], str] | None = None

    def command(self, tick: int, phase: Phase, missing: tuple[str, ...], trouble: str) -> Cause:
        """Return the command of this tick.

        It need not be called while a trial runs and nothing is wrong.
        """
        if missing or trouble:
            self._ready_since = None
        elif self._ready_since is None:
            self._ready_since = tick
        if trouble != self._trouble:
            self._trouble, self._trouble_since = trouble, tick
        self._seen = (phase, missing, trouble)
        if trouble and Cause.FAULT in TABLE[phase]:
            self._resumes = True
            self.paused_by(trouble)
            return Cause.FAULT
        ready = self._ready_since is not None and tick - self._ready_since >= READY_TICKS
        if self.autostart and ready and not (self._released or self._replaced):
            return self._by_itself(phase)
        if self._refused_when != self._seen:
            self._refused_when = None
            self._set_notice(tick, phase, missing, trouble)
        return Cause.NONE

    def command_carried_out(self, cause: Cause) -> None:
        """Note that a command was carried out: older notices no longer apply, but for what changes no trial now."""
        self._refused_when = None
        if cause in (Cause.REPEAT, Cause.VETO):
            return
        self._resumes = False
        self._released = self._released and cause not in (Cause.START, Cause.RESUME)
        self.notice = self._cause = self._replaced = ""

    def refused(self, reason: str) -> None:
        """Note that an operator's command was refused: show the reason until the situation changes."""
        self.notice, self._refused_when = reason, self._seen

    def forget_refusal(self) -> None:
        """Note that the situation has changed: the reason of a refused command is no longer shown."""
        if self._refused_when is not None:
            self._refused_when, self.notice = None, ""

    def await_operator(self) -> None:
        """Resume only on an operator's command, whatever caused the pause."""
        self._resumes = False

    def stop_released(self) -> None:
        """Start and resume only on an operator's command, because an emergency stop was released."""
        self._resumes, self._released = False, True

    def device_replaced(self, side: str) -> None:
        """Note that a side has another device: resume only on an operator's command, who knows who holds it."""
        self._resumes, self._replaced = False, f"the {side} device was replaced by another one"

    def paused_by(self, reason: str) -> None:
        """Note why the trial is paused."""
        self._refused_when, self._cause = None, reason
        self.notice = f"paused: {reason}"

    def _set_notice(self, tick: int, phase: Phase, missing: tuple[str, ...], trouble: str) -> None:
        """Set the notice to what holds now."""
        waiting = "waiting for " + ", ".join(missing) if missing else ""
        if phase == Phase.IDLE:
            ready = "ready to start after the emergency stop" if self._released else ""
            self.notice = waiting or ready or (f"ready to start: {self._replaced}" if self._replaced else "")
        elif phase == Phase.PAUSED:
            if trouble and tick - self._trouble_since >= PERSISTENT_TICKS:
                self._cause = trouble
            cause = self._replaced or self._cause
            ready = f"ready to resume (paused: {cause})" if cause else ""
            self.notice = f"paused: {trouble or waiting}" if trouble or waiting else ready
        else:
            self.notice = ""

    def _by_itself(self, phase: Phase) -> Cause:
        if phase == Phase.IDLE:
            self.command_carried_out(Cause.START)
            return Cause.START
        if phase == Phase.PAUSED and self._resumes:
            self.command_carried_out(Cause.RESUME)
            return Cause.RESUME
        return Cause.NONE
