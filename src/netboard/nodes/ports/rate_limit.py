"""Rate limit of each peer: messages and bytes a second, whatever they contain.

A message beyond the limit is dropped unread and counted, so that no peer can take the time of a tick or of another
peer, however fast it sends. netboard's own peers send at most a tenth of it. Pure: time is an argument.
"""

MESSAGES_HZ, MESSAGES_AT_ONCE = 500, 200
"""Sustained rate and burst of a peer's messages [Hz, 1]."""

BYTES_HZ, BYTES_AT_ONCE = 65_536, 65_536
"""Sustained rate and burst of a peer's bytes [Hz, 1]."""

COMMANDS_HZ, COMMANDS_AT_ONCE = 20, 40
"""Sustained rate and burst of a console's commands, each of which is recorded [Hz, 1]."""

MAX_PEERS = 1024
"""Peers remembered; beyond that, those with a full allowance are forgotten [1]."""

FULL_NS = 1_000_000_000
"""Silence after which a peer has its full allowance again [ns]."""


class RateLimit:
    """What each peer may still send. ``hz``, ``at_once``: sustained rate and burst of messages [Hz, 1]."""

    def __init__(self, hz: int = MESSAGES_HZ, at_once: int = MESSAGES_AT_ONCE) -> None:
        self._hz, self._at_once = hz, at_once
        self._allowances: dict[bytes, tuple[int, float, float]] = {}

    def allows(self, peer: bytes, size: int, now_ns: int) -> bool:
        """Charge a message of this size [1] to its peer; return False if that exceeds its allowance."""
        before_ns, messages, amount = self._allowances.get(peer, (now_ns, self._at_once, BYTES_AT_ONCE))
        elapsed = (now_ns - before_ns) * 1e-9
        messages = min(messages + elapsed * self._hz, self._at_once)
        amount = min(amount + elapsed * BYTES_HZ, BYTES_AT_ONCE)
        taken = messages >= 1 and amount >= size
        if taken:
            messages, amount = messages - 1, amount - size
        elif peer not in self._allowances:  # do not remember a peer for a message that no peer may send
            return False
        self._allowances[peer] = now_ns, messages, amount
        if len(self._allowances) > MAX_PEERS:
            self._forget(now_ns)
        return taken

    def _forget(self, now_ns: int) -> None:
        """Make room: forget peers with a full allowance, or else all of them."""
        kept = {peer: left for peer, left in self._allowances.items() if now_ns - left[0] < FULL_NS}
        self._allowances = kept if len(kept) <= MAX_PEERS else {}
