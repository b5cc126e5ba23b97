"""Refusals to peers and in the recording, limited so that a flood of messages does not cause a flood of refusals.

A refusal is sent the first time, and then at most once a second for the same peer and reason.
`netboard.network.transport.refusal_count` counts and reports them.
"""

from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Refusal
from netboard.network.transport import endpoints
from netboard.network.transport.refusal_count import RefusalCounter
from netboard.nodes.ports.peer_events import News

REPEAT_INTERVAL_NS = 1_000_000_000
"""Interval at which the same refusal is sent to its peer again [ns]."""

REMEMBERED = 1024
"""Pairs of peer and reason that are remembered; the oldest is forgotten first [1]."""

TOO_MANY_MESSAGES = "too many messages"
"""Why a message was dropped unread: its peer, or all unregistered peers together, sent too many."""


class Refusals:
    """The refusals on one channel."""

    def __init__(self, router: endpoints.Router, news: News) -> None:
        self._router = router
        self._news = news
        self._count = RefusalCounter()
        self._answered: dict[tuple[bytes, str], int] = {}

    @property
    def channel(self) -> str:
        """Name of the channel."""
        return self._router.channel

    @property
    def totals(self) -> dict[str, int]:
        """Refusals so far, by reason [1]."""
        return self._count.totals

    def refuse(self, peer: bytes, reason: str, now_ns: int) -> None:
        """Refuse a peer's message."""
        self.note(endpoints.shown(peer), reason, now_ns)
        if now_ns - self._answered.get((peer, reason), now_ns - REPEAT_INTERVAL_NS) >= REPEAT_INTERVAL_NS:
            self._answered.pop((peer, reason), None)
            self._answered[peer, reason] = now_ns
            if len(self._answered) > REMEMBERED:
                del self._answered[next(iter(self._answered))]
            self._router.send(peer, encode(Refusal(reason)))

    def note(self, peer: str, reason: str, now_ns: int, times: int = 1) -> None:
        """Count a refusal without sending it."""
        details = {"channel": self._router.channel, "peer": peer, "reason": reason}
        self._count.count((peer, reason), details, times)
        self.poll(now_ns, again=False)

    def poll(self, now_ns: int, *, again: bool = True) -> None:
        """Report new kinds of refusals, and with ``again`` the counts of known ones."""
        self._news += [("refused", details) for details in self._count.reports(now_ns, again=again)]

    def settle(self) -> None:
        """Report the final count of every kind."""
        self._news += [("refused", details) for details in self._count.final_reports()]
