"""The server's endpoint of the control channel: displays that report their painted frames, operators, trigger boxes.

It collects messages and answers questions; the server decides. A display may only report its own frames: it cannot
command. A station may have several displays; of those present, the one that joined last reports what was shown.

No peer can hold up a tick. A few messages are taken at a time, and the rate of each peer is limited
(`netboard.nodes.ports.rate_limit`). Messages that a peer may not send are not decoded. Longer work (a report of frames,
an answer to an operator) is done in pieces between ticks, when the session asks for the next piece.
"""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from netboard.base.config import SIDES, Side
from netboard.base.errors import WireError
from netboard.network.protocol.codec import decode, encode, kind_of
from netboard.network.protocol.control import (
    Command,
    LinkStatus,
    Outcomes,
    OutcomesRequest,
    Reply,
    Status,
    StatusRequest,
    Trace,
    TraceRequest,
)
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Ping, Pong, Welcome, role_and_side
from netboard.network.protocol.messages import Message, sent_by
from netboard.network.protocol.records import ClockRecord, FrameRecord
from netboard.network.protocol.triggers import BoxState, InputPulse, PulseReport
from netboard.network.protocol.views import MAX_SHOWN, Frames, QuestionnaireAnswers
from netboard.network.transport import endpoints
from netboard.nodes.ports import emergency
from netboard.nodes.ports.peer import SILENCE_TIMEOUT_NS, ProbedPeer, Probes, admit
from netboard.nodes.ports.peer_events import News, PeerEvents
from netboard.nodes.ports.rate_limit import COMMANDS_AT_ONCE, COMMANDS_HZ, RateLimit
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES, Refusals
from netboard.nodes.ports.trigger_peers import TRIGGER_ROLE, TriggerPeers

ROLES = ("display", "console", TRIGGER_ROLE)
ALLOWED_MESSAGES: dict[str, frozenset[type[Message]]] = {
    "": frozenset((Hello, Goodbye)),
    **{role: sent_by(role) for role in ROLES},
}
"""Messages that a peer of each role may send ("" is an unregistered peer); others are refused without decoding."""

MAX_FRAMES, MAX_BYTES = 4, 2048
"""Frames and bytes after which `drain` stops; at worst this takes a tenth of a tick [1, 1]."""

MAX_PEERS = 16
"""Peers of each role; a silent one makes room for a new one [1]."""

CONNECTION_CHECK_NS = 20_000_000
"""Shortest interval between two checks whether all peers are still connected [ns]."""

MAX_REQUESTS = 8
"""Commands of one peer that may wait for a decision [1]."""

MAX_REASON = 1000
"""Characters of a reply's reason, which fit its frame in any script [1]."""

MAX_ANSWERS = 4
"""Answered forms that may wait to be recorded [1]."""

MAX_REPORTS = 16
"""Reports of one station that may wait to be recorded [1]."""


class Answers(Protocol):
    """Source of the answers to operators' questions."""

    def status(self) -> Status:
        """Return the status of the session."""

    def outcomes(self, first: int) -> Outcomes:
        """Return the outcomes of the attempts, starting with attempt number `first`."""

    def trace(self, after: int) -> Trace:
        """Return what has happened after this tick."""


_ANSWERS: dict[type[Message], Callable[[Any, Answers], Message]] = {
    StatusRequest: lambda question, answers: answers.status(),
    OutcomesRequest: lambda question, answers: answers.outcomes(question.first),
    TraceRequest: lambda question, answers: answers.trace(question.after),
}
"""Answer to each question of an operator."""


class CommandRequest(NamedTuple):
    """A command, and the peer that sent it; `late` if it may be from before an interruption of the connection."""

    who: bytes
    name: str
    command: Command
    late: bool = False


