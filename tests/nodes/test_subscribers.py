"""Subscribers of the log receive the records, and never affect the loggers."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from fake_router import FakeRouter, hello
from hypothesis import given, settings
from hypothesis import strategies as st
from log_rig import L, M, Rig, close_rig

from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import StatusRequest
from netboard.network.protocol.joining import Goodbye, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest, TickRecord
from netboard.nodes.ports.subscribers import MAX_RECORDS, MAX_SUBSCRIBERS, SILENCE_TIMEOUT_NS

E, F = b"listener@1", b"listener@2"


class StallingRouter(FakeRouter):
    """A router on which the queues of some peers are full."""

    stalled: tuple[bytes, ...] = ()

    def send(self, peer: bytes, frame: bytes) -> bool:
        return peer not in self.stalled and super().send(peer, frame)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    close_rig(rig)


def stalling_rig(folder: Path, capacity: int = 1000) -> tuple[Rig, StallingRouter]:
    """A rig on which peers can be stalled."""
    rig = Rig(folder, capacity)
    router = StallingRouter()
    rig.router = rig.port._router = rig.port.subscribers._router = rig.port.refusals._router = router  # type: ignore[assignment]
    return rig, router


def join_listener(rig: Rig, peer: bytes, first: int = -1) -> list[Message]:
    """Connect a listener and request its records."""
    assert isinstance(rig.pump(peer, hello("listener", name=peer.decode()))[0], Welcome)
    return rig.pump(peer, LogRequest(first))


def test_listener_receives_records_from_now_on(rig: Rig) -> None:
    rig.record(5)
    assert join_listener(rig, E) == []
    rig.record(3)
    assert rig.numbers(rig.pump(E)) == [5, 6, 7]
    assert rig.pump(E) == []


def test_listener_receives_records_from_the_requested_number(rig: Rig) -> None:
    rig.record(5)
    assert rig.numbers(join_listener(rig, E, 2)) == [2, 3, 4]
    assert rig.numbers(rig.pump(E, LogRequest(0))) == [0, 1, 2, 3, 4]
    assert rig.pump(E, LogRequest(99)) == []


def test_listener_does_not_count_as_a_logger(rig: Rig) -> None:
    join_listener(rig, E)
    rig.record(900)
    rig.pump(E)
    assert (rig.port.loggers, rig.port.store.backlog, len(rig.port.subscribers)) == (0, 900, 1)
    assert not rig.port.done
    assert rig.port.trouble == "the logger is too far behind"
    assert rig.port.recordings(rig.clock()) == ()
    assert rig.spill.next == 0
    rig.pump(E, Goodbye("done"))
    assert rig.port.trouble == "the logger is too far behind"
    assert rig.names() == ["listener_joined", "listener_left"]


def test_acknowledgements_and_requests_of_a_listener_are_refused(rig: Rig) -> None:
    rig.record(5)
    join_listener(rig, E)
    assert rig.pump(E, LogAck(5, 1, "a.mcap", 0)) == [Refusal("a listener does not send LogAck")]
    assert rig.pump(E, StatusRequest()) == [Refusal("a listener does not send StatusRequest")]
    assert (rig.port.store.backlog, rig.port.free_bytes, rig.port.notice) == (5, 0, "")


def test_peer_cannot_be_both_listener_and_logger(rig: Rig) -> None:
    join_listener(rig, E)
    assert rig.pump(E, hello("logger")) == [Refusal("it joined as another peer than a logger")]
    rig.join(L)
    assert rig.pump(L, hello("listener")) == [Refusal("it joined as another peer than a listener")]
    assert (rig.port.loggers, len(rig.port.subscribers)) == (1, 1)


def test_unauthorised_and_surplus_listeners_are_refused(rig: Rig) -> None:
    assert isinstance(rig.pump(E, hello("listener", "left"))[0], Refusal)
    rig.router.forbidden = "this key is that of a logger"
    assert rig.pump(E, hello("listener")) == [Refusal("this key is that of a logger")]
    rig.router.forbidden = ""
    for k in range(MAX_SUBSCRIBERS):
        join_listener(rig, b"listener@%d" % k)
    assert rig.pump(b"listener@x", hello("listener")) == [Refusal("too many listeners")]
    rig.join(L)
    assert rig.port.loggers == 1


def test_slow_listener_loses_records_and_the_loss_is_counted(tmp_path: Path) -> None:
    rig, router = stalling_rig(tmp_path, capacity=300)
    join_listener(rig, E)
    router.stalled = (E,)
    rig.record(1000, pump_each=10)
    router.stalled = ()
    messages = [*rig.pump(E), *rig.pump(E), *rig.pump(E)]
    assert [type(message) for message in messages] == [LogBatch] * 3
    assert rig.numbers(messages) == list(range(700, 1000))
    assert [message.lost for message in messages if isinstance(message, LogBatch)] == [700, 0, 0]
    assert [link.lost for link in rig.port.links(rig.clock())] == [700]
    assert "log_lost" not in rig.names()
    close_rig(rig)


def test_late_listener_receives_one_batch_at_a_time(rig: Rig) -> None:
    rig.record(900)
    assert len(rig.numbers(join_listener(rig, E, 0))) == MAX_RECORDS
    assert len(rig.numbers(rig.pump(E))) == MAX_RECORDS


def test_listener_receives_nothing_from_the_spill(rig: Rig) -> None:
    rig.fill_spill(5000)
    messages = join_listener(rig, E, 0)
    assert isinstance(messages[0], LogBatch)
    assert (messages[0].first, messages[0].lost) == (4000, 4000)
    assert rig.catch_up(M, rig.join(M), 4999) == list(range(5000))


def test_silent_listener_is_dropped_and_repeated_hello_is_accepted(rig: Rig) -> None:
    join_listener(rig, E)
    rig.record(3)
    assert isinstance(rig.pump(E, hello("listener", name=E.decode()))[0], Welcome)
    rig.record(2)
    rig.pump(E, LogRequest(3))
    rig.clock.advance(SILENCE_TIMEOUT_NS * 1e-9 + 1e-3)
    rig.pump(E)
    assert len(rig.port.subscribers) == 0
    assert rig.pump(E, LogRequest(0)) == [Refusal("it has not joined yet")]
    assert rig.names()[:2] == ["listener_joined", "listener_left"]


def test_session_end_does_not_wait_for_listeners(tmp_path: Path) -> None:
    rig, router = stalling_rig(tmp_path)
    rig.join(L)
    join_listener(rig, E)
    join_listener(rig, F)
    router.stalled = (F,)
    rig.record(3)
    rig.port.end()
    assert rig.numbers(rig.pump(E)) == [0, 1, 2]
    assert rig.pump(E) == [LogEnd(2)]
    assert rig.pump(E) == []
    rig.pump(L, LogAck(3, 10**12, "a.mcap", 0))
    assert rig.port.done
    close_rig(rig)
    assert router.received_by(E) == [Goodbye("the session is over")]
    assert rig.port.store.shortfall == ""


def test_clock_of_a_listener_is_probed(rig: Rig) -> None:
    join_listener(rig, E)
    for _ in range(5):
        rig.clock.advance(0.2)
        rig.port.pump(rig.clock())
        (ping,) = [message for message in rig.router.received_by(E) if isinstance(message, Ping)]
        rig.clock.advance(0.001)
        rig.router.send_from(E, Pong(ping.sent_ns, ping.sent_ns + 7_000_400_000, ping.sent_ns + 7_000_500_000))
        rig.port.read_if_needed(rig.clock())
    (probe,) = rig.port.clock_records(3)
    assert (probe.seq, probe.peer) == (3, "listener")
    assert abs(probe.offset_ns - 7_000_000_000) <= probe.bound_ns < 1_000_000


# --- random messages of listeners --------------------------------------------------------------------------------

MESSAGES: list[Message | bytes] = [
    hello("listener"),
    hello("logger"),
    LogRequest(-1),
    LogRequest(0),
    LogRequest(10**9),
    LogAck(0, 0, "evil.mcap", 0),
    LogAck(50, 0, "evil.mcap", 0),
    Pong(0, 5, 3),
    Pong(10**9, 10**9, 10**9),
    Goodbye("gone"),
    StatusRequest(),
    b"\xc1nonsense",
    b"",
]
"""Messages that a listener may send, valid or not. Keys prevent it from claiming to be a logger."""

STEPS = st.lists(
    st.tuples(
        st.integers(0, 40),  # number of records
        st.lists(st.tuples(st.sampled_from((E, F)), st.sampled_from(MESSAGES)), max_size=6),
        st.sampled_from(((), (E,), (F,), (E, F))),  # stalled peers
        st.sampled_from(("", "ask", "ack", "goodbye", "hello")),  # message of the logger
        st.sampled_from((0.01, 0.2, 1.0)),  # time that passes [s]
    ),
    max_size=30,
)


class KeyedRouter(StallingRouter):
    """A router that knows the owner of each key."""

    def receive(self) -> tuple[bytes, bytes] | None:
        received = super().receive()
        self.key = received[0].partition(b"@")[0].decode() if received else ""
        return received

    def role_refusal(self, role: str, side: str) -> str:
        return "" if role == self.key else "not with this key"


def history(folder: Path, steps: list, *, with_listeners: bool) -> list[object]:
    """Everything that a logger receives and an operator sees in each step, with or without listeners."""
    rig = Rig(folder, capacity=200, spill_bytes=0)  # the spill's thread does not follow the fake clock
    router = KeyedRouter()
    rig.router = rig.port._router = rig.port.subscribers._router = rig.port.refusals._router = router  # type: ignore[assignment]
    observed: list[object] = []
    for records, sent, stalled, logger, seconds in steps:
        for _ in range(records):
            rig.port.append(encode(TickRecord(str(rig.port.ring.next).encode())))
        router.stalled = stalled if with_listeners else ()
        for peer, message in sent if with_listeners else ():
            router.send_from(peer, message)
        match logger:
            case "hello":
                router.send_from(L, hello("logger"))
            case "ask":
                router.send_from(L, LogRequest(-1))
            case "ack":
                router.send_from(L, LogAck(rig.port.ring.next // 2, 10**12, "good.mcap", 1))
            case "goodbye":
                router.send_from(L, Goodbye("done"))
        rig.clock.advance(seconds)
        rig.port.pump(rig.clock())
        port = rig.port
        observed += [
            router.received_by(L),
            port.store.backlog,
            port.loggers,
            port.trouble,
            port.notice,
            port.free_bytes,
            port.done,
        ]
        observed += [port.ring.acknowledged, port.recordings(rig.clock()), rig.spill.next > 0]
    observed.append([item for item in rig.port.news if "listener" not in str(item)])
    close_rig(rig)
    observed.append(rig.port.store.shortfall.replace(str(folder), ""))
    return observed


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(steps=STEPS)
def test_listeners_never_affect_what_loggers_receive(steps: list) -> None:
    with TemporaryDirectory() as one, TemporaryDirectory() as other:
        assert history(Path(one), steps, with_listeners=True) == history(Path(other), steps, with_listeners=False)
