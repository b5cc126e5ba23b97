"""The server's end of the control channel: displays that report their frames, and operators.

It only collects what they say, and answers what they ask; the server decides. A display's word goes no further than its
own frames: it cannot command. A station may have several displays, of which the one that came last tells what was
shown.
"""

from typing import NamedTuple, Protocol

from netboard import ends
from netboard.errors import WireError
from netboard.nodes.peer import Link, Peer, Probes, what
from netboard.nodes.refusals import Refusals
from netboard.wire.codec import decode, encode
from netboard.wire.control import Command, Outcomes, OutcomesRequest, Reply, Status, StatusRequest, Trace, TraceRequest
from netboard.wire.meeting import Goodbye, Hello, Pong, Refusal, Welcome
from netboard.wire.messages import Message
from netboard.wire.records import ClockRecord, FrameRecord
from netboard.wire.session import admit
from netboard.wire.views import Frames

ROLES = ("display", "console")
MOST_FRAMES = 16
"""Frames taken in one go [1]."""

MOST_PEERS = 32
"""Peers remembered: the oldest makes room for one more [1]."""

SILENT_NS = 3_000_000_000
"""A peer that has said nothing for so long is not there; it is welcome back without another hello [ns]."""


class Answers(Protocol):
    """Who knows what operators ask for."""

    def status(self) -> Status:
        """How the session is."""

    def outcomes(self, first: int) -> Outcomes:
        """What has become of the attempts from this one on."""

    def trace(self, after: int) -> Trace:
        """What has happened after this tick."""


class Wish(NamedTuple):
    """A command, and who gave it.

    Attributes
    ----------
    who : bytes
        By which the sender is answered.
    name : str
        By which people know the sender.
    command : Command
        What is wished.
    """

    who: bytes
    name: str
    command: Command


