"""The supervisor of a block: decides which command the stage gets when no operator has given one.

Peers come and go, the log falls behind: each tick, all of it becomes one `Cause` and one line for operators.
It keeps what it has seen so far, such as since when everything has been ready. It knows no clock and no peers.
"""

from dataclasses import dataclass

from netboard.nodes.ports.waiting import in_words
from netboard.stage.curtain import Pause
from netboard.task.trials.state_machine import TABLE, Cause, Phase

READY_TICKS = 500
"""Ticks for which everything must have been ready before a block starts or resumes by itself [1]."""

PERSISTENT_TICKS = 100
"""Ticks for which a problem must last during a pause to be named later as the cause of the pause [1]."""


REOPENED = "lost trials of this block are repeated"
"""Reason of the pause before the repeats of a block that was over."""


@dataclass
class TrialSupervisor:
    """Decides the command of each tick.

    ``notice``: one line for operators. ``pause``: what has caused the last pause, for the participants.
    """

    autostart: bool  # start when everything is ready, and resume after a fault when everything is ready again
    notice: str = ""
    pause: Pause = Pause.OPERATOR
    _ready_since: int | None = None
    _resumes: bool = False  # whether the pause ends by itself when everything is ready again
    _released: bool = False
    _replaced: str = ""
    _cause: str = ""
    _trouble: str = ""
    _trouble_since: int = 0

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
        if trouble and Cause.FAULT in TABLE[phase]:
            self._resumes = True
            self.paused_by(trouble)
            return Cause.FAULT
        ready = self._ready_since is not None and tick - self._ready_since >= READY_TICKS
        if self.autostart and ready and not (self._released or self._replaced):
            return self._by_itself(phase)
        self._set_notice(tick, phase, missing, trouble)
        return Cause.NONE

    def command_carried_out(self, cause: Cause) -> None:
        """Note that a command was carried out: older notices no longer apply, but for what changes no trial now."""
        if cause in (Cause.REPEAT, Cause.VETO):
            return
        self._resumes = False
        self._released = self._released and cause not in (Cause.START, Cause.RESUME)
        self.notice = self._cause = self._replaced = ""

    def reopened(self) -> None:
        """Note that a block that was over goes on, once it is resumed."""
        self._resumes = self.autostart
        self.paused_by(REOPENED, Pause.REPEATS)

    def paused_by_operator(self, name: str) -> None:
        """Note that an operator, of this name, has paused the trial: only an operator's command resumes it."""
        self._resumes, self.pause = False, Pause.OPERATOR
        self.notice = self._cause = f"paused by the operator ({name})"

    def await_operator(self) -> None:
        """Resume only on an operator's command, whatever caused the pause."""
        self._resumes = False

    def stop_released(self) -> None:
        """Start and resume only on an operator's command, because an emergency stop was released."""
        self._resumes, self._released = False, True

    def device_replaced(self, side: str) -> None:
        """Note that a side has another device: resume only on an operator's command, who knows who holds it."""
        self._resumes, self._replaced = False, f"the {side} device was replaced by another one"

    def paused_by(self, reason: str, pause: Pause = Pause.FAULT) -> None:
        """Note why the trial is paused."""
        self.pause = pause
        self.notice = self._cause = f"paused: {reason}"

    def _set_notice(self, tick: int, phase: Phase, missing: tuple[str, ...], trouble: str) -> None:
        """Set the notice to what holds now."""
        waiting = f"waiting for {in_words(missing)}" if missing else ""
        if phase == Phase.IDLE:
            ready = "ready to start after the emergency stop" if self._released else ""
            self.notice = waiting or ready or (f"ready to start: {self._replaced}" if self._replaced else "")
        elif phase == Phase.PAUSED:
            if trouble and tick - self._trouble_since >= PERSISTENT_TICKS:
                self._cause = f"paused: {trouble}"
            cause = f"paused: {self._replaced}" if self._replaced else self._cause
            self.notice = "; ".join(filter(None, (cause, waiting)))
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
