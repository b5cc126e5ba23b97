"""The journal's file: reported entries are on disk through disk faults, kills and cuts."""

import errno
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.experiment import Session
from netboard.recording.recovery import journal_file as module
from netboard.recording.recovery.journal_file import Journal, journal_path
from netboard.task.journal.entries import AttemptEnded, BlockEnded, Entry, Note, Opened, read_lines
from session_model import HEADER

TESTS = Path(__file__).parents[1]
ENTRIES: list[Entry] = [Opened("r1", {"dyad": "D03"}), *(Note(f"note {k}", "r1", k) for k in range(30))]


def entries_in(path: Path) -> tuple[Entry, ...]:
    return read_lines(path.read_bytes(), str(path)).entries


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recordings" / "D03_S01.journal.jsonl"


@pytest.fixture
def journal(path: Path) -> Iterator[Journal]:
    made = Journal.create(path, HEADER)
    yield made
    made.close()


def test_journal_path_has_dyad_and_session() -> None:
    config = Config(session=Session(name="S02", dyad="D07"))
    assert journal_path(Path("recordings"), config) == Path("recordings/D07_S02.journal.jsonl")


def test_new_journal_has_its_header_at_once(journal: Journal, path: Path) -> None:
    lines = read_lines(path.read_bytes(), str(path))
    assert (lines.header, lines.entries, lines.torn) == (HEADER, (), b"")
    assert (journal.durable, journal.appended, journal.trouble) == (0, 0, "")


def test_entries_are_on_disk_in_order_after_close(journal: Journal, path: Path) -> None:
    for entry in ENTRIES:
        journal.append(entry)
    assert journal.appended == len(ENTRIES)
    journal.close()
    journal.close()
    assert entries_in(path) == tuple(ENTRIES)
    assert journal.durable == len(ENTRIES)


def test_every_line_has_a_time_stamp(journal: Journal, path: Path) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    times = [json.loads(line)["at"] for line in path.read_text(encoding="utf-8").splitlines()]
    assert times == sorted(times)
    assert all(time.endswith("Z") and "T" in time for time in times)


def test_existing_journal_is_never_overwritten(journal: Journal, path: Path) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    before = path.read_bytes()
    with pytest.raises(ConfigError, match=r"D03_S01\.journal\.jsonl: already exists.*netboard server --resume"):
        Journal.create(path, HEADER)
    assert path.read_bytes() == before


def test_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "recordings").write_text("a file")
    with pytest.raises(RecordingError, match="cannot be written"):
        Journal.create(tmp_path / "recordings" / "a.journal.jsonl", HEADER)


def test_reopened_journal_continues_after_its_entries(journal: Journal, path: Path) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    again, header, entries, torn = Journal.reopen(path)
    assert (header, entries, torn) == (HEADER, (ENTRIES[0],), b"")
    assert (again.durable, again.appended) == (1, 1)
    again.append(ENTRIES[1])
    again.close()
    assert entries_in(path) == tuple(ENTRIES[:2])
    assert again.durable == 2


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks")
def test_journal_of_a_running_server_is_refused_to_another(journal: Journal, path: Path) -> None:
    for _ in range(2):
        with pytest.raises(RecordingError, match="another server runs this session; end it first"):
            Journal.reopen(path)
    journal.append(ENTRIES[0])
    journal.close()
    again, _, entries, _ = Journal.reopen(path)
    assert entries == (ENTRIES[0],)
    with pytest.raises(RecordingError, match="another server runs this session"):
        Journal.reopen(path)
    again.close()


def test_reopening_a_missing_journal_is_refused(path: Path) -> None:
    with pytest.raises(RecordingError, match=r"this session was never started \(leave out --resume\), or its form"):
        Journal.reopen(path)


def test_reopening_a_damaged_journal_is_refused(journal: Journal, path: Path) -> None:
    for entry in ENTRIES:
        journal.append(entry)
    journal.close()
    damaged = path.read_bytes().replace(b'"note 7"', b'"note 7')
    path.write_bytes(damaged)
    with pytest.raises(RecordingError, match=r"journal\.jsonl, line 10: is damaged"):
        Journal.reopen(path)
    assert path.read_bytes() == damaged