class ControlPort:
    """Who is on the control channel, what they wish and what they have shown.

    Parameters
    ----------
    router : ends.Router
        Server end of the control channel.
    welcome : Welcome
        What a peer is told first.
    answers : Answers
        Who is asked for what operators want to know.
    """

    def __init__(self, router: ends.Router, welcome: Welcome, answers: Answers) -> None:
        self.wishes: list[Wish] = []
        self.news: list[tuple[str, dict[str, str]]] = []
        self.frames: list[FrameRecord] = []
        self._router = router
        self._welcome = encode(welcome)
        self._answers = answers
        self._peers: dict[bytes, Peer] = {}
        self._silent: set[bytes] = set()
        self._refusals = Refusals(router, self.news)
        self._probes = Probes()
        self._reporting: dict[str, bytes] = {}
        self._shown = {"left": 0, "right": 0}

    @property
    def peers(self) -> tuple[str, ...]:
        """What the displays and consoles are that have said hello, and can still be heard."""
        return tuple(sorted({what(peer.hello) for name, peer in self._peers.items() if name not in self._silent}))

    def drain(self, now_ns: int) -> bool:
        """Take what has arrived and answer it; whether there may be more."""
        for _ in range(MOST_FRAMES):
            received = self._router.receive()
            if received is None:
                return False
            self._take(*received, now_ns)
        return True

    def pump(self, now_ns: int) -> None:
        """Ask the peers for their time, note who has fallen silent, and send what is owed."""
        self._router.pay()
        for name, peer in self._peers.items():
            ping = peer.ping(now_ns)
            if ping is None:
                continue
            self._router.send(name, encode(ping))
            if name not in self._silent and peer.age_ns(now_ns) > SILENT_NS:
                self._silent.add(name)
                self._tell("silent", peer.hello)

    def links(self, now_ns: int) -> list[Link]:
        """Tell how the peers are connected."""
        return [peer.link(now_ns) for name, peer in self._peers.items() if name not in self._silent]

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """The newest raw probe of each peer with the estimate so far, numbered from `seq`."""
        return self._probes.records(self._peers.values(), seq)

    def renew(self, welcome: Welcome) -> None:
        """Another block: tell everybody what counts now."""
        self._welcome = encode(welcome)
        for name in self._peers:
            self._router.owe(name, self._welcome)

    def reply(self, wish: Wish, accepted: bool, reason: str) -> None:
        """Tell whoever gave a command what becomes of it."""
        self._router.send(wish.who, encode(Reply(wish.command.number, accepted, reason)))

    def is_there(self, who: bytes) -> bool:
        """Whether a peer can still be heard."""
        return who in self._peers and who not in self._silent

    def goodbye(self, reason: str) -> None:
        """Tell everybody that the session is over."""
        for name in self._peers:
            self._router.send(name, encode(Goodbye(reason)))

    def close(self) -> None:
        """Close, some time after the goodbye: what a peer has not read by then is lost."""
        self._router.close_after_goodbye()

    def _take(self, name: bytes, frame: bytes, now_ns: int) -> None:
        peer = self._peers.get(name)
        if peer is not None:
            peer.hear(now_ns)
            if name in self._silent:
                self._silent.discard(name)
                self._tell("back", peer.hello)
        try:
            answer = self._answer(name, peer, decode(frame), now_ns)
        except WireError as error:
            answer = Refusal(str(error))
        if isinstance(answer, Refusal):
            self._refusals.refuse(name, answer.reason, now_ns)
        elif answer is not None:
            self._router.send(name, answer if isinstance(answer, bytes) else encode(answer))

    def _answer(self, name: bytes, peer: Peer | None, message: Message, now_ns: int) -> Message | bytes | None:
        role = "" if peer is None else peer.hello.role
        match message:
            case Hello():
                return self._greet(name, message, now_ns)
            case Goodbye():
                self._forget(name)
            case _ if peer is None:
                return Refusal("say hello first")
            case Pong():
                peer.answered(message, now_ns)
            case Frames(station=station) if role == "display" and station == peer.hello.side:
                if self._reporting[station] == name:
                    self._note(message)
            case Command() if role == "console":
                self.wishes.append(Wish(name, peer.hello.name, message))
            case _ if role == "console" and (answer := self._ask(message)) is not None:
                return answer
            case _:
                return Refusal(f"a {role} may not send {type(message).__name__}")
        return None

    def _ask(self, message: Message) -> Message | None:
        """Let whoever knows answer an operator; None if it is no question."""
        match message:
            case StatusRequest():
                return self._answers.status()
            case OutcomesRequest(first=first):
                return self._answers.outcomes(first)
            case TraceRequest(after=after):
                return self._answers.trace(after)
        return None

    def _greet(self, name: bytes, hello: Hello, now_ns: int) -> Message | bytes:
        admit(hello)
        if hello.role not in ROLES:
            return Refusal(f"this is the control channel, not one for a {hello.role}")
        if reason := self._router.forbids(hello.role, hello.side):
            return Refusal(reason)
        if name not in self._peers:
            self._tell("joined", hello)
            self._peers[name] = Peer(hello, now_ns)
        self._reporting[hello.side] = name
        if len(self._peers) > MOST_PEERS:
            self._forget(next(iter(self._peers)))
        return self._welcome

    def _forget(self, name: bytes) -> None:
        peer = self._peers.pop(name, None)
        if peer is not None:
            self._silent.discard(name)
            self._tell("left", peer.hello)

    def _tell(self, happened: str, hello: Hello) -> None:
        self.news.append((f"{hello.role}_{happened}", {"side": hello.side, "name": hello.name, **hello.details}))

    def _note(self, frames: Frames) -> None:
        for tick, received_ns, painted_ns in frames.shown:
            seq = self._shown[frames.station]
            self.frames.append(FrameRecord(seq, frames.station, tick, received_ns, painted_ns, frames.dropped))
            self._shown[frames.station] += 1
