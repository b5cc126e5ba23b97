"""A session that does not go on: since when, why, and what can be done, for a demo that nobody may attend.

It reads statuses and gets the time; it prints nothing and ends nothing.
"""

from pathlib import Path
from typing import final

from netboard.base.device_kind import DeviceKind
from netboard.base.safeguards import PARTNER_LET_GO, Safeguard
from netboard.network.protocol.control import Status

LET_GO_SHOWN_S = 1.0
"""Time after which a partner that has let go is reported: not at a single status of a block that changes [s]."""

LET_GO_PATIENCE_S = 10.0
"""Time after which a session that nobody attends ends, because a robot partner has let go until the next block [s]."""

PATIENCE_S = 180.0
"""Time after which it ends for any other reason: a device or a partner may compile for minutes at a first start [s]."""

WHAT_TO_DO = "no trial of this block can go on; end it with Ctrl-C, and mend the partner or choose another one"


def side_let_go(status: Status) -> str:
    """Return the side whose robot partner has let go of the stylus; empty if none has, or if that is blinded."""
    robots = {device.side for device in status.devices if device.kind == DeviceKind.ROBOT}
    dropped = (one.side for one in status.stations if Safeguard.NOT_READY in Safeguard(one.safeguards))
    return next((side for side in dropped if side in robots), "")


@final
class Standstill:
    """Looks at the statuses of a session in turn. ``logs``: folder of the logs of its processes."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._let_go = self._notice = ""
        self._since: float | None = None
        self._reported = False

    def add(self, status: Status, now: float) -> None:
        """Add a status; ``now``: time of any clock [s]."""
        waits = status.phase in ("idle", "paused") and status.rest <= 0.0
        let_go = side_let_go(status) if waits else ""
        if not waits or let_go != self._let_go:
            self._since, self._reported = None, False
        if waits and self._since is None:
            self._since = now
        self._let_go, self._notice = let_go, status.notice

    def news(self, now: float) -> str:
        """Return once in words what has happened and what can be done; empty for nothing new."""
        if self._reported or not self._let_go or self._seconds(now) < LET_GO_SHOWN_S:
            return ""
        self._reported = True
        log = self._logs / f"{self._let_go}-agent.log"
        return f"{self._let_go} side: {PARTNER_LET_GO}: {log}\n{WHAT_TO_DO}"

    def verdict(self, now: float) -> str:
        """Return why a session that nobody attends ends now; empty if it goes on."""
        seconds, patience = self._seconds(now), LET_GO_PATIENCE_S if self._let_go else PATIENCE_S
        if seconds < patience:
            return ""
        return f"ended after {patience:.0f} s without a trial: {PARTNER_LET_GO if self._let_go else self._notice}"

    def _seconds(self, now: float) -> float:
        return 0.0 if self._since is None else now - self._since