@given(cut=st.integers(0, 10**6), count=st.integers(0, 3))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_truncated_journal_continues_after_its_last_complete_line(tmp_path: Path, cut: int, count: int) -> None:
    path = tmp_path / "cut.journal.jsonl"
    path.unlink(missing_ok=True)
    journal = Journal.create(path, HEADER)
    head = path.stat().st_size
    for entry in ENTRIES[:6]:
        journal.append(entry)
    journal.close()
    os.truncate(path, head + cut % (path.stat().st_size - head + 1))
    kept = entries_in(path)
    assert list(kept) == ENTRIES[: len(kept)]
    again, _, entries, _ = Journal.reopen(path)
    assert entries == kept
    for entry in ENTRIES[:count]:
        again.append(entry)
    again.close()
    assert entries_in(path) == (*kept, *ENTRIES[:count])


def test_torn_line_is_reported_and_overwritten_by_the_next_entry(
    journal: Journal, path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    with path.open("ab") as file:
        file.write(b'{"entry":"note","text":"' + b"long" * 200)
    torn = path.read_bytes()
    with caplog.at_level(logging.WARNING):
        again, _, _, rest = Journal.reopen(path)
    assert rest.startswith(b'{"entry":"note"')
    assert "its last line is incomplete" in caplog.text
    assert path.read_bytes() == torn, "reopening alone changed the file"
    again.append(ENTRIES[1])
    again.close()
    assert entries_in(path) == tuple(ENTRIES[:2])


def test_invalid_entry_raises_in_the_caller(journal: Journal, path: Path) -> None:
    with pytest.raises(ValueError, match="Out of range"):
        journal.append(AttemptEnded(1, 1, 1, "success", float("nan"), (), 0, False, "r1", 0, 0))
    journal.append(BlockEnded(1, "stopped"))
    journal.close()
    assert entries_in(path) == (BlockEnded(1, "stopped"),)


def test_entry_is_durable_only_after_fsync(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal.create(path, HEADER)
    synced: list[tuple[int, int]] = []
    sync = os.fsync

    def watched(handle: int) -> None:
        sync(handle)
        synced.append((path.read_bytes().count(b"\n") - 1, journal.durable))

    monkeypatch.setattr(os, "fsync", watched)
    for entry in ENTRIES:
        journal.append(entry)
    journal.close()
    assert synced == [(number + 1, number) for number in range(len(ENTRIES))]


class FaultyDisk:
    """Refuses some writes, and may leave part of a line behind."""

    def __init__(self, refusals: int) -> None:
        self.refusals = refusals
        self.sound = module._write

    def write(self, handle: int, place: int, line: bytes) -> None:
        if self.refusals > 0:
            self.refusals -= 1
            os.lseek(handle, place, os.SEEK_SET)
            os.write(handle, line[: len(line) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        self.sound(handle, place, line)


def test_temporary_disk_error_is_retried_and_logged_once(
    journal: Journal, path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "RETRY_SECONDS", 0.001)
    disk = FaultyDisk(1)
    monkeypatch.setattr(module, "_write", disk.write)
    for entry in ENTRIES:
        journal.append(entry)
    journal.close()
    assert entries_in(path) == tuple(ENTRIES)
    assert journal.trouble == ""
    assert caplog.text.count("cannot be written: No space left on device") == 1


def test_permanent_disk_error_is_raised_on_close(journal: Journal, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    monkeypatch.setattr(module, "RETRY_SECONDS", 0.001)
    again, *_ = Journal.reopen(path)
    monkeypatch.setattr(module, "_write", FaultyDisk(10**9).write)
    for entry in ENTRIES[1:4]:
        again.append(entry)
    with pytest.raises(RecordingError, match="No space left on device; 3 of 4 entries are not on disk"):
        again.close()
    assert again.durable == 1
    assert "No space left on device" in again.trouble
    assert entries_in(path) == (ENTRIES[0],)


@pytest.mark.skipif(sys.platform == "win32", reason="an open file cannot be deleted there")
def test_deleted_journal_is_written_again(journal: Journal, path: Path) -> None:
    journal.append(ENTRIES[0])
    journal.close()
    again, *_ = Journal.reopen(path)
    path.unlink()
    path.parent.rmdir()
    again.append(ENTRIES[1])
    again.append(ENTRIES[2])
    again.close()
    assert entries_in(path) == tuple(ENTRIES[:3])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs fork")
def test_fifty_kills_lose_no_durable_entry(path: Path) -> None:
    path.parent.mkdir()
    ran = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("killed_journals.py")), str(path), "50", "1"],
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(TESTS)},
    )
    assert ran.returncode == 0, ran.stderr
    rounds = [json.loads(line) for line in ran.stdout.splitlines()]
    assert len(rounds) == 50
    assert rounds[-1]["entries"] > 50
    assert any(found["under way"] for found in rounds)
