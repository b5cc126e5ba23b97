"""The server's end of a channel in memory, with the interface of `endpoints.Router`."""

from collections import deque

from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message

WELCOME = Welcome("session", PROTOCOL_VERSION, 0, "")


class FakeRouter:
    """What peers have sent waits in `arrived`; what they are sent piles up in `sent`, up to `room` frames for each."""

    channel = "fake"

    def __init__(self, room: int = 1000) -> None:
        self.arrived: deque[tuple[bytes, bytes]] = deque()
        self.sent: dict[bytes, list[bytes]] = {}
        self.room = room
        self.key = ""
        self.forbidden = ""
        self.closed = False
        self.owed: dict[bytes, bytes] = {}
        self.gone: set[bytes] = set()

    def receive(self) -> tuple[bytes, bytes] | None:
        return self.arrived.popleft() if self.arrived else None

    def send(self, peer: bytes, frame: bytes) -> bool:
        frames = self.sent.setdefault(peer, [])
        if len(frames) >= self.room or peer in self.gone:
            return False
        frames.append(frame)
        return True

    def send_or_queue(self, peer: bytes, frame: bytes) -> None:
        self.owed[peer] = frame
        self.send_queued()

    def send_queued(self) -> None:
        self.owed = {peer: frame for peer, frame in self.owed.items() if not self.send(peer, frame)}

    def cancel(self, peer: bytes) -> None:
        self.owed.pop(peer, None)

    def forbids(self, role: str, side: str) -> str:
        return self.forbidden

    def close_after_goodbye(self) -> None:
        self.closed = True

    def say(self, peer: bytes, message: Message | bytes) -> None:
        """Let a peer send something."""
        self.arrived.append((peer, message if isinstance(message, bytes) else encode(message)))

    def heard(self, peer: bytes) -> list[Message]:
        """Take everything a peer has been sent."""
        return [decode(frame) for frame in self.sent.pop(peer, [])]


def hello(role: str, side: str = "", name: str = "host:1") -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, name, "0", {})
