"""The lossless log from the server's side: cursors, loggers that come and go, the end."""

from fake_router import WELCOME, FakeRouter, hello

from netboard.nodes.log_port import GONE_NS, LogPort
from netboard.wire.codec import decode
from netboard.wire.messages import (
    Goodbye,
    LogAck,
    LogBatch,
    LogEnd,
    LogRequest,
    Message,
    Refusal,
    StatusRequest,
    TickRecord,
    Welcome,
)

L, M = b"logger@1", b"logger@2"


class Rig:
    """A port with its fake socket and a clock."""

    def __init__(self, capacity: int = 1000, room: int = 1000) -> None:
        self.router = FakeRouter(room)
        self.port = LogPort(self.router, WELCOME, capacity)  # type: ignore[arg-type]
        self.now_ns = 0

    def record(self, count: int) -> None:
        for _ in range(count):
            self.port.append(TickRecord(str(self.port.ring.next).encode()))

    def pump(self, peer: bytes, *says: Message) -> list[Message]:
        for message in says:
            self.router.say(peer, message)
        self.port.pump(self.now_ns)
        return self.router.heard(peer)

    def numbers(self, heard: list[Message]) -> list[int]:
        """Numbers of all records in the batches, checking that each is what it says it is."""
        got = []
        for batch in heard:
            assert isinstance(batch, LogBatch)
            for offset, record in enumerate(batch.records):
                tick = decode(record)
                assert isinstance(tick, TickRecord)
                assert int(tick.row) == batch.first + offset
                got.append(batch.first + offset)
        return got


def test_a_logger_gets_every_record_once_in_order() -> None:
    rig = Rig()
    rig.record(5)
    assert isinstance(rig.pump(L, hello("logger"))[0], Welcome)
    assert rig.numbers(rig.pump(L, LogRequest(-1))) == [0, 1, 2, 3, 4]
    rig.record(3)
    assert rig.numbers(rig.pump(L)) == [5, 6, 7]
    assert rig.pump(L) == []
    assert rig.port.backlog == 8
    rig.pump(L, LogAck(8, 10**9))
    assert (rig.port.backlog, rig.port.free_bytes) == (0, 10**9)


def test_a_full_queue_delays_and_loses_nothing() -> None:
    rig = Rig(capacity=5000, room=2)
    rig.record(4000)
    rig.pump(L, hello("logger"))
    got = rig.numbers(rig.pump(L, LogRequest(0)))
    while len(got) < 4000:
        more = rig.numbers(rig.pump(L))
        assert more
        got += more
    assert got == list(range(4000))


def test_a_restarted_logger_goes_on_with_the_first_record_that_is_not_on_disk() -> None:
    rig = Rig()
    rig.record(10)
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1), LogAck(6, 0))
    rig.pump(M, hello("logger", name="host:2"))
    assert rig.numbers(rig.pump(M, LogRequest(-1))) == [6, 7, 8, 9]


def test_what_the_ring_no_longer_holds_is_counted() -> None:
    rig = Rig(capacity=10)
    rig.record(25)
    rig.pump(L, hello("logger"))
    (batch,) = rig.pump(L, LogRequest(0))
    assert isinstance(batch, LogBatch)
    assert (batch.first, batch.lost, len(batch.records)) == (15, 15, 10)


def test_a_logger_that_falls_silent_is_gone_and_must_say_hello_again() -> None:
    rig = Rig()
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1))
    assert rig.port.loggers == 1
    rig.now_ns = GONE_NS + 1
    rig.pump(L)
    assert rig.port.loggers == 0
    assert rig.pump(L, LogAck(0, 0)) == [Refusal("say hello first")]


def test_the_end_is_told_once_all_records_are_sent_and_done_once_they_are_on_disk() -> None:
    rig = Rig()
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.port.end()
    heard = rig.pump(L, LogRequest(-1))
    assert rig.numbers(heard[:-1]) == [0, 1, 2]
    assert heard[-1] == LogEnd(2)
    assert not rig.port.done
    assert rig.pump(L) == []
    rig.pump(L, LogAck(3, 0))
    assert rig.port.done


def test_a_logger_that_has_been_told_the_end_may_take_its_time() -> None:
    rig = Rig()
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.port.end()
    rig.pump(L, LogRequest(-1))
    rig.now_ns = 3 * GONE_NS
    rig.pump(L)
    assert rig.pump(L, LogAck(3, 0)) == []
    assert rig.port.done


def test_a_logger_that_leaves_is_noted_and_what_it_has_not_got_stays() -> None:
    rig = Rig()
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1), Goodbye("done"))
    assert not rig.port.done
    assert [name for name, _ in rig.port.news] == ["logger_joined", "logger_left"]
    assert rig.port.backlog == 3


def test_who_does_not_belong_is_refused() -> None:
    rig = Rig()
    assert rig.pump(L, LogRequest(0)) == [Refusal("say hello first")]
    assert rig.pump(L, hello("agent", "left")) == [Refusal("this is the log channel, not one for a agent")]
    assert isinstance(rig.pump(L, hello("logger", "left"))[0], Refusal)
    rig.pump(L, hello("logger"))
    assert rig.pump(L, StatusRequest()) == [Refusal("a logger does not send StatusRequest")]
