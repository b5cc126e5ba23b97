"""The control channel: operators send commands, displays send reports, and other messages are refused."""

from dataclasses import replace

import pytest
from fake_router import WELCOME, WELCOMES, FakeRouter, hello

from fakes import STATUS, Answers
from netboard.network.protocol.control import (
    Command,
    Outcomes,
    OutcomesRequest,
    Reply,
    StatusRequest,
    Trace,
    TraceRequest,
)
from netboard.network.protocol.joining import Goodbye, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.views import Frames
from netboard.nodes.ports.control_port import ALLOWED_MESSAGES, CONNECTION_CHECK_NS, MAX_PEERS, ControlPort
from netboard.nodes.ports.peer import PING_NS, SILENCE_TIMEOUT_NS
from netboard.nodes.ports.welcomes import RECEIVERS

STYLUS = Stylus(0, 0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.1, 0, 0, 0.0, -1, 0, 0, 0, 0)
D, C = b"display.left@1", b"console@1"


class Rig:
    """A port with its fake socket, and a registered display and console."""

    def __init__(self) -> None:
        self.router = FakeRouter()
        self.port = ControlPort(self.router, WELCOMES)  # type: ignore[arg-type]
        assert isinstance(self.exchange(D, hello("display", "left"))[0], Welcome)
        assert isinstance(self.exchange(C, hello("console"))[0], Welcome)

    def exchange(self, peer: bytes, message: Message | bytes) -> list[Message]:
        """Send a message of a peer, and return the answers to it."""
        self.router.send_from(peer, message)
        self.port.drain(lambda: 0)
        self.port.answer(Answers())
        return self.router.received_by(peer)


def test_operator_requests_and_commands_are_answered() -> None:
    rig = Rig()
    assert rig.exchange(C, StatusRequest()) == [STATUS]
    assert rig.exchange(C, OutcomesRequest(3)) == [Outcomes(3, ())]
    assert rig.exchange(C, TraceRequest(7)) == [Trace(())]
    assert rig.exchange(C, Command("pause", "", 5)) == []
    (request,) = rig.port.requests
    assert (request.who, request.command.name) == (C, "pause")
    rig.port.reply(request, False, "cannot pause while idle")
    assert rig.router.received_by(C) == [Reply(5, False, "cannot pause while idle")]


def test_message_without_a_handler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()
    monkeypatch.setitem(
        ALLOWED_MESSAGES, "console", ALLOWED_MESSAGES["console"] | {Stylus}
    )  # as a new message would be
    assert rig.exchange(C, STYLUS) == [Refusal("the server has no answer to Stylus")]


def test_reason_that_quotes_a_long_argument_is_cut() -> None:
    rig = Rig()
    rig.exchange(C, Command("repeat", "\U0001f40c" * 2000, 5))
    (request,) = rig.port.requests
    rig.port.reply(request, False, f"repeat: found {request.command.argument}, expected the number of a trial")
    (reply,) = rig.router.received_by(C)
    assert reply.reason.startswith("repeat: found \U0001f40c")


def test_display_cannot_command_or_report_for_another_station() -> None:
    rig = Rig()
    for message in (Command("start", "", 1), StatusRequest(), STYLUS):
        assert rig.exchange(D, message) == [Refusal(f"a display may not send {type(message).__name__}")]
    answer = Refusal("the left display may not report for the right station")
    assert rig.exchange(D, Frames("right", ((1, 2, 3),), 0)) == [answer]
    assert rig.port.requests == []
    assert rig.port.take_frames() == []
    assert [name for name, _ in rig.port.news].count("refused") == 4


def test_frames_are_numbered_per_station() -> None:
    rig = Rig()
    rig.exchange(b"r", hello("display", "right"))
    rig.exchange(D, Frames("left", ((1, 10, 20), (2, 30, 40)), 0))
    rig.exchange(b"r", Frames("right", ((1, 11, 21),), 5))
    rig.exchange(D, Frames("left", ((3, 50, 60),), 1))
    assert [(f.station, f.seq, f.tick, f.dropped) for f in rig.port.take_frames()] == [
        ("left", 0, 1, 0),
        ("left", 1, 2, 0),
        ("right", 0, 1, 5),
        ("left", 2, 3, 1),
    ]


def test_unregistered_peers_and_malformed_messages_are_refused() -> None:
    rig = Rig()
    assert rig.exchange(b"x", StatusRequest()) == [Refusal("it has not joined yet")]
    assert isinstance(rig.exchange(b"x", b"\xc1")[0], Refusal)
    assert rig.exchange(b"x", hello("logger")) == [Refusal("this is the fake channel, which takes no logger")]


def test_peers_are_listed_and_the_newest_display_of_a_station_reports() -> None:
    rig = Rig()
    assert rig.port.peers == ("console", "display.left")
    rig.exchange(b"display.left@2", hello("display", "left", "host:2"))
    assert rig.port.peers == ("console", "display.left")
    assert rig.exchange(D, Frames("left", ((1, 2, 3),), 0)) == []
    assert rig.port.take_frames() == []
    rig.exchange(b"display.left@2", Frames("left", ((4, 5, 6),), 0))
    assert [frame.tick for frame in rig.port.take_frames()] == [4]
    rig.exchange(C, Goodbye("off"))
    assert rig.port.peers == ("display.left",)


