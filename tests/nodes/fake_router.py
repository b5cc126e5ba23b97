"""A ROUTER socket in memory, with the few methods the ports use."""

from collections import deque

import zmq

from netboard.wire.codec import decode, encode
from netboard.wire.messages import PROTOCOL_VERSION, Hello, Message, Welcome

WELCOME = Welcome("session", PROTOCOL_VERSION, 0, "")


class FakeRouter:
    """What peers have sent waits in `arrived`; what they are sent piles up in `sent`, up to `room` frames for each."""

    def __init__(self, room: int = 1000) -> None:
        self.arrived: deque[list[bytes]] = deque()
        self.sent: dict[bytes, list[bytes]] = {}
        self.room = room

    def recv_multipart(self, flags: int) -> list[bytes]:
        if not self.arrived:
            raise zmq.Again
        return self.arrived.popleft()

    def send_multipart(self, parts: tuple[bytes, bytes], flags: int) -> None:
        frames = self.sent.setdefault(parts[0], [])
        if len(frames) >= self.room:
            raise zmq.Again
        frames.append(parts[1])

    def say(self, peer: bytes, message: Message | bytes) -> None:
        """Let a peer send something."""
        self.arrived.append([peer, message if isinstance(message, bytes) else encode(message)])

    def heard(self, peer: bytes) -> list[Message]:
        """Take everything a peer has been sent."""
        return [decode(frame) for frame in self.sent.pop(peer, [])]


def hello(role: str, side: str = "", name: str = "host:1") -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, name, "0", {})
