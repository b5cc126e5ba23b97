"""How much each peer may send: messages and bytes a second, whatever they are.

A message beyond that is dropped unread and counted, so that no peer can take the time of a tick, or of another peer,
however fast it sends. What netboard's own peers send is a tenth of it at most. Pure: it is told the time.
"""

MESSAGES_HZ, MESSAGES_AT_ONCE = 500, 200
"""Messages that a peer may send for long, and at once [Hz, 1]."""

BYTES_HZ, BYTES_AT_ONCE = 65_536, 65_536
"""Bytes that a peer may send for long, and at once [Hz, 1]."""

COMMANDS_HZ, COMMANDS_AT_ONCE = 20, 40
"""Commands that a console may give for long, and at once: each is recorded [Hz, 1]."""

MOST_PEERS = 1024
"""Peers remembered; beyond that those are forgotten that may send all they might anyway [1]."""

FULL_NS = 1_000_000_000
"""A peer that has sent nothing for this time may send as much at once as ever [ns]."""


class Allowance:
    """What each peer may still send.

    Parameters
    ----------
    hz, at_once : int
        Messages for long, and at once [Hz, 1].
    """

    def __init__(self, hz: int = MESSAGES_HZ, at_once: int = MESSAGES_AT_ONCE) -> None:
        self._hz, self._at_once = hz, at_once
        self._left: dict[bytes, tuple[int, float, float]] = {}

    def takes(self, peer: bytes, size: int, now_ns: int) -> bool:
        """Charge a message of this size [1] to its peer; False if that would be too much."""
        before_ns, messages, amount = self._left.get(peer, (now_ns, self._at_once, BYTES_AT_ONCE))
        elapsed = (now_ns - before_ns) * 1e-9
        messages = min(messages + elapsed * self._hz, self._at_once)
        amount = min(amount + elapsed * BYTES_HZ, BYTES_AT_ONCE)
        taken = messages >= 1 and amount >= size
        if taken:
            messages, amount = messages - 1, amount - size
        elif peer not in self._left:  # a message that no peer may send is no reason to remember one
            return False
        self._left[peer] = now_ns, messages, amount
        if len(self._left) > MOST_PEERS:
            self._forget(now_ns)
        return taken

    def _forget(self, now_ns: int) -> None:
        """Make room: peers whose allowance is whole again, else all of them."""
        kept = {peer: left for peer, left in self._left.items() if now_ns - left[0] < FULL_NS}
        self._left = kept if len(kept) <= MOST_PEERS else {}
