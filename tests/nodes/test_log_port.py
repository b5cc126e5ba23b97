"""The server's end of the lossless log: cursors, loggers that connect and leave, the spill, clocks, the end."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fake_router import WELCOME, hello
from log_rig import L, M, Rig, close_rig

from netboard.network.protocol.control import StatusRequest
from netboard.network.protocol.joining import Goodbye, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest
from netboard.nodes.ports.log_port import PONG_WAIT_NS
from netboard.nodes.ports.record_store import FULL_SHARE
from netboard.nodes.ports.subscribers import SILENCE_TIMEOUT_NS
from netboard.nodes.ports.sync_age import RECENT_NS
from netboard.recording.format.disk import LOW_BYTES
from netboard.recording.recovery import spill as spilling
from netboard.recording.recovery.spill import read_spill


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    close_rig(rig)


def test_logger_receives_every_record_once_and_in_order(rig: Rig) -> None:
    rig.record(5)
    assert isinstance(rig.pump(L, hello("logger"))[0], Welcome)
    assert rig.numbers(rig.pump(L, LogRequest(-1))) == [0, 1, 2, 3, 4]
    rig.record(3)
    assert rig.numbers(rig.pump(L)) == [5, 6, 7]
    assert rig.pump(L) == []
    assert rig.port.store.backlog == 8
    rig.pump(L, LogAck(8, 10**9, "a.mcap", 0))
    assert (rig.port.store.backlog, rig.port.free_bytes) == (0, 10**9)


@pytest.mark.parametrize(("sync_s", "told"), [(0.2, ""), (0.7, "after 0.7 s"), (8.0, "after 8.0 s")])
def test_slow_disk_of_a_logger_is_told_with_how_much_a_power_cut_loses(rig: Rig, sync_s: float, told: str) -> None:
    rig.join(L)
    rig.pump(L)
    rig.record(5)
    for _ in range(round(sync_s / 0.05)):
        rig.clock.advance(0.05)
        rig.pump(L, Pong(0, 0, 0))
    rig.pump(L, LogAck(5, 10**12, "a.mcap", 1000))
    (recording,) = rig.port.recordings(rig.clock())
    assert recording.age == pytest.approx(sync_s, abs=0.06)
    assert (rig.port.notice != "") == (told != "")
    assert told in rig.port.notice
    rig.clock.advance(RECENT_NS * 1e-9 + 0.1)
    assert rig.port.notice == ""


def test_logger_that_falls_silent_is_told_and_not_only_missed(rig: Rig) -> None:
    rig.join(L)
    rig.pump(L, LogAck(0, 10**12, "a.mcap", 0))
    rig.clock.advance(2 * SILENCE_TIMEOUT_NS * 1e-9)
    rig.pump(M)
    assert (rig.port.loggers, rig.port.trouble) == (0, "")
    assert rig.port.notice == "the logger fell silent: its disk or its network hangs"
    rig.join(M)
    assert rig.port.notice == ""


def test_full_queue_delays_records_but_loses_none(tmp_path: Path) -> None:
    rig = Rig(tmp_path, capacity=5000, room=2)
    rig.record(4000)
    rig.pump(L, hello("logger"))
    received = rig.numbers(rig.pump(L, LogRequest(0)))
    while len(received) < 4000:
        more = rig.numbers(rig.pump(L))
        assert more
        received += more
    assert received == list(range(4000))


def test_restarted_logger_continues_after_the_last_acknowledged_record(rig: Rig) -> None:
    rig.record(10)
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1), LogAck(6, 0, "a.mcap", 0))
    rig.pump(M, hello("logger", name="host:2"))
    assert rig.numbers(rig.pump(M, LogRequest(-1))) == [6, 7, 8, 9]


def test_logger_that_joins_at_the_end_of_a_block_is_told_the_block_of_its_first_record(rig: Rig) -> None:
    rig.join(L)
    rig.record(10)
    rig.pump(L)
    second = replace(WELCOME, config="the second block")
    rig.port.renew(second)
    rig.record(5)
    assert rig.pump(M, hello("logger", name="host:2")) == [WELCOME]  # no record of the first block is on disk yet
    rig.pump(L, LogAck(12, 0, "a.mcap", 0))
    assert rig.pump(M, LogRequest(-1)) == [second]
    assert rig.numbers(rig.pump(M, LogRequest(-1))) == [12, 13, 14]


def test_records_evicted_before_the_first_logger_are_counted(tmp_path: Path) -> None:
    rig = Rig(tmp_path, capacity=10)
    rig.record(25, pump_each=1)
    rig.pump(L, hello("logger"))
    (batch,) = rig.pump(L, LogRequest(0))
    assert isinstance(batch, LogBatch)
    assert (batch.first, batch.lost, len(batch.records)) == (15, 15, 10)
    assert ("log_lost", {"first": "0", "count": "15", "cause": "no logger was connected yet"}) in rig.port.news
    rig.pump(L, LogRequest(0))
    assert rig.names().count("log_lost") == 1
    assert rig.port.links(rig.clock())[0].lost == 15


def test_records_are_spilled_if_the_logger_falls_silent_before_it_has_written_any(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.join(L)
    rig.port.store.needed = True  # a trial has started
    rig.clock.advance(2 * SILENCE_TIMEOUT_NS * 1e-9)
    for _ in range(5):
        rig.record(1000, pump_each=20)
        rig.until(lambda: not rig.spill._unwritten)
    rig.port.close()
    rig.until(lambda: rig.port.store.closed)
    assert rig.spill.held == 5000


def test_silent_logger_is_dropped_and_must_say_hello_again(rig: Rig) -> None:
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1))
    assert rig.port.loggers == 1
    rig.clock.advance(SILENCE_TIMEOUT_NS * 1e-9 + 1e-3)
    rig.pump(L)
    assert rig.port.loggers == 0
    assert rig.pump(L, LogAck(0, 0, "a.mcap", 0)) == [Refusal("it has not joined yet")]


def test_end_is_sent_after_all_records_and_done_when_they_are_on_disk(rig: Rig) -> None:
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.port.end()
    messages = rig.pump(L, LogRequest(-1))
    assert rig.numbers(messages[:-1]) == [0, 1, 2]
    assert messages[-1] == LogEnd(2)
    assert not rig.port.done
    rig.record(1)
    assert rig.pump(L) == []
    rig.pump(L, LogAck(3, 0, "a.mcap", 0))
    assert rig.port.done


def test_logger_may_be_silent_after_the_end_was_sent(rig: Rig) -> None:
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.port.end()
    rig.pump(L, LogRequest(-1))
    rig.clock.advance(3 * SILENCE_TIMEOUT_NS * 1e-9)
    rig.pump(L)
    assert rig.pump(L, LogAck(3, 0, "a.mcap", 0)) == []
    assert rig.port.done


def test_departed_logger_is_reported_and_its_backlog_kept(rig: Rig) -> None:
    rig.record(3)
    rig.pump(L, hello("logger"))
    rig.pump(L, LogRequest(-1), Goodbye("done"))
    assert not rig.port.done
    assert rig.names() == ["logger_joined", "logger_left"]
    assert rig.port.store.backlog == 3
    assert rig.port.trouble == rig.port.notice == "the logger has left: done"
    rig.join(M)
    assert rig.port.trouble == rig.port.notice == ""


def test_unauthorised_peers_and_messages_are_refused(rig: Rig) -> None:
    assert rig.pump(L, LogRequest(0)) == [Refusal("it has not joined yet")]
    assert rig.pump(L, hello("agent", "left")) == [Refusal("this is the fake channel, which takes no agent")]
    assert isinstance(rig.pump(L, hello("logger", "left"))[0], Refusal)
    rig.pump(L, hello("logger"))
    assert rig.pump(L, StatusRequest()) == [Refusal("a logger does not send StatusRequest")]
    rig.router.forbidden = "this key is that of an agent"
    assert rig.pump(M, hello("logger")) == [Refusal("this key is that of an agent")]


def test_silent_logger_does_not_pause_the_trial_while_there_is_room(rig: Rig) -> None:
    rig.join(L)
    rig.clock.advance(2 * SILENCE_TIMEOUT_NS * 1e-9)
    rig.record(500)
    rig.pump(L)
    assert (rig.port.loggers, rig.port.trouble) == (0, "")


def test_unread_records_are_spilled_and_delivered_to_the_next_logger(rig: Rig) -> None:
    rig.fill_spill(20_000)
    assert rig.port.ring.first == 19_000
    assert rig.port.trouble == ""
    assert "no logger is connected" in rig.port.notice
    assert rig.names().count("log_spilling") == 1
    received = rig.catch_up(M, rig.join(M), 19_999)
    assert received == list(range(20_000))
    assert "log_lost" not in rig.names()
    rig.pump(M, LogAck(20_000, 10**12, "a.mcap", 0))
    assert rig.names()[-1] == "log_spill_taken"
    close_rig(rig)
    assert not rig.spill.path.exists()
    assert rig.port.store.shortfall == ""


def test_two_loggers_read_the_spill_at_their_own_pace(rig: Rig) -> None:
    rig.fill_spill(5000)
    one, other = rig.join(L), rig.join(M, 1234)
    assert rig.catch_up(M, other, 4999) == list(range(1234, 5000))
    assert rig.catch_up(L, one, 4999) == list(range(5000))


def test_logger_catches_up_while_the_spill_is_growing(rig: Rig) -> None:
    rig.fill_spill(5000)
    received = rig.numbers(rig.join(M))
    while rig.port.ring.next < 20_000:
        rig.record(50)
        received += rig.numbers(rig.pump(M))
    received = rig.catch_up(M, [], 19_999, received)
    assert received == list(range(20_000))


def test_full_spill_pauses_the_trial_and_losses_are_reported(tmp_path: Path) -> None:
    rig = Rig(tmp_path, capacity=100, spill_bytes=3000)
    rig.fill_spill(150)
    assert rig.port.trouble == ""
    rig.record(800, pump_each=10)
    assert rig.port.trouble.startswith("the logger is too far behind (")
    losing = dict(rig.port.news)["log_losing"]
    assert "log_spill_mb" in losing["cause"]
    held = rig.spill.next
    assert int(losing["first"]) == held
    received = rig.catch_up(M, rig.join(M), 949)
    assert received == [*range(held), *range(850, 950)]
    lost = dict(rig.port.news)["log_lost"]
    assert lost == {"first": str(held), "count": str(850 - held), "cause": losing["cause"]}
    rig.pump(M, LogAck(950, 10**12, "a.mcap", 0))
    assert rig.port.trouble == ""
    close_rig(rig)


def test_trial_is_paused_before_any_loss_without_a_spill(tmp_path: Path) -> None:
    rig = Rig(tmp_path, capacity=100, spill_bytes=0)
    rig.fill_spill(int(100 * FULL_SHARE))
    assert rig.port.trouble == ""
    rig.record(1)
    rig.pump(M)
    assert rig.port.trouble.startswith("the logger is too far behind (")
    assert "log_losing" not in rig.names()
    close_rig(rig)
    assert rig.port.store.shortfall == "81 records may not be on disk: no logger confirmed them"


def test_failed_spill_is_reported_and_lost_records_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spilling, "RETRY_SECONDS", 0.001)
    monkeypatch.setattr(spilling, "MAX_WAITING", 2)
    rig = Rig(tmp_path / "nowhere", capacity=100)
    rig.fill_spill(400)
    rig.until(lambda: rig.spill.trouble != "")
    rig.record(200, pump_each=10)
    news = dict(rig.port.news)
    assert news["log_spill_failed"] == {"reason": "No such file or directory"}
    assert news["log_losing"]["cause"] in ("No such file or directory", f"{rig.spill.path}: the disk is too slow")
    assert rig.port.trouble.startswith("the logger is too far behind (")
    (tmp_path / "nowhere").mkdir()
    rig.until(lambda: rig.spill.trouble == "")
    rig.record(300, pump_each=1)
    rig.until(lambda: rig.pump(M) == [] and rig.port.trouble == "")
    received = rig.catch_up(M, rig.join(M), 899)
    lost = sum(int(details["count"]) for name, details in rig.port.news if name == "log_lost")
    assert lost > 0
    assert received == sorted(set(received))
    assert len(received) + lost == 900
    close_rig(rig)


def test_nothing_is_spilled_before_the_first_logger(rig: Rig) -> None:
    rig.record(5000, pump_each=10)
    assert rig.names() == []
    assert rig.spill.next == 0
    close_rig(rig)
    assert not rig.spill.path.exists()


def test_records_unread_at_the_end_are_in_the_spill(rig: Rig) -> None:
    rig.fill_spill(3000)
    rig.port.end()
    close_rig(rig)
    assert rig.router.closed
    assert rig.port.store.shortfall == (
        f"3000 records may not be on disk: no logger confirmed them; 3000 records are in {rig.spill.path}: "
        "netboard recover makes a recording of it"
    )
    _, _, *batches = [message for _, _, message in read_spill(rig.spill.path.read_bytes())]
    assert rig.numbers(batches) == list(range(3000))  # type: ignore[arg-type]


def test_connected_logger_receives_goodbye_at_the_end(rig: Rig) -> None:
    rig.record(10)
    rig.join(L)
    close_rig(rig)
    assert Goodbye("the session is over") in rig.router.received_by(L)


def test_clock_of_a_logger_is_probed(rig: Rig) -> None:
    rig.pump(L, hello("logger", name="lab:7"))
    assert rig.port.clock_records(3) == []
    kind, name, _, _, _, bound, *_ = rig.port.links(rig.clock())[0]
    assert (kind, name, math.isnan(bound)) == ("logger", "lab:7", True)
    for _ in range(5):
        rig.clock.advance(0.2)
        rig.port.pump(rig.clock())
        (ping,) = [message for message in rig.router.received_by(L) if isinstance(message, Ping)]
        rig.clock.advance(0.001)
        rig.router.send_from(L, Pong(ping.sent_ns, ping.sent_ns + 5_000_400_000, ping.sent_ns + 5_000_500_000))
        rig.port.read_if_needed(rig.clock())
    (probe,) = rig.port.clock_records(3)
    assert (probe.seq, probe.peer, probe.t3_ns - probe.t0_ns) == (3, "logger", 1_000_000)
    assert abs(probe.offset_ns - 5_000_000_000) <= probe.bound_ns < 1_000_000
    assert rig.port.links(rig.clock())[0].round_trip == pytest.approx(0.9e-3)


def test_port_is_read_every_tick_only_while_a_pong_is_expected(rig: Rig) -> None:
    rig.join(L)
    rig.clock.advance(PONG_WAIT_NS * 1e-9)
    rig.router.send_from(L, LogAck(0, 7, "a.mcap", 0))
    rig.port.read_if_needed(rig.clock())
    assert rig.port.free_bytes == 0
    rig.port.pump(rig.clock())
    assert rig.port.free_bytes == 7


def test_low_disk_space_is_reported_once(rig: Rig) -> None:
    rig.record(3)
    rig.join(L)
    for free in (LOW_BYTES, LOW_BYTES - 10**8, 10**8, LOW_BYTES + 1):
        rig.pump(L, LogAck(1, free, "a.mcap", 0))
        assert (rig.port.notice != "") == (free < LOW_BYTES)
    assert [details for name, details in rig.port.news if name == "logger_disk_low"] == [{"free_gb": "4.9"}]
