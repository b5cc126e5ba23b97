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
        self._allowance = float(EVENTS_AT_ONCE)
        self._last_ns: int | None = None
        self._omitted = 0

    def add(self, name: str, details: dict[str, str], now_ns: int) -> None:
        """Add an event, or only count it if there were too many; ``untold`` of the next event is that count."""
        elapsed = 0 if self._last_ns is None else (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        self._allowance = min(self._allowance + elapsed * EVENTS_HZ, EVENTS_AT_ONCE)
        if self._allowance < 1:
            self._omitted += 1
            return
        self._allowance -= 1
        if self._omitted:
            details = {**details, "untold": str(self._omitted)}
        self._omitted = 0
        self._news.append((name, details))

    def add_with_details(self, hello: Hello, name: str, details: dict[str, str], now_ns: int) -> None:
        """Add an event with the details of a peer's `Hello` after these ``details``, which it cannot override."""
        self.add(name, {**details, **hello.details, **details}, now_ns)
