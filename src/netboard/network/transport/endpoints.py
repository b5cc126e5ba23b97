"""The server's ends of the channels: frames of many peers, each known by its name and its key, and views for who looks.

They are made in `netboard.network.transport.sockets`, with the options that each channel needs; here is what is done
with them. Nothing here waits.
"""

import re

import zmq
from zmq import Again, ZMQError

from netboard.network.transport.authenticator import NOBLOCK, Door, Socket, readable
from netboard.network.transport.channels import CHANNELS, Endpoint

GOODBYE_LINGER_MS = 200
"""Last words on a channel that else lets nothing linger are given so long [ms]."""

SUBSCRIBED, UNSUBSCRIBED = b"\1", b"\0"
"""What an XPUB hears when the first one subscribes to everything, and when the last one leaves."""
MOST_SUBSCRIPTIONS = 16
"""Subscriptions heard in one go [1]."""
MOST_PARTS = 64
"""Parts of a message skipped in one go: it may have any number of them, and no message of netboard has two [1]."""
MOST_NAMES = 1000
"""Peers whose name has been found to go with their key, remembered [1]."""
NOBLOCK_MORE = int(zmq.NOBLOCK | zmq.SNDMORE)
"""A plain number, as `NOBLOCK`."""


NOBODY = b"", b""
"""In place of a peer and its frame: what came under a name that is not its sender's, which is refused already."""

_SECRET = re.compile(r"\.([0-9a-f]{4})[0-9a-f]{12}$")
MOST_LETTERS = 64
"""A name is shown up to this length [1]."""


def shown(peer: bytes) -> str:
    """How people tell a peer: its name, without most of what nobody may guess at the end of it."""
    name = _SECRET.sub(r".\1...", peer.decode(errors="replace"))
    return name if len(name) <= MOST_LETTERS else f"{name[:MOST_LETTERS]}..."


class Router:
    """A ROUTER: frames of many peers, each with the peer's name.

    With keys a peer must be named after what its key is for, such as ``agent.left@`` and something of its own.

    Attributes
    ----------
    key : str
        Key with which the sender of the last frame came in (Z85); empty without keys.
    """

    def __init__(self, socket: Socket, endpoint: Endpoint) -> None:
        self.key = ""
        self.channel = CHANNELS[endpoint.channel]
        self.socket = socket
        self._door = endpoint.lock if isinstance(endpoint.lock, Door) else None
        self._more = False
        self._names: dict[bytes, str] = {}
        self._owed: dict[bytes, bytes] = {}

    def receive(self) -> tuple[bytes, bytes] | None:
        """Next (peer, frame), or None if there is none now.

        What is not one frame is taken for an empty one, which no message is. What comes under a name that is not the
        sender's is `NOBODY`'s: whoever has that name has no part in it.
        """
        socket = self.socket
        if not readable(socket) or not self._skip_parts():  # quicker than an exception
            return None
        try:
            peer = socket.recv(NOBLOCK)
        except Again:
            return None
        frame = socket.recv(NOBLOCK, copy=False)
        self._more = frame.more
        said = b"" if frame.more else frame.bytes
        if self._door is None:
            return peer, said
        return self.checked(peer, _property(frame, "User-Id"), _property(frame, "Peer-Address"), said)

    def _skip_parts(self) -> bool:
        """Skip what is left of a message in several parts, a bounded number of them; whether nothing is left of it."""
        for _ in range(MOST_PARTS):
            if not self._more:
                break
            self.socket.recv(NOBLOCK)
            self._more = bool(self.socket.getsockopt(zmq.RCVMORE))
        return not self._more and readable(self.socket)

    def checked(self, peer: bytes, key: str, address: str, frame: bytes) -> tuple[bytes, bytes]:
        """(peer, frame) of what has just come in, as `receive` has it."""
        self.key = key
        return (peer, frame) if self._door is None or self._rightly_named(self._door, peer, key, address) else NOBODY

    def send(self, peer: bytes, frame: bytes) -> bool:
        """Send without waiting; False if the peer is gone or its queue is full."""
        try:
            self.socket.send(peer, NOBLOCK_MORE)  # refused here or not at all
            self.socket.send(frame, NOBLOCK)
        except ZMQError as error:
            if error.errno in (zmq.EAGAIN, zmq.EHOSTUNREACH):
                if error.errno == zmq.EHOSTUNREACH:
                    self._owed.pop(peer, None)
                return False
            raise
        return True

    def owe(self, peer: bytes, frame: bytes) -> None:
        """Send what a peer that is there must hear: if its queue is full now, whenever `pay` finds that it is not."""
        self._owed[peer] = frame
        self.pay()

    def pay(self) -> None:
        """Send whatever is still owed."""
        for peer, frame in list(self._owed.items()):
            if self.send(peer, frame):
                del self._owed[peer]

    @property
    def keyed(self) -> bool:
        """Whether peers come in by keys."""
        return self._door is not None

    def forbids(self, role: str, side: str) -> str:
        """Why the sender of the last frame may not speak as this; empty if it may, as everybody may without keys."""
        return "" if self._door is None else self._door.ring.forbids(self.key, role, side)

    def close_after_goodbye(self) -> None:
        """Close when the last words, which have just been sent, are gone."""
        self.socket.close(linger=GOODBYE_LINGER_MS)

    def _rightly_named(self, door: Door, peer: bytes, key: str, address: str) -> bool:
        """Whether a name goes with the key: it is looked up once."""
        if self._names.get(peer) == key:
            return True
        if peer.partition(b"@")[0] != door.ring.owner(key).encode():
            door.refuse(self.channel, address, key, f"it calls itself {shown(peer)}")
            return False
        if len(self._names) >= MOST_NAMES:
            self._names.clear()
        self._names[peer] = key
        return True


def _property(frame: zmq.Frame, name: str) -> str:
    """What libzmq knows of where a frame came from; empty if it does not, as of addresses in the file system."""
    try:
        return str(frame.get(name))
    except ZMQError:
        return ""


class Publisher:
    """The server's end of a view channel: knows whether anybody looks."""

    def __init__(self, socket: Socket) -> None:
        self.socket = socket
        self._wanted = False

    def wanted(self) -> bool:
        """Whether anybody has subscribed."""
        for _ in range(MOST_SUBSCRIPTIONS):
            if not readable(self.socket):
                break
            word = self.socket.recv(NOBLOCK)
            if word in (SUBSCRIBED, UNSUBSCRIBED):
                self._wanted = word == SUBSCRIBED
        return self._wanted

    def send(self, frame: bytes) -> bool:
        """Send to all who have subscribed and keep up, without waiting; False if nobody has."""
        if not self.wanted():
            return False
        self.socket.send(frame, NOBLOCK)
        return True

    def close(self) -> None:
        """Close at once."""
        self.socket.close()
