"""The server's endpoints: a router for frames of many peers, each known by name and key, and a publisher of views.

`netboard.network.transport.sockets` makes them, with the options that each channel needs. Nothing here waits.
"""

import re

import zmq
from zmq import Again, ZMQError

from netboard.network.transport.authenticator import NOBLOCK, Authenticator, Socket, readable
from netboard.network.transport.channels import NAMES, Endpoint

GOODBYE_LINGER_MS = 200
"""Linger for the last messages on a channel that otherwise does not linger [ms]."""

SUBSCRIBED, UNSUBSCRIBED = b"\1", b"\0"
"""What an XPUB receives when the first subscriber subscribes to everything, and when the last one leaves."""
MAX_SUBSCRIPTIONS = 16
"""Subscriptions read at once [1]."""
MAX_PARTS = 64
"""Parts of a message skipped at once; a peer may send any number, although netboard's messages have one [1]."""
MAX_NAMES = 1000
"""Peers whose name is known to match their key [1]."""
NOBLOCK_MORE = int(zmq.NOBLOCK | zmq.SNDMORE)
"""A plain number, as `NOBLOCK`."""

REFUSED = b"", b""
"""Result in place of a peer and its frame, if the peer's name does not match its key."""

MAX_CHARACTERS = 64
"""Characters of a peer's name or version that operators see, so that the links of all peers fit a status [1]."""

_RANDOM_PART = re.compile(r"\.([0-9a-f]{4})[0-9a-f]{12}$")


def shown(peer: bytes) -> str:
    """Return a peer's name for people, without most of the random part, with which others could take the name over."""
    name = _RANDOM_PART.sub(r".\1...", peer.decode(errors="replace"))
    return name if len(name) <= MAX_CHARACTERS else f"{name[:MAX_CHARACTERS]}..."


class Router:
    """A ROUTER: frames of many peers, each with the peer's name.

    With keys a peer's name must begin with the role and side of its key, as in ``agent.left@``.
    """

    def __init__(self, socket: Socket, endpoint: Endpoint) -> None:
        self.key = ""  # key of the last frame's sender (Z85); empty without keys
        self.channel = NAMES[endpoint.channel]
        self.socket = socket
        self._authenticator = endpoint.security if isinstance(endpoint.security, Authenticator) else None
        self._more = False
        self._names: dict[bytes, str] = {}
        self._queued: dict[bytes, bytes] = {}

    def receive(self) -> tuple[bytes, bytes] | None:
        """Return the next (peer, frame), or None if there is none now.

        A message of several parts counts as an empty frame, which is no valid message. The result is `REFUSED` if a
        sender uses the name of another peer, so that the owner of that name is not affected.
        """
        socket = self.socket
        if not readable(socket) or not self._skip_parts():  # cheaper than an exception
            return None
        try:
            peer = socket.recv(NOBLOCK)
        except Again:
            return None
        frame = socket.recv(NOBLOCK, copy=False)
        self._more = frame.more
        content = b"" if frame.more else frame.bytes
        if self._authenticator is None:
            return peer, content
        return self.checked(peer, _property(frame, "User-Id"), _property(frame, "Peer-Address"), content)

    def _skip_parts(self) -> bool:
        """Skip the rest of a multipart message, a bounded number of parts; return whether a new message can be read."""
        for _ in range(MAX_PARTS):
            if not self._more:
                break
            self.socket.recv(NOBLOCK)
            self._more = bool(self.socket.getsockopt(zmq.RCVMORE))
        return not self._more and readable(self.socket)

    def checked(self, peer: bytes, key: str, address: str, frame: bytes) -> tuple[bytes, bytes]:
        """Return (peer, frame), or `REFUSED` if the peer's name does not match its key."""
        self.key = key
        keys = self._authenticator
        return (peer, frame) if keys is None or self._name_matches(keys, peer, key, address) else REFUSED

    def send(self, peer: bytes, frame: bytes) -> bool:
        """Send without waiting; return False if the peer is gone or its queue is full."""
        try:
            self.socket.send(peer, NOBLOCK_MORE)  # refused here or not at all
            self.socket.send(frame, NOBLOCK)
        except ZMQError as error:
            if error.errno in (zmq.EAGAIN, zmq.EHOSTUNREACH):
                if error.errno == zmq.EHOSTUNREACH:
                    self._queued.pop(peer, None)
                return False
            raise
        return True

    def send_or_queue(self, peer: bytes, frame: bytes) -> None:
        """Send a frame that a connected peer must get: if its queue is full, `send_queued` sends it later."""
        self._queued[peer] = frame
        if self.send(peer, frame):
            del self._queued[peer]

    def send_queued(self) -> None:
        """Send the frames that could not be sent before."""
        for peer, frame in list(self._queued.items()):
            if self.send(peer, frame):
                del self._queued[peer]

    def drop_queued(self, peer: bytes) -> None:
        """Send a peer nothing more.

        The queue of a peer that has left may stay full; `send_queued` would then try all peers that there ever were.
        """
        self._queued.pop(peer, None)

    @property
    def keyed(self) -> bool:
        """Whether peers are authenticated by keys."""
        return self._authenticator is not None

    def role_refusal(self, role: str, side: str) -> str:
        """Return why the last frame's sender may not act in this role and side; empty if it may, or without keys."""
        return "" if self._authenticator is None else self._authenticator.ring.role_refusal(self.key, role, side)

    def close_after_goodbye(self) -> None:
        """Close after the last messages have been sent."""
        self.socket.close(linger=GOODBYE_LINGER_MS)

    def _name_matches(self, authenticator: Authenticator, peer: bytes, key: str, address: str) -> bool:
        """Return whether a peer's name matches its key; a match is remembered."""
        if self._names.get(peer) == key:
            return True
        if peer.partition(b"@")[0] != authenticator.ring.owner(key).encode():
            authenticator.refuse(self.channel, address, key, f"it calls itself {shown(peer)}")
            return False
        if len(self._names) >= MAX_NAMES:
            self._names.clear()
        self._names[peer] = key
        return True


def _property(frame: zmq.Frame, name: str) -> str:
    """Return a property of a frame's connection; empty if libzmq has none, as for Unix domain sockets."""
    try:
        return str(frame.get(name))
    except ZMQError:
        return ""


class Publisher:
    """The server's endpoint of a view channel, which knows whether anybody subscribes."""

    def __init__(self, socket: Socket) -> None:
        self.socket = socket
        self._wanted = False

    def wanted(self) -> bool:
        """Return whether anybody has subscribed."""
        for _ in range(MAX_SUBSCRIPTIONS):
            if not readable(self.socket):
                break
            change = self.socket.recv(NOBLOCK)
            if change in (SUBSCRIBED, UNSUBSCRIBED):
                self._wanted = change == SUBSCRIBED
        return self._wanted

    def send(self, frame: bytes) -> None:
        """Send to all subscribers that keep up, without waiting."""
        self.socket.send(frame, NOBLOCK)

    def close(self) -> None:
        """Close at once."""
        self.socket.close()
