"""The server's end of the control channel: displays that report their frames, and operators.

It only collects what they say; the server decides. A display's word goes no further than its own frames: it cannot
command.
"""

from collections.abc import Callable

from netboard import sockets
from netboard.errors import WireError
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
        self._shown = {"left": 0, "right": 0}

    @property
    def peers(self) -> tuple[str, ...]:
        """Names of the displays and consoles that have said hello."""
        return tuple(sorted(f"{hello.role}.{hello.side}".rstrip(".") for hello in self._peers.values()))

    def drain(self) -> None:
        """Take everything that has arrived and answer it."""
        while (received := sockets.receive_from(self._socket)) is not None:
            peer, frame = received
            try:
                answer = self._answer(peer, decode(frame))
            except WireError as error:
                answer = Refusal(str(error))
            if isinstance(answer, Refusal):
                self.news.append(("refused", {"peer": peer.decode(errors="replace"), "reason": answer.reason}))
            if answer is not None:
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
            self._replace(hello)
            self.news.append((f"{hello.role}_joined", {"side": hello.side, "name": hello.name, **hello.details}))
        self._peers[peer] = hello
        return self._welcome

    def _replace(self, hello: Hello) -> None:
        """A station has one display: one that comes takes the place of one that has gone without a word."""
        for peer, other in list(self._peers.items()):
            if hello.role == "display" and (other.role, other.side) == (hello.role, hello.side):
                del self._peers[peer]

    def _note(self, frames: Frames) -> None:
        for tick, received_ns, painted_ns in frames.shown:
            seq = self._shown[frames.station]
            self.frames.append(FrameRecord(seq, frames.station, tick, received_ns, painted_ns, frames.dropped))
            self._shown[frames.station] += 1
