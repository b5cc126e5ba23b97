"""The server's end of a channel in memory, with the interface of `endpoints.Router`."""

from collections import deque

from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.nodes.ports.welcomes import RECEIVERS

WELCOME = Welcome("session", PROTOCOL_VERSION, 0, "")
WELCOMES = dict.fromkeys(RECEIVERS, WELCOME)


class FakeRouter:
    """Messages of peers wait in `incoming`; frames to each peer are stored in `sent`, at most `room` of them."""

    channel = "fake"

    def __init__(self, room: int = 1000) -> None:
        self.incoming: deque[tuple[bytes, bytes]] = deque()
        self.sent: dict[bytes, list[bytes]] = {}
        self.room = room
        self.key = ""
        self.forbidden = ""
        self.closed = False
        self.queued: dict[bytes, bytes] = {}
        self.disconnected: set[bytes] = set()

    def receive(self) -> tuple[bytes, bytes] | None:
        return self.incoming.popleft() if self.incoming else None

    def send(self, peer: bytes, frame: bytes) -> bool:
        frames = self.sent.setdefault(peer, [])
        if len(frames) >= self.room or peer in self.disconnected:
            return False
        frames.append(frame)
        return True

    def send_or_queue(self, peer: bytes, frame: bytes) -> None:
        self.queued[peer] = frame
        self.send_queued()

    def send_queued(self) -> None:
        self.queued = {peer: frame for peer, frame in self.queued.items() if not self.send(peer, frame)}

    def drop_queued(self, peer: bytes) -> None:
        self.queued.pop(peer, None)

    def role_refusal(self, role: str, side: str) -> str:
        return self.forbidden

    def close_after_goodbye(self) -> None:
        self.closed = True

    def send_from(self, peer: bytes, message: Message | bytes) -> None:
        """Queue a message of a peer."""
        self.incoming.append((peer, message if isinstance(message, bytes) else encode(message)))

    def received_by(self, peer: bytes) -> list[Message]:
        """Return and clear the messages sent to a peer."""
        return [decode(frame) for frame in self.sent.pop(peer, [])]


def hello(role: str, side: str = "", name: str = "host:1") -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, name, "0", {})
