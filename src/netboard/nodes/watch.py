"""The watch over a block: which command, if any, the stage gets at a tick.

Operators wish, peers come and go, the log falls behind: all of it ends here as one `Cause` a tick and a line for
people.
Pure: it is told everything and does nothing.
"""

from dataclasses import dataclass, field

from netboard.experiment.machine import TABLE, Cause, Phase

READY_TICKS = 500
"""Everything must have been ready for so many ticks before a block starts or goes on by itself [1]."""

WISHES = {
    "start": Cause.START,
    "pause": Cause.PAUSE,
    "resume": Cause.RESUME,
    "abort": Cause.ABORT,
    "stop": Cause.STOP,
}
"""Operator's commands that the trial machine knows."""

_NEED_PEERS = (Cause.START, Cause.RESUME)


@dataclass
class Watch:
    """Decides the command of each tick.

    Attributes
    ----------
    autostart : bool
        Start when everything is ready, and go on after a fault when everything is ready again.
    notice : str
        What the operator should know.
    """

    autostart: bool
    notice: str = ""
    _ready_since: int | None = None
    _faulted: bool = False
    _refused: str = field(default="", repr=False)

    def command(self, tick: int, phase: Phase, wish: str, missing: tuple[str, ...], trouble: str) -> Cause:
        """Command for this tick.

        While a trial goes on, nothing is wished and nothing is wrong, it need not be asked.

        Parameters
        ----------
        tick : int
            Number of the tick [1].
        phase : Phase
            Where the trial is.
        wish : str
            An operator's command, or empty.
        missing : tuple of str
            What a block needs and is not there.
        trouble : str
            Why a running trial cannot go on, or empty.

        Returns
        -------
        Cause
            `Cause.NONE` if there is nothing to do.
        """
        if missing or trouble:
            self._ready_since = None
        elif self._ready_since is None:
            self._ready_since = tick
        if trouble and wish != "stop" and Cause.FAULT in TABLE[phase]:
            self._faulted = True
            self.notice = f"paused: {trouble}"
            return Cause.FAULT
        if wish:
            return self._wished(phase, WISHES[wish], missing)
        if self.autostart and self._ready_since is not None and tick - self._ready_since >= READY_TICKS:
            return self._by_itself(phase)
        if phase == Phase.IDLE and missing and not self._refused:
            self.notice = "waiting for " + ", ".join(missing)
        return Cause.NONE

    def _wished(self, phase: Phase, cause: Cause, missing: tuple[str, ...]) -> Cause:
        if cause not in TABLE[phase]:
            self.notice = self._refused = f"cannot {cause.name.lower()} while {phase.name.lower()}"
            return Cause.NONE
        if cause in _NEED_PEERS and missing:
            self.notice = self._refused = f"cannot {cause.name.lower()} without " + ", ".join(missing)
            return Cause.NONE
        self._faulted = False
        self.notice = self._refused = ""
        return cause

    def _by_itself(self, phase: Phase) -> Cause:
        if phase == Phase.IDLE:
            self.notice = ""
            return Cause.START
        if phase == Phase.PAUSED and self._faulted:
            self._faulted = False
            self.notice = ""
            return Cause.RESUME
        return Cause.NONE