class ControlPort:
    """Peers on the control channel, their commands and their reports of painted frames.

    ``welcomes``: for each of `netboard.nodes.ports.welcomes.RECEIVERS`, because they get different configurations.
    """

    def __init__(self, router: endpoints.Router, welcomes: Mapping[str, Welcome]) -> None:
        self.requests: list[CommandRequest] = []
        self.answers: deque[QuestionnaireAnswers] = deque()
        self.news: News = []
        self.refusals = Refusals(router, self.news)
        self.triggers = TriggerPeers(router)
        self._router = router
        self._welcomes = {receiver: encode(welcome) for receiver, welcome in welcomes.items()}
        self._peers: dict[bytes, ProbedPeer] = {}
        self._silent: set[bytes] = set()
        self._rate_limit, self._command_limit = RateLimit(), RateLimit(COMMANDS_HZ, COMMANDS_AT_ONCE)
        self._peer_events = PeerEvents(self.news)
        self._questions: dict[tuple[bytes, type[Message]], Message] = {}
        self._reports: deque[tuple[str, deque[tuple[int, int, int]], int]] = deque()
        self._probes = Probes()
        self._checked_ns = -CONNECTION_CHECK_NS
        self._shown = {"left": 0, "right": 0}

    @property
    def empty(self) -> bool:
        """Whether no peer is connected, or all have been silent."""
        return len(self._peers) == len(self._silent)

    @property
    def peers(self) -> tuple[str, ...]:
        """Role and side of the displays and consoles that are connected and not silent."""
        hellos = [peer.hello for name, peer in self._peers.items() if name not in self._silent]
        return tuple(sorted({role_and_side(hello.role, hello.side) for hello in hellos}))

    @property
    def displays(self) -> list[Hello]:
        """How the displays introduced themselves that are connected and not silent; the newest of a station last."""
        return [peer.hello for name, peer in self._peers.items() if peer.hello.side and name not in self._silent]

    @property
    def platforms(self) -> dict[Side, str]:
        """Qt's platform that draws each station's newest display, which reports the painted frames."""
        found = {hello.side: hello.details.get("platform", "") for hello in self.displays}
        return {side: found[side] for side in SIDES if side in found}

    def drain(self, clock: Callable[[], int]) -> bool:
        """Take and handle what has arrived; return whether there may be more.

        The clock is read after each frame: a stamp from before its arrival would tighten the bound of a clock offset
        beyond the truth.
        """
        frames = size = 0
        while frames < MAX_FRAMES and size < MAX_BYTES:
            received = self._router.receive()
            if received is None:
                return False
            if received != endpoints.REFUSED and self._take(*received, clock()):
                size += len(received[1])
            frames += 1
        return True

    def answer(self, answers: Answers) -> None:
        """Answer the oldest open question, if any; only one, because an answer takes as long as several messages."""
        if self._questions:
            who, kind = next(iter(self._questions))
            question = self._questions.pop((who, kind))
            self._router.send(who, encode(_ANSWERS[kind](question, answers)))

    def take_frames(self, most: int | None = None) -> list[FrameRecord]:
        """Take records of painted frames, at most this many [1]."""
        records: list[FrameRecord] = []
        while self._reports and (most is None or len(records) < most):
            station, shown, dropped = self._reports[0]
            while shown and (most is None or len(records) < most):
                records.append(FrameRecord(self._shown[station], station, *shown.popleft(), dropped))
                self._shown[station] += 1
            if not shown:
                self._reports.popleft()
        return records

    def pump(self, now_ns: int) -> None:
        """Ping the peers, note which have fallen silent, and send messages that could not be sent before."""
        self._router.send_queued()
        self.refusals.poll(now_ns)
        for name, peer in self._peers.items():
            self._ping(name, peer, now_ns)
            if name not in self._silent and peer.age_ns(now_ns) > SILENCE_TIMEOUT_NS:
                self._silent.add(name)
                self._find_triggers()
                self._add_event("silent", peer.hello, now_ns)

    def links(self, now_ns: int) -> list[LinkStatus]:
        """Return the connections of the peers."""
        return [peer.link(now_ns) for name, peer in self._peers.items() if name not in self._silent]

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each peer with the current estimate, numbered from `seq`."""
        return self._probes.records(self._peers.values(), seq)

    def renew(self, welcomes: Mapping[str, Welcome]) -> None:
        """Send the welcomes of a new block to all peers."""
        self._welcomes = {receiver: encode(welcome) for receiver, welcome in welcomes.items()}
        for name, peer in self._peers.items():
            self._router.send_or_queue(name, self._welcome_of(peer.hello))

    def _welcome_of(self, hello: Hello) -> bytes:
        """Return the welcome for a peer."""
        return self._welcomes[role_and_side(hello.role, hello.side)]

    def reply(self, request: CommandRequest, accepted: bool, reason: str) -> None:
        """Reply to the peer that sent a command; a reason that quotes a long argument is cut."""
        self._router.send(request.who, encode(Reply(request.command.number, accepted, reason[:MAX_REASON])))

    def is_present(self, name: bytes) -> bool:
        """Return whether a peer is connected and not silent."""
        return name in self._peers and name not in self._silent

    def goodbye(self, reason: str) -> None:
        """Tell all peers that the session is over."""
        for name in self._peers:
            self._router.send(name, encode(Goodbye(reason)))

    def close(self) -> None:
        """Close some time after the goodbye; messages that a peer has not read by then are lost."""
        self._router.close_after_goodbye()

    def _ping(self, name: bytes, peer: ProbedPeer, now_ns: int) -> None:
        if ping := peer.ping(now_ns):
            self._router.send(name, encode(ping))

    def _take(self, name: bytes, frame: bytes, now_ns: int) -> bool:
        """Handle a message; return False if its peer sends too much and the message was dropped unread."""
        if not self._rate_limit.allows(name, len(frame), now_ns):
            self.refusals.refuse(name, TOO_MANY_MESSAGES, now_ns)
            return False
        peer = self._peers.get(name)
        if peer is not None:
            peer.note_message(now_ns)
            if peer.may_be_late:
                self._ping(name, peer, now_ns)
            if name in self._silent:
                self._silent.discard(name)
                self._find_triggers()
                self._add_event("back", peer.hello, now_ns)
        try:
            self._handle(name, peer, frame, now_ns)
        except WireError as error:
            self.refusals.refuse(name, str(error), now_ns)
        return True

    def _handle(self, name: bytes, peer: ProbedPeer | None, frame: bytes, now_ns: int) -> None:
        role, kind = "" if peer is None else peer.hello.role, kind_of(frame)
        if kind not in ALLOWED_MESSAGES[role]:
            raise WireError(f"a {role} may not send {kind.__name__}" if role else HELLO_FIRST)
        match decode(frame):
            case Hello() as hello:
                self._greet(name, hello, now_ns)
            case Goodbye():
                self._forget(name, now_ns)
            case _ if peer is None:
                raise WireError(HELLO_FIRST)
            case Pong() as pong:
                peer.answered(pong, now_ns)
            case PulseReport() | InputPulse() | BoxState() as report:
                self.triggers.take(name, peer, report)
            case Frames() as frames:
                self._queue_report(name, peer.hello.side, frames)
            case QuestionnaireAnswers() as answers:
                self._queue_answers(peer.hello.side, answers)
            case Command() as command:
                self._queue(CommandRequest(name, peer.hello.name, command, peer.may_be_late), now_ns)
            case question if kind in _ANSWERS:
                self._questions.setdefault((name, kind), question)
            case _:
                raise WireError(f"the server has no answer to {kind.__name__}")

    def _queue(self, request: CommandRequest, now_ns: int) -> None:
        """Queue a command; the emergency stops go first, one of each peer."""
        waiting = sum(other.who == request.who for other in self.requests)
        if request.command.name == emergency.STOP:
            stops = [other.who for other in self.requests if other.command.name == emergency.STOP]
            if request.who not in stops:
                self.requests.insert(len(stops), request)
            else:
                self.reply(request, True, "")
        elif waiting >= MAX_REQUESTS or not self._command_limit.allows(request.who, 0, now_ns):
            self.reply(request, False, "too many commands at once")
            self.refusals.note(endpoints.shown(request.who), "too many commands at once", now_ns)
        else:
            self.requests.append(request)

    def _greet(self, name: bytes, hello: Hello, now_ns: int) -> None:
        admit(hello, self._router, ROLES)
        peer = self._peers.pop(name, None)  # so that it comes last again: the newest display reports for its station
        if peer is None:
            self._make_room(hello.role, now_ns)
            self._add_event("joined", hello, now_ns)
        self._peers[name] = peer = peer or ProbedPeer(hello, now_ns)
        self._find_triggers()
        self._router.send_or_queue(name, self._welcome_of(hello))
        self._ping(name, peer, now_ns)  # its answer precedes any command, so that a late command is known as such

    def _make_room(self, role: str, now_ns: int) -> None:
        """If a role has too many peers, forget a silent one, or else all that have disconnected."""
        same = [name for name, peer in self._peers.items() if peer.hello.role == role]
        if len(same) < MAX_PEERS:
            return
        gone = [name for name in same if name in self._silent][:1]
        if not gone and now_ns - self._checked_ns >= CONNECTION_CHECK_NS:
            self._checked_ns, ping = now_ns, encode(Ping(now_ns))
            gone = [name for name in same if not self._router.send(name, ping)]
        if not gone:
            raise WireError(f"there are {MAX_PEERS} peers like it already")
        for name in gone:
            self._forget(name, now_ns)

    def _forget(self, name: bytes, now_ns: int) -> None:
        peer = self._peers.pop(name, None)
        if peer is not None:
            self._router.drop_queued(name)
            self._silent.discard(name)
            self._find_triggers()
            for kind in _ANSWERS:
                self._questions.pop((name, kind), None)
            self._add_event("left", peer.hello, now_ns)

    def _find_triggers(self) -> None:
        """List the trigger boxes that are connected and not silent."""
        of_role = (name for name, peer in self._peers.items() if peer.hello.role == TRIGGER_ROLE)
        self.triggers.present = [name for name in of_role if name not in self._silent]

    def _add_event(self, what: str, hello: Hello, now_ns: int) -> None:
        details = {"side": hello.side, "name": hello.name}
        self._peer_events.add_with_details(hello, f"{hello.role}_{what}", details, now_ns)

    def _reporter(self, side: str) -> bytes | None:
        """Return the display of a station that joined last, of those that are not silent."""
        newest_first = reversed(self._peers.items())
        return next((name for name, peer in newest_first if peer.hello.side == side and name not in self._silent), None)

    def _queue_answers(self, side: str, answers: QuestionnaireAnswers) -> None:
        """Queue a participant's answers to a form."""
        if answers.station != side:
            raise WireError(f"the {side} display may not answer for the {answers.station} station")
        if len(self.answers) >= MAX_ANSWERS:
            raise WireError(f"{TOO_MANY_MESSAGES}: {MAX_ANSWERS} forms wait already")
        self.answers.append(answers)

    def _queue_report(self, name: bytes, side: str, frames: Frames) -> None:
        """Queue a display's report of painted frames."""
        if frames.station != side:
            raise WireError(f"the {side} display may not report for the {frames.station} station")
        if name != self._reporter(side):
            return
        if sum(station == side for station, _, _ in self._reports) >= MAX_REPORTS:
            raise WireError(f"{TOO_MANY_MESSAGES}: {MAX_REPORTS} reports of up to {MAX_SHOWN} frames wait already")
        if frames.shown:
            self._reports.append((side, deque(frames.shown), frames.dropped))
