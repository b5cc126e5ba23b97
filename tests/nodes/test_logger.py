"""The logger with a server in memory: over a lossy link, after a restart, and with a ring buffer that is too short."""

import errno
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes import FakeClock, FakeLogLink, FakeLogServer
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.base.tick import TICK
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Ping, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord, LogBatch, LogEnd, TickRecord
from netboard.nodes.logger.logger import Logger, fit_of
from netboard.recording.files.reader import Recording
from netboard.recording.format import partfile
from netboard.recording.integrity.account import NumberRange, account_of
from netboard.recording.recovery.recover import recover

CONFIG = '[session]\nname = "S07"\ndyad = "D03"\n'
UTC_NS = 1_790_000_000_000_000_000
SESSION = "c0ffee1234567890"


class Rig:
    """A server that makes a tick every millisecond, a link, and loggers that are started one after another."""

    def __init__(self, directory: Path, ticks: int, *, capacity: int = 100_000, flush_ms: float = 100.0) -> None:
        self.clock = FakeClock()
        self.server = FakeLogServer(SESSION, CONFIG, capacity, self.clock)
        self.link = FakeLogLink(self.server, self.clock, self.make_due_ticks)
        self.settings = Settings(directory=str(directory), flush_ms=flush_ms)
        self.ticks = ticks
        self.tick_count = self.event_count = 0
        self._began_ns = self.clock()

    def make_due_ticks(self) -> None:
        """Make the ticks that are due; an event with every tenth."""
        due = min(self.ticks, (self.clock() - self._began_ns) // 1_000_000)
        for k in range(self.tick_count, due):
            self.tick(k)
        self.tick_count = max(self.tick_count, due)
        if self.tick_count == self.ticks:
            self.server.end()

    def tick(self, k: int) -> None:
        row = np.zeros(1, TICK)
        row["tick"], row["time_ns"], row["z"] = k, self._began_ns + k * 1_000_000, k * 1e-6
        self.server.append(TickRecord(row.tobytes()))
        if k % 10 == 0:
            self.note(k, "tenth", {})

    def note(self, k: int, name: str, details: dict[str, str]) -> None:
        self.server.append(EventRecord(self.event_count, k, k, name, details))
        self.event_count += 1

    def logger(self, *, once: bool = True) -> Logger:
        return Logger(self.settings, self.link, once=once, clock=self.clock, wall_clock=lambda: UTC_NS)

    def stop_after(self, seconds: float) -> Callable[[], bool]:
        until = self.clock() + round(seconds * 1e9)
        return lambda: self.clock() >= until

    def step(self, logger: Logger, seconds: float) -> None:
        """Step a logger for a time, and leave it as it is then."""
        stop = self.stop_after(seconds)
        while not stop():
            logger.step()


def block_config(number: int) -> str:
    return f"{CONFIG}[block]\nnumber = {number}\nblocks = 3\n"


class BlockRig(Rig):
    """A rig for the blocks of a session, with these numbers of ticks: each begins with its event and a welcome."""

    def __init__(self, directory: Path, *ticks: int) -> None:
        super().__init__(directory, sum(ticks))
        self.begins = {sum(ticks[:number]): number + 1 for number in range(len(ticks))}
        self.server._welcome = self.welcome(1)
        self.welcomes: list[tuple[int, Welcome]] = []

    def welcome(self, number: int) -> Welcome:
        return Welcome(SESSION, PROTOCOL_VERSION, self.clock(), block_config(number))

    def tick(self, k: int) -> None:
        if k in self.begins:
            number = self.begins[k]
            self.welcomes.append((self.server.ring.next, self.welcome(number)))
            self.update_welcome()
            if self.server.greeted:
                self.link.inject(encode(self.server._welcome))
            self.note(k, BLOCK_BEGAN, {"config": block_config(number)})
        super().tick(k)

    def make_due_ticks(self) -> None:
        super().make_due_ticks()
        self.update_welcome()

    def update_welcome(self) -> None:
        """Like the server's port: welcome new loggers with the block of the first record that is not on disk yet."""
        for first, welcome in self.welcomes:
            if first <= self.server.ring.acknowledged:
                self.server._welcome = welcome


def ticks_of(*paths: Path) -> list[int]:
    numbers: list[int] = []
    for path in paths:
        with Recording(path) as recording:
            recording.check()
            numbers += recording.ticks()["tick"].tolist()
    return numbers


def never() -> bool:
    return False


def test_session_is_written_to_one_recording(tmp_path: Path) -> None:
    rig = Rig(tmp_path / "new" / "folder", 2000)
    logger = rig.logger()
    assert logger.run(never) == 0
    (path,) = logger.finished
    assert path.parent == tmp_path / "new" / "folder"
    assert path.name == "S07_D03_20260921T141320Z_c0ffee12.mcap"
    assert ticks_of(path) == list(range(2000))
    with Recording(path) as recording:
        assert [event.seq for event in recording.events()] == list(range(200))
        assert recording.config_text == CONFIG
        assert recording.end == recording.end | {"ended": "complete", "records": "2200", "lost": "0"}
        assert (recording.metadata["session"], recording.metadata["dyad"]) == (SESSION, "D03")
    assert rig.server.acks[-1].durable == rig.server.ring.next == 2200
    assert rig.server.goodbyes == ["the recording is complete"]


def require_blocks(paths: list[Path], *ends: tuple[int, int, str]) -> None:
    """Each file is of this block and part, has its configuration, and ended like this; their numbers go on."""
    following = 0
    for path, (number, part, ended) in zip(paths, ends, strict=True):
        suffix = f"_part{part}" if part > 1 else ""
        assert path.name == f"S07_D03_20260921T141320Z_c0ffee12_block{number:02d}{suffix}.mcap"
        with Recording(path) as recording:
            assert recording.config_text == block_config(number)
            assert (recording.metadata["block"], recording.metadata["part"]) == (str(number), str(part))
            assert (recording.end["ended"], recording.end["lost"], recording.gaps()) == (ended, "0", {})
            began = [event.details["config"] for event in recording.events() if event.name == BLOCK_BEGAN]
            assert began == ([block_config(number)] if part == 1 else [])
            assert recording.first_record == following
            following = int(recording.end["next_record"])


def test_each_block_has_its_own_recording(tmp_path: Path) -> None:
    rig = BlockRig(tmp_path, 700, 5, 800)
    logger = rig.logger()
    assert logger.run(never) == 0
    require_blocks(logger.finished, *((number, 1, "complete") for number in (1, 2, 3)))
    assert [len(ticks_of(path)) for path in logger.finished] == [700, 5, 800]
    assert ticks_of(*logger.finished) == list(range(1505))
    assert rig.server.acks[-1].durable == rig.server.ring.next
    assert rig.server.acks[-1].file == logger.finished[-1].name
    assert rig.server.goodbyes == ["the recording is complete"]
    account = account_of(logger.finished)
    assert account.present == (NumberRange(0, 1504),)
    assert (account.sound, account.complete) == (True, True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_lossy_link_leaves_no_gap_between_blocks(tmp_path: Path, seed: int) -> None:
    rig = BlockRig(tmp_path, 600, 600, 600)
    logger = rig.logger()
    while not rig.server.acks:
        logger.step()
    rig.link.random.seed(seed)
    rig.link.drop, rig.link.repeat, rig.link.reorder = 0.1, 0.1, 0.1
    assert logger.run(never) == 0
    require_blocks(logger.finished, *((number, 1, "complete") for number in (1, 2, 3)))
    assert ticks_of(*logger.finished) == list(range(1800))


@pytest.mark.parametrize("seconds", [0.5, 0.93, 1.02, 1.3])
def test_next_logger_continues_the_block_in_which_the_first_died(tmp_path: Path, seconds: float) -> None:
    rig = BlockRig(tmp_path, 500, 1000)
    victim = rig.logger()
    rig.step(victim, seconds)
    # It crashes here: nothing is closed, and unacknowledged records may be lost.
    (part,) = tmp_path.glob("*.part")
    crashed = tmp_path / "crashed.mcap.part"
    crashed.write_bytes(part.read_bytes())
    rig.link.hang_up()
    second = rig.logger()
    assert second.run(never) == 0
    block = 1 if seconds <= 0.5 else 2
    assert second.finished[0].name.endswith(f"_block{block:02d}_part2.mcap")
    with Recording(second.finished[0]) as recording:
        assert recording.config_text == block_config(block)
    account = account_of([recover(crashed).output, *victim.finished, *second.finished])
    assert account.present == (NumberRange(0, 1499),)
    assert (account.sound, account.complete) == (True, True)
    assert victim.run(lambda: True) == 0


def test_next_logger_continues_the_block_in_which_the_first_was_stopped(tmp_path: Path) -> None:
    rig = BlockRig(tmp_path, 500, 1000, 500)
    first = rig.logger()
    assert first.run(rig.stop_after(1.0)) == 0
    second = rig.logger()
    assert second.run(never) == 0
    require_blocks(
        [*first.finished, *second.finished],
        (1, 1, "complete"),
        (2, 1, "the logger was stopped"),
        (2, 2, "complete"),
        (3, 1, "complete"),
    )
    assert ticks_of(*first.finished, *second.finished) == list(range(2000))


def test_no_file_is_created_before_the_first_record(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 10**9)
    rig.link.live = lambda: None
    logger = rig.logger()
    assert logger.run(rig.stop_after(2.0)) == 0
    assert list(tmp_path.iterdir()) == []
    assert logger.finished == []


def test_only_records_on_disk_are_acknowledged(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 1000)
    logger = rig.logger()
    stop = rig.stop_after(0.5)
    while not stop():
        logger.step()
        part = next(iter(tmp_path.glob("*.part")), None)
        if part is not None and rig.server.acks:
            (tmp_path / "copy.mcap.part").write_bytes(part.read_bytes())
            report = recover(tmp_path / "copy.mcap.part")
            assert sum(report.messages.values()) >= rig.server.acks[-1].durable
            report.output.unlink()
            (tmp_path / "copy.mcap.part").unlink()
    assert len(rig.server.acks) >= 3
    assert all(ack.free_bytes > 0 for ack in rig.server.acks)
    assert logger.run(lambda: True) == 0


@pytest.mark.parametrize("seed", range(5))
def test_lossy_link_leaves_no_gap(tmp_path: Path, seed: int) -> None:
    rig = Rig(tmp_path, 1500)
    rig.link.random.seed(seed)
    rig.link.drop, rig.link.repeat, rig.link.reorder = 0.1, 0.1, 0.1
    logger = rig.logger()
    assert logger.run(never) == 0
    assert ticks_of(*logger.finished) == list(range(1500))
    with Recording(logger.finished[0]) as recording:
        assert recording.gaps() == {}
        assert recording.remarks() == ()
    assert len(rig.server.requests) > 1


def test_records_lost_from_the_ring_buffer_are_annotated(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3000, capacity=330)
    logger = rig.logger()
    assert logger.run(rig.stop_after(1.0)) == 0
    seen = ticks_of(*logger.finished)
    # No logger runs for a second; 1100 records are made, and the ring buffer holds 330.
    rig.clock.advance(1.0)
    rig.make_due_ticks()
    late_logger = rig.logger()
    assert late_logger.run(never) == 0
    with Recording(late_logger.finished[0]) as recording:
        (remark,) = recording.remarks()
        numbers = recording.ticks()["tick"].tolist()
        lost = int(remark.details["count"])
        assert remark.name == "log_lost"
        assert recording.end["lost"] == str(lost)
    assert int(remark.details["first"]) == len(seen) + len([k for k in seen if k % 10 == 0])
    assert numbers == list(range(numbers[0], 3000))
    assert len(seen) + (len(seen) + 9) // 10 + lost == numbers[0] + (numbers[0] + 9) // 10


def test_restarted_logger_continues_in_the_next_part(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 3000)
    first = rig.logger()
    assert first.run(rig.stop_after(1.0)) == 0
    second = rig.logger()
    assert second.run(never) == 0
    assert [path.name for path in (*first.finished, *second.finished)] == [
        "S07_D03_20260921T141320Z_c0ffee12.mcap",
        "S07_D03_20260921T141320Z_c0ffee12_part2.mcap",
    ]
    assert ticks_of(*first.finished, *second.finished) == list(range(3000))
    with Recording(first.finished[0]) as recording:
        assert recording.end["ended"] == "the logger was stopped"
    assert rig.server.goodbyes == ["the logger was stopped", "the recording is complete"]


def test_next_logger_continues_without_a_gap_after_a_crash(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 2000)
    victim = rig.logger()
    rig.step(victim, 0.93)
    # It crashes here: nothing is closed, and unacknowledged records may be lost.
    (part,) = tmp_path.glob("*.part")
    crashed = tmp_path / "crashed.mcap.part"
    crashed.write_bytes(part.read_bytes())
    second = rig.logger()
    assert second.run(never) == 0
    assert second.finished[0].name.endswith("_part2.mcap")
    saved = ticks_of(recover(crashed).output)
    rest = ticks_of(*second.finished)
    assert saved == list(range(len(saved)))
    assert rest == list(range(rest[0], 2000))
    assert rest[0] <= len(saved)
    assert victim.run(lambda: True) == 0


def test_new_session_of_a_restarted_server_gets_a_new_recording(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 10**9)
    logger = rig.logger(once=False)
    rig.step(logger, 0.5)
    # The server dies and comes back with another session; the line stays.
    rig.server = rig.link.server = FakeLogServer("beef567890", CONFIG, 100_000, rig.clock)
    rig.link.live = lambda: None
    rig.step(logger, 3.0)
    rig.server.append(EventRecord(0, 0, 0, "hello", {}))
    rig.server.end()
    rig.step(logger, 1.0)
    assert logger.run(lambda: True) == 0
    old, new = logger.finished
    with Recording(old) as recording:
        assert recording.end["ended"] == "the server began another session"
    with Recording(new) as recording:
        assert [event.name for event in recording.events()] == ["hello"]
        assert recording.metadata["session"] == "beef567890"


def test_logger_waits_for_the_server_and_the_next_session(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 300)
    rig.link.server = None
    logger = rig.logger(once=False)
    assert logger.run(rig.stop_after(2.0)) == 0
    assert list(tmp_path.iterdir()) == []
    rig.link.server = rig.server
    logger = rig.logger(once=False)
    assert logger.run(rig.stop_after(4.0)) == 0
    assert len(logger.finished) == 1
    assert ticks_of(*logger.finished) == list(range(300))


def test_session_without_records_ends_the_logger(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 0)
    logger = rig.logger()
    assert logger.run(never) == 0
    assert ticks_of(*logger.finished) == []


def test_second_logger_after_the_end_has_nothing_to_write(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 100)
    assert rig.logger().run(never) == 0
    second = rig.logger()
    assert second.run(never) == 0
    assert ticks_of(*second.finished) == []


def test_malformed_messages_and_refusals_are_ignored(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path, 1000)
    logger = rig.logger()
    stop = rig.stop_after(0.5)
    while not stop():
        logger.step()
        rig.link.inject(b"\x93nonsense")
        rig.link.inject(encode(Refusal("it has not joined yet")))
    assert logger.run(never) == 0
    assert ticks_of(*logger.finished) == list(range(1000))
    assert caplog.text.count("it has not joined yet") < 10


def test_unreadable_record_is_kept_as_an_annotation(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 0)
    rig.server.append(EventRecord(0, 0, 0, "one", {}))
    rig.server.ring.append(b"\x00\x01junk")
    rig.server.append(LogEnd(3))
    rig.server.append(EventRecord(1, 0, 0, "two", {}))
    logger = rig.logger()
    assert logger.run(never) == 0
    with Recording(logger.finished[0]) as recording:
        assert [event.name for event in recording.events()] == ["one", "two"]
        unreadable = [remark.details for remark in recording.remarks() if remark.name == "log_unreadable"]
        assert [(found["number"], found["hex"][:8]) for found in unreadable] == [
            ("1", "00016a75"),
            ("2", "9221" + "03"),
        ]
        assert recording.end["lost"] == "2"


def test_tick_of_another_version_ends_the_recording_cleanly(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path, 0)
    rig.server.append(EventRecord(0, 0, 0, "one", {}))
    rig.server.append(TickRecord(bytes(16)))
    logger = rig.logger()
    assert logger.run(never) == 1
    assert "different versions" in caplog.text
    with Recording(logger.finished[0]) as recording:
        assert [event.name for event in recording.events()] == ["one"]
        assert "different versions" in recording.end["ended"]
    assert "different versions" in rig.server.goodbyes[0]


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
def test_deleted_folder_ends_the_recording_without_loss(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path / "disk", 1000)
    logger = rig.logger()
    rig.step(logger, 0.5)
    for file in (tmp_path / "disk").iterdir():
        file.unlink()
    (tmp_path / "disk").rmdir()
    assert logger.run(never) == 1
    assert "was deleted while it was being written" in caplog.text
    (saved,) = logger.finished
    assert saved.exists()
    assert "was deleted" in rig.server.goodbyes[0]
    rig.settings = replace(rig.settings, directory=str(tmp_path / "elsewhere"))
    second = rig.logger()
    assert second.run(never) == 0
    account = account_of([saved, *second.finished])
    assert account.present == (NumberRange(0, 999),)
    assert account.sound
    assert account.complete


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
def test_deleted_folder_is_noticed_without_new_records(tmp_path: Path) -> None:
    rig = Rig(tmp_path / "disk", 1000)
    logger = rig.logger()
    rig.step(logger, 0.5)
    rig.link.live = lambda: None  # the server is suspended
    rig.step(logger, 0.5)
    shutil.rmtree(tmp_path / "disk")
    assert logger.run(rig.stop_after(3.0)) == 1
    (saved,) = logger.finished
    with Recording(saved) as recording:
        assert recording.counts["/ticks"] > 0
        assert "was deleted while it was being written" in recording.end["ended"]


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
def test_folder_deleted_before_the_first_record_is_recreated(tmp_path: Path) -> None:
    rig = Rig(tmp_path / "disk", 1000)
    live, rig.link.live = rig.link.live, lambda: None
    logger = rig.logger()
    rig.step(logger, 0.5)
    (tmp_path / "disk").rmdir()
    rig.link.live = live
    assert logger.run(never) == 0
    (path,) = logger.finished
    with Recording(path) as recording:
        assert recording.counts["/ticks"] == 1000


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be moved there")
def test_moved_folder_ends_the_recording_without_loss(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path / "disk", 1000)
    logger = rig.logger()
    rig.step(logger, 0.5)
    (tmp_path / "disk").rename(tmp_path / "moved")
    assert logger.run(never) == 1
    assert "the file itself is complete at its new place" in caplog.text
    second = rig.logger()
    assert second.run(never) == 0
    (moved,) = (tmp_path / "moved").iterdir()
    account = account_of([moved.rename(tmp_path / "found.mcap"), *second.finished])
    assert account.present == (NumberRange(0, 999),)
    assert account.sound


def test_uncreatable_folder_ends_the_logger(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").touch()
    rig = Rig(tmp_path / "file" / "folder", 10)
    assert rig.logger().run(never) == 1
    assert "cannot be made" in caplog.text


def test_folder_that_cannot_be_written_to_is_reported_before_there_is_a_server(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """It is needed only when the session begins; a disk may be mounted until then."""
    (tmp_path / "file").touch()
    rig = Rig(tmp_path / "file" / "folder", 10)
    rig.link.server = None
    logger = rig.logger()
    assert logger.run(rig.stop_after(0.1)) == 0
    assert f'"{rig.settings.directory}", expected a folder that can be written' in caplog.text
    (tmp_path / "file").unlink()
    rig.link.server = rig.server
    assert logger.run(never) == 0
    assert ticks_of(*logger.finished) == list(range(10))


@pytest.fixture
def free_space(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Free disk space [bytes], set by the test."""
    from collections import namedtuple

    usage = namedtuple("usage", "total used free")
    free = [20_000_000_000]
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(0, 0, free[0]))
    return free


def test_low_disk_space_is_logged_once(tmp_path: Path, free_space: list[int], caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path, 2000)
    logger = rig.logger()
    assert logger.run(rig.stop_after(0.5)) == 0
    assert "GB free" not in caplog.text
    free_space[0] = 4_900_000_000
    assert rig.logger().run(never) == 0
    assert caplog.text.count("only 4.9 GB free") == 1
    assert rig.server.acks[-1].free_bytes == 4_900_000_000


def test_logger_stops_before_the_disk_is_full_and_another_continues(
    tmp_path: Path, free_space: list[int], caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig(tmp_path, 2000)
    logger = rig.logger()
    rig.step(logger, 0.7)
    free_space[0] = 190_000_000
    assert logger.run(never) == 1
    assert "only 190 MB free: the recording had to end" in caplog.text
    assert rig.server.goodbyes == [f"{tmp_path}: only 190 MB free: the recording had to end"]
    assert rig.server.acks[-1].durable > 700
    with Recording(logger.finished[0]) as recording:
        assert recording.end["ended"] == rig.server.goodbyes[0]
    assert rig.logger().run(never) == 1
    assert "only 190 MB free, and a recording stops at 200 MB" in caplog.text
    assert len(list(tmp_path.iterdir())) == 1
    free_space[0] = 10**12
    rig.settings = replace(rig.settings, directory=str(tmp_path / "elsewhere"))
    second = rig.logger()
    assert second.run(never) == 0
    account = account_of([*logger.finished, *second.finished])
    assert account.present == (NumberRange(0, 1999),)
    assert account.sound


def test_full_disk_ends_the_logger_with_a_complete_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig(tmp_path, 2000)
    logger = rig.logger()
    rig.step(logger, 0.7)

    def refuse(*_: int) -> bool:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(partfile, "allocate", refuse)
    monkeypatch.setattr(partfile, "_RESERVE", 2**24)
    assert logger.run(never) == 1
    monkeypatch.undo()
    assert "cannot be written: No space left on device" in caplog.text
    assert "No space left" in rig.server.goodbyes[0]
    second = rig.logger()
    assert second.run(never) == 0
    account = account_of([*logger.finished, *second.finished])
    assert account.present == (NumberRange(0, 1999),)
    assert account.sound


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_failing_disk_leaves_a_part_file_to_recover(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path, 2000)
    logger = rig.logger()
    rig.step(logger, 0.7)
    assert logger._writer is not None
    with Path("/dev/full").open("wb") as full:
        os.dup2(full.fileno(), logger._writer._file._file.fileno())
    assert logger.run(never) == 1
    (part,) = tmp_path.iterdir()
    assert f"netboard recover {part}" in caplog.text
    second = rig.logger()
    assert second.run(never) == 0
    account = account_of([recover(part).output, *second.finished])
    assert account.present == (NumberRange(0, 1999),)
    assert account.sound


def test_ping_is_answered_immediately(tmp_path: Path) -> None:
    rig = Rig(tmp_path, 100)
    logger = rig.logger()
    rig.link.inject(encode(Ping(12345)))
    logger.step()
    (pong,) = rig.server.pongs
    assert pong.ping_ns == 12345
    assert pong.received_ns <= pong.sent_ns <= rig.clock()
    assert logger.run(never) == 0


@given(st.integers(0, 30), st.integers(0, 10), st.integers(0, 10), st.one_of(st.none(), st.integers(0, 40)))
def test_place_neither_repeats_nor_skips(first: int, lost: int, count: int, expected: int | None) -> None:
    batch = LogBatch(first, lost, (b"",) * count)
    placed = fit_of(batch, expected)
    if expected is None:
        assert placed == (lost, 0)
    elif placed is None:
        assert first - lost > expected
    else:
        missing, known = placed
        assert expected + missing == first + known
        assert missing <= lost
        assert not (missing and known)