@pytest.mark.parametrize("ending", ["goodbye", "silence"])
def test_another_display_of_the_station_reports_when_the_newest_is_gone(ending: str) -> None:
    rig = Rig()
    newest = b"display.left@2"
    rig.exchange(newest, hello("display", "left", "host:2"))
    if ending == "goodbye":
        rig.exchange(newest, Goodbye("the display was closed"))
    else:
        rig.port.pump(SILENCE_TIMEOUT_NS + 1)
    rig.exchange(D, Frames("left", ((1, 2, 3),), 0))
    assert [frame.tick for frame in rig.port.take_frames()] == [1]
    rig.exchange(newest, hello("display", "left", "host:2"))
    rig.exchange(newest, Frames("left", ((4, 5, 6),), 0))
    rig.exchange(D, Frames("left", ((4, 5, 7),), 0))
    assert [(frame.tick, frame.painted_ns) for frame in rig.port.take_frames()] == [(4, 6)]


def test_pings_yield_clock_offsets_of_peers() -> None:
    rig = Rig()
    rig.port.pump(PING_NS)
    ahead = 5_000_000_000
    assert rig.router.received_by(D) == [Ping(PING_NS)]
    rig.router.send_from(D, Pong(PING_NS, PING_NS + ahead + 10, PING_NS + ahead + 30))
    rig.port.drain(lambda: PING_NS + 40)
    (record,) = rig.port.clock_records(7)
    assert (record.seq, record.peer, record.offset_ns) == (7, "display.left", ahead)
    links = {link.peer: link for link in rig.port.links(PING_NS + 40)}
    assert links["display.left"][4] == 20e-9
    assert links["display.left"][5] < 1e-6
    rig.router.received_by(C)
    rig.port.pump(2 * PING_NS - 1)
    assert rig.router.received_by(C) == []


def test_silent_display_is_removed_and_may_return() -> None:
    rig = Rig()
    assert not rig.port.empty
    rig.port.pump(SILENCE_TIMEOUT_NS + PING_NS)
    assert rig.port.empty
    assert rig.port.peers == ()
    assert not rig.port.is_present(C)
    rig.exchange(D, Frames("left", ((1, 2, 3),), 0))
    assert rig.port.peers == ("display.left",)
    assert not rig.port.empty
    names = [name for name, _ in rig.port.news]
    assert names == ["display_joined", "console_joined", "display_silent", "console_silent", "display_back"]
    assert [frame.tick for frame in rig.port.take_frames()] == [1]


def test_suspended_console_may_answer_all_queued_pings() -> None:
    rig = Rig()
    suspended_s = 3600
    for tenth in range(suspended_s * 10):
        rig.port.pump(tenth * 100_000_000)
    pings = [message for message in rig.router.received_by(C) if isinstance(message, Ping)]
    assert pings
    now_ns = suspended_s * 1_000_000_000
    for ping in pings:
        rig.router.send_from(C, Pong(ping.sent_ns, now_ns, now_ns))
        rig.port.drain(lambda: now_ns)
    assert rig.router.received_by(C) == [Ping(now_ns)]


def test_commands_after_a_silence_may_be_late_until_a_new_ping_is_answered() -> None:
    rig = Rig()
    rig.port.pump(PING_NS)
    now_ns = PING_NS + 1

    def send(*messages: Message) -> list[Message]:
        for message in messages:
            rig.router.send_from(C, message)
        rig.port.drain(lambda: now_ns)
        return rig.router.received_by(C)

    assert Ping(PING_NS) in send(Command("resume", "", 1))
    send(Pong(PING_NS, PING_NS, PING_NS))
    now_ns += SILENCE_TIMEOUT_NS + 1  # a pulled plug: what was sent meanwhile arrives together
    (ping,) = send(StatusRequest(), Pong(PING_NS, PING_NS, PING_NS), Command("resume", "", 2))
    assert ping == Ping(now_ns)
    send(Pong(now_ns, now_ns, now_ns), Command("resume", "", 3))
    assert [(request.command.number, request.late) for request in rig.port.requests] == [
        (1, False),
        (2, True),
        (3, False),
    ]


def test_commands_of_a_peer_that_answers_no_pings_are_never_late() -> None:
    rig = Rig()
    rig.router.send_from(C, Command("resume", "", 1))
    rig.port.drain(lambda: 2 * SILENCE_TIMEOUT_NS)
    assert [request.late for request in rig.port.requests] == [False]


def test_undelivered_block_change_is_sent_again() -> None:
    router = FakeRouter(room=1)
    port = ControlPort(router, WELCOMES)  # type: ignore[arg-type]
    router.send_from(b"console", hello("console"))
    port.drain(lambda: 0)
    another = replace(WELCOME, config="another block")
    port.renew(dict.fromkeys(RECEIVERS, another))
    assert router.received_by(b"console") == [WELCOME]
    port.pump(0)
    assert router.received_by(b"console") == [another]


def test_departed_peers_with_full_queues_leave_no_pending_messages() -> None:
    router = FakeRouter(room=0)  # no peer reads its messages
    port = ControlPort(router, WELCOMES)  # type: ignore[arg-type]
    for number in range(2000):
        router.send_from(b"display.left@%d" % number, hello("display", "left"))
        router.send_from(b"console@%d" % number, hello("console"))
        now_ns = number * CONNECTION_CHECK_NS
        port.drain(lambda now_ns=now_ns: now_ns)
        port.pump(now_ns)
    assert len(router.queued) <= 2 * MAX_PEERS
