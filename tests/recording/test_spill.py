"""The spill: all records are returned in order through disk faults, and no caller waits."""

import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.records import EventRecord, LogBatch
from netboard.recording.recovery import spill as module
from netboard.recording.recovery.recover import require_finished
from netboard.recording.recovery.spill import MAGIC, MAX_WAITING, OPENED, Spill, read_spill, spill_path

WELCOME = Welcome("c0ffee1234567890", PROTOCOL_VERSION, 17, '[session]\nname = "S07"\n')
PLENTY = 10**8


def record(number: int) -> bytes:
    return number.to_bytes(4, "big") * (1 + number % 5)


def batch(first: int, stop: int) -> LogBatch:
    return LogBatch(first, 0, tuple(map(record, range(first, stop))))


def settle(spill: Spill) -> None:
    """Wait until the thread has processed its queue."""
    if spill.closed:
        return
    done = Event()

    class Signal(list):  # type: ignore[type-arg]
        def __iter__(self) -> Iterator[object]:
            done.set()
            return iter(())

    for _ in range(2):  # what is written after the first is done before the second
        done.clear()
        spill._wanted.put(Signal())
        assert done.wait(30)


def finish(spill: Spill, rest: Iterator[LogBatch] | None = None) -> None:
    spill.close(rest)
    if spill._thread is not None:
        spill._thread.join(30)
    assert spill.closed


def taken(spill: Spill, cursor: int) -> tuple[list[bytes], int]:
    """All records from a number on, as a logger gets them, and the number of lost ones."""
    got: list[bytes] = []
    lost = 0
    for _ in range(10_000):
        if cursor >= spill.next:
            return got, lost
        part = spill.batch(cursor)
        if part is None:
            settle(spill)
            continue
        assert part.first == cursor + part.lost
        got += part.records
        lost += part.lost
        cursor = part.first + len(part.records)
    raise AssertionError("the spill never ended")


@pytest.fixture
def spill(tmp_path: Path) -> Iterator[Spill]:
    spill = Spill(tmp_path / "a.spill", WELCOME, PLENTY)
    yield spill
    finish(spill)


def test_spill_creates_no_file_until_needed(spill: Spill) -> None:
    assert (spill.next, spill.held, spill.refusal) == (0, 0, "")
    assert spill.closed
    assert not spill.path.exists()


def test_spilled_records_come_out_in_order(spill: Spill) -> None:
    for first in range(100, 2000, 50):
        spill.put(batch(first, first + 50))
        if first % 400 == 0:
            settle(spill)
    assert (spill.next, spill.held) == (2000, 1900)
    assert taken(spill, 100) == ([record(k) for k in range(100, 2000)], 0)
    assert taken(spill, 1777) == ([record(k) for k in range(1777, 2000)], 0)
    assert taken(spill, 40) == ([record(k) for k in range(100, 2000)], 60)


def test_only_the_owner_may_read_the_spill(spill: Spill) -> None:
    spill.put(batch(0, 10))
    settle(spill)
    assert stat.S_IMODE(spill.path.stat().st_mode) == 0o600


@pytest.mark.skipif(sys.platform == "win32", reason="there are no advisory locks on Windows")
def test_spill_of_a_running_server_is_not_recovered(spill: Spill) -> None:
    spill.put(batch(0, 10))
    settle(spill)
    with pytest.raises(RecordingError, match="is still being written"):
        require_finished(spill.path)


def test_spill_file_is_removed_once_logged_and_created_again(spill: Spill) -> None:
    for first in (0, 50, 100):
        spill.put(batch(first, first + 50))
    settle(spill)
    spill.forget(120)
    assert (spill.held, spill.path.exists()) == (50, True)
    spill.forget(150)
    settle(spill)
    assert (spill.next, spill.path.exists()) == (0, False)
    spill.put(batch(300, 310))
    settle(spill)
    assert taken(spill, 300) == ([record(k) for k in range(300, 310)], 0)
    assert spill.path.exists()


def test_records_may_be_forgotten_before_they_are_written(spill: Spill) -> None:
    for round_ in range(20):
        spill.put(batch(10 * round_, 10 * round_ + 10))
        spill.forget(10 * round_ + 10)
    spill.put(batch(500, 520))
    settle(spill)
    assert taken(spill, 500) == ([record(k) for k in range(500, 520)], 0)


def test_spill_refuses_records_beyond_its_size(tmp_path: Path) -> None:
    spill = Spill(tmp_path / "a.spill", WELCOME, 2000)
    first = 0
    while not spill.refusal:
        spill.put(batch(first, first + 20))
        first += 20
    assert "log_spill_mb" in spill.refusal
    settle(spill)
    assert 2000 <= spill.path.stat().st_size < 2500
    assert taken(spill, 0) == ([record(k) for k in range(first)], 0)
    spill.forget(first)
    assert spill.refusal == ""
    spill.put(batch(5000, 5010))
    assert taken(spill, first) == ([record(k) for k in range(5000, 5010)], 5000 - first)
    finish(spill)
    none = Spill(tmp_path / "b.spill", WELCOME, 0)
    assert "is 0" in none.refusal
    finish(none, iter([batch(0, 1)]))
    assert not none.path.exists()


