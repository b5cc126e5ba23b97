"""Peers that join and leave a channel, as events at a limited rate.

Peers that reconnect as fast as they can must flood neither the recording nor the tick: events beyond the rate are only
counted. Pure: time is an argument.
"""

from netboard.network.protocol.joining import Hello

EVENTS_HZ, EVENTS_AT_ONCE = 5, 40
"""Sustained rate and burst of the events on a channel [Hz, 1]."""

News = list[tuple[str, dict[str, str]]]
"""Names and details of events."""


class PeerEvents:
    """The rate-limited events of one channel."""

    def __init__(self, news: News) -> None:
        self._news = news
        self._left = float(EVENTS_AT_ONCE)
        self._seen_ns: int | None = None
        self._untold = 0

    def tell(self, name: str, details: dict[str, str], now_ns: int) -> None:
        """Add an event, or only count it if there were too many; ``untold`` of the next event is that count."""
        elapsed = 0 if self._seen_ns is None else (now_ns - self._seen_ns) * 1e-9
        self._seen_ns = now_ns
        self._left = min(self._left + elapsed * EVENTS_HZ, EVENTS_AT_ONCE)
        if self._left < 1:
            self._untold += 1
            return
        self._left -= 1
        if self._untold:
            details = {**details, "untold": str(self._untold)}
        self._untold = 0
        self._news.append((name, details))

    def tell_of(self, hello: Hello, name: str, own: dict[str, str], now_ns: int) -> None:
        """Add an event with what a peer says of itself in its `Hello`; ``own``: details that it cannot override."""
        self.tell(name, {**own, **hello.details, **own}, now_ns)
