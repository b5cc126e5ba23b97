"""Who comes and goes on a channel, as events: a few a second, and of more than that only how many there were.

Peers that come and go as fast as they can must fill neither the recording nor the tick. Pure: it is told the time.
"""

EVENTS_HZ, EVENTS_AT_ONCE = 5, 40
"""Comings and goings on a channel that are told of for long, and at once [Hz, 1]."""

News = list[tuple[str, dict[str, str]]]
"""What has happened: names and details of events."""


class Comings:
    """The comings and goings on one channel."""

    def __init__(self, news: News) -> None:
        self._news = news
        self._left = float(EVENTS_AT_ONCE)
        self._seen_ns: int | None = None
        self._untold = 0

    def tell(self, name: str, details: dict[str, str], now_ns: int) -> None:
        """Note an event; if there were too many, only count it: ``untold`` of the next one says how many those are."""
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
