"""The server's end of the control channel: displays that report their frames, and operators.

It only collects what they say; the server decides. A display's word goes no further than its own frames: it cannot
command. A station may have several displays, of which the one that came last tells what was shown.
"""

from collections.abc import Callable

from netboard import sockets
from netboard.errors import WireError
from netboard.nodes.refusals import Refusals
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    Command,
    FrameRecord,
    Frames,
    Goodbye,
    Hello,
    Message,
    Refusal,
    Status,
    StatusRequest,
    Welcome,
)
from netboard.wire.session import admit

ROLES = ("display", "console")
MOST_FRAMES = 16
"""Frames taken in one go [1]."""

MOST_PEERS = 32
"""Peers remembered: the oldest makes room for one more [1]."""


class ControlPort:
    """Who is on the control channel, what they wish and what they have shown.

    Parameters
    ----------
    socket : zmq.Socket
        ROUTER of the control channel.
    welcome : Welcome
        What a peer is told first.
    status : callable
        Makes the answer to a `StatusRequest`.
    """

    def __init__(self, socket: sockets.Socket, welcome: Welcome, status: Callable[[], Status]) -> None:
        self.wishes: list[str] = []
        self.news: list[tuple[str, dict[str, str]]] = []
        self.frames: list[FrameRecord] = []
        self._socket = socket
        self._welcome = encode(welcome)
        self._status = status
        self._peers: dict[bytes, Hello] = {}
        self._refusals = Refusals(socket, self.news)
        self._reporting: dict[str, bytes] = {}
        self._shown = {"left": 0, "right": 0}

    @property
    def peers(self) -> tuple[str, ...]:
        """Names of the displays and consoles that have said hello."""
        return tuple(sorted({f"{hello.role}.{hello.side}".rstrip(".") for hello in self._peers.values()}))

    def drain(self, now_ns: int) -> None:
        """Take what has arrived and answer it."""
        for _ in range(MOST_FRAMES):
            received = sockets.receive_from(self._socket)
            if received is None:
                return
            peer, frame = received
            try:
                answer = self._answer(peer, decode(frame))
            except WireError as error:
                answer = Refusal(str(error))
            if isinstance(answer, Refusal):
                self._refusals.refuse(peer, answer.reason, now_ns)
            elif answer is not None:
                sockets.send_to(self._socket, peer, answer if isinstance(answer, bytes) else encode(answer))

    def goodbye(self, reason: str) -> None:
        """Tell everybody that the session is over, and close."""
        for peer in self._peers:
            sockets.send_to(self._socket, peer, encode(Goodbye(reason)))
        sockets.close_after_goodbye(self._socket)

    def _answer(self, peer: bytes, message: Message) -> Message | bytes | None:
        hello = self._peers.get(peer)
        match message:
            case Hello():
                return self._greet(peer, message)
            case Goodbye():
                self._peers.pop(peer, None)
                return None
            case _ if hello is None:
                return Refusal("say hello first")
            case Frames() if hello.role == "display" and message.station == hello.side:
                if self._reporting[hello.side] == peer:
                    self._note(message)
                return None
            case StatusRequest() if hello.role == "console":
                return self._status()
            case Command(name=name) if hello.role == "console":
                self.wishes.append(name)
                return self._status()
        return Refusal(f"a {hello.role} may not send {type(message).__name__}")

    def _greet(self, peer: bytes, hello: Hello) -> Message | bytes:
        admit(hello)
        if hello.role not in ROLES:
            return Refusal(f"this is the control channel, not one for a {hello.role}")
        if peer not in self._peers:
            self.news.append((f"{hello.role}_joined", {"side": hello.side, "name": hello.name, **hello.details}))
        self._peers[peer] = hello
        self._reporting[hello.side] = peer
        if len(self._peers) > MOST_PEERS:
            del self._peers[next(iter(self._peers))]
        return self._welcome

    def _note(self, frames: Frames) -> None:
        for tick, received_ns, painted_ns in frames.shown:
            seq = self._shown[frames.station]
            self.frames.append(FrameRecord(seq, frames.station, tick, received_ns, painted_ns, frames.dropped))
            self._shown[frames.station] += 1
