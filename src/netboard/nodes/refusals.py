"""Saying no, to any number of frames that do not belong, without being kept from the work by it.

A refusal is answered and noted the first time, and then at most once a second for the same peer and reason, with the
number of times. Whoever sends more kinds of nonsense than are remembered is lumped together.
"""

from netboard import ends
from netboard.wire.codec import encode
from netboard.wire.meeting import Refusal

AGAIN_NS = 1_000_000_000
"""The same refusal is repeated after so long [ns]."""

REMEMBERED = 256
"""Kinds of refusals told apart [1]."""

_OTHERS = (b"others", "")


class Refusals:
    """The refusals on one channel.

    Parameters
    ----------
    router : ends.Router
        Server end of the channel.
    news : list
        Where they are noted: name and details of an event.
    """

    def __init__(self, router: ends.Router, news: list[tuple[str, dict[str, str]]]) -> None:
        self._router = router
        self._news = news
        self._seen: dict[tuple[bytes, str], tuple[int, int]] = {}

    def refuse(self, peer: bytes, reason: str, now_ns: int) -> None:
        """Refuse what a peer has sent."""
        kind = (peer, reason)
        if kind not in self._seen and len(self._seen) >= REMEMBERED:
            kind = _OTHERS
        times, said_ns = self._seen.get(kind, (0, now_ns - AGAIN_NS))
        times += 1
        if now_ns - said_ns >= AGAIN_NS:
            said_ns = now_ns
            details = {"peer": peer.decode(errors="replace"), "reason": reason, "times": str(times)}
            self._news.append(("refused", details))
            self._router.send(peer, encode(Refusal(reason)))
        self._seen[kind] = (times, said_ns)