def test_disk_error_is_retried_without_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "RETRY_SECONDS", 0.001)
    folder = tmp_path / "not there yet"
    spill = Spill(folder / "a.spill", WELCOME, PLENTY)
    first = 0
    while not spill.refusal:
        spill.put(batch(first, first + 10))
        first += 10
    assert first == 10 * MAX_WAITING
    settle(spill)
    assert spill.refusal == spill.trouble == "No such file or directory"
    assert caplog.text.count("No such file") == 1
    assert taken(spill, 0) == ([record(k) for k in range(first)], 0)
    folder.mkdir()
    while spill.refusal:
        settle(spill)
    spill.put(batch(first, first + 10))
    assert taken(spill, 0) == ([record(k) for k in range(first + 10)], 0)
    settle(spill)
    assert spill.trouble == ""
    finish(spill)
    assert messages(spill.path)[2:] == [batch(k, k + 10) for k in range(0, first + 10, 10)]


def test_spill_never_overwrites_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.spill").write_bytes(b"precious")
    spill = Spill(tmp_path / "a.spill", WELCOME, PLENTY)
    spill.put(batch(0, 10))
    finish(spill)
    assert spill.trouble == "File exists"
    assert spill.held == 0
    assert (tmp_path / "a.spill").read_bytes() == b"precious"


def test_unreadable_block_is_a_gap(spill: Spill) -> None:
    for first in (0, 50, 100):
        spill.put(batch(first, first + 50))
    settle(spill)
    data = bytearray(spill.path.read_bytes())
    _, (start, stop, _), _ = [*read_spill(data)][2:]
    data[(start + stop) // 2] ^= 1
    spill.path.write_bytes(data)
    got, lost = taken(spill, 0)
    assert got == [record(k) for k in (*range(50), *range(100, 150))]
    assert lost == 50
    assert "records 50 to 99" in spill.trouble


def messages(path: Path) -> list[Message | None]:
    return [message for _, _, message in read_spill(path.read_bytes())]


def test_remaining_spill_holds_the_welcome_and_all_records(tmp_path: Path) -> None:
    spill = Spill(tmp_path / "a.spill", WELCOME, PLENTY)
    spill.put(batch(0, 10))
    finish(spill, iter([batch(10, 30), batch(30, 31)]))
    assert spill.held == 31
    assert spill.path.read_bytes().startswith(MAGIC)
    welcome, opened, *batches = messages(spill.path)
    assert welcome == WELCOME
    assert isinstance(opened, EventRecord)
    assert (opened.name, opened.time_ns) == (OPENED, WELCOME.server_ns)
    assert int(opened.details["utc_ns"]) > 1.7e18
    assert batches == [batch(0, 10), batch(10, 30), batch(30, 31)]


def test_closing_an_empty_spill_leaves_no_file(tmp_path: Path) -> None:
    spill = Spill(tmp_path / "a.spill", WELCOME, PLENTY)
    spill.put(batch(0, 10))
    settle(spill)
    spill.forget(10)
    finish(spill)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
def test_deleted_spill_is_reported_as_empty(tmp_path: Path) -> None:
    spill = Spill(tmp_path / "a.spill", WELCOME, PLENTY)
    spill.put(batch(0, 10))
    settle(spill)
    spill.path.unlink()
    assert taken(spill, 0) == ([record(k) for k in range(10)], 0)
    finish(spill)
    assert (spill.held, spill.trouble) == (0, "was deleted")


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200), st.integers(0, 10**6))
def test_noise_in_a_spill_costs_no_block_before_it(noise: bytes, place: int) -> None:
    batches = [batch(k, k + 5) for k in range(0, 20, 5)]
    blocks = [module.block_of(encode(each)) for each in batches]
    whole = MAGIC + b"".join(blocks)
    cut = len(MAGIC) + place % (len(whole) - len(MAGIC))
    data = whole[:cut] + noise + whole[cut:]
    read = list(read_spill(data))
    ends = [len(MAGIC), *(end for _, end, _ in read)]
    assert [start for start, _, _ in read] == ends[:-1]
    assert ends[-1] == len(data)
    before = sum(len(MAGIC) + len(b"".join(blocks[: k + 1])) <= cut for k in range(4))
    found = [message for _, _, message in read if message is not None]
    assert found[:before] == batches[:before]
    assert set(found) <= set(batches)


def test_spill_name_has_session_dyad_and_id() -> None:
    path = spill_path(Config(), WELCOME.session)
    assert path.is_absolute()
    assert path.name == "S01_D01_c0ffee12.spill"


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_spill_goes_to_a_folder_that_can_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Records that no logger took are not lost with a server that was started in a read-only folder."""
    monkeypatch.chdir("/proc")  # where root, too, cannot create files
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert spill_path(Config(), WELCOME.session).parent == tmp_path
    there = replace(Config(), recording=replace(Config().recording, directory=str(tmp_path.parent)))
    assert spill_path(there, WELCOME.session).parent == tmp_path.parent
