"""A full disk (a real one if mounting is permitted): the written part is a complete recording."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from netboard.base.errors import RecordingError
from netboard.base.system.c_library import allocate
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.recording.files.reader import Recording
from netboard.recording.format import partfile
from netboard.recording.format.disk import (
    LOW_BYTES,
    LOW_S,
    MIN_BYTES,
    MIN_S,
    STEP_NS,
    DiskUse,
    Space,
    require_space,
)
from netboard.recording.recovery.recover import recover
from samples import MS, OPENED_NS, fill, new_writer, random_rows, records, write_recording

ROWS = random_rows(3000)
MEGABYTE = 2**20


def test_space_is_judged_by_bytes_and_by_remaining_time() -> None:
    assert not Space(LOW_BYTES, LOW_S).low
    assert Space(LOW_BYTES - 1, LOW_S).low
    assert Space(LOW_BYTES, LOW_S - 1).low
    assert not Space(MIN_BYTES, MIN_S).out
    assert Space(MIN_BYTES - 1, MIN_S).out
    assert Space(MIN_BYTES, MIN_S - 1).out
    assert str(Space(12_340_000_000, float("inf"))) == "12.3 GB free"
    assert str(Space(150_000_000, 600.0)) == "150 MB free, for 10 min"


def test_disk_use_rate_covers_the_last_minute() -> None:
    consumption = DiskUse()
    rate, free = 2_000_000, 10**9
    for second in range(300):
        space = consumption.judge(second * 10**9, min(second, 150) * rate, free)
        if second < 55:
            assert space.seconds == float("inf")
        elif second <= 150:
            assert space.seconds == pytest.approx(free / rate)
    assert space.seconds == float("inf")


def test_short_burst_does_not_set_the_rate() -> None:
    consumption = DiskUse()
    written = 0
    for tenth in range(500):
        written += 10**7
        assert not consumption.judge(tenth * STEP_NS // 50, written, 10**9).out


def test_recording_does_not_start_on_a_full_disk(tmp_path: Path) -> None:
    require_space(tmp_path, MIN_BYTES)
    with pytest.raises(RecordingError, match="only 200 MB free, and a recording stops at 200 MB"):
        require_space(tmp_path, MIN_BYTES - 1)


def test_reserved_space_is_released_when_the_recording_finishes(tmp_path: Path) -> None:
    with (tmp_path / "a").open("wb") as file:
        file.write(b"begun")
        file.flush()
        offered = allocate(file.fileno(), 5, 4 * MEGABYTE)
    if not offered:
        pytest.skip("this file system cannot keep room")
    status = (tmp_path / "a").stat()
    assert status.st_size == 5
    assert status.st_blocks * 512 >= 4 * MEGABYTE
    writer = new_writer(tmp_path / "b.mcap")
    fill(writer, ROWS[:200])
    assert (tmp_path / "b.mcap.part").stat().st_blocks * 512 >= 8 * MEGABYTE
    writer.finish(OPENED_NS)
    assert (tmp_path / "b.mcap").stat().st_blocks * 512 < MEGABYTE


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 12 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if mount is None or os.name == "nt" or os.geteuid() != 0:
        pytest.skip("mounting needs root")
    if subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=12m", "none", folder], check=False, capture_output=True
    ).returncode:
        pytest.skip("mounting is not permitted")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def occupy(folder: Path) -> None:
    """Fill the remaining space with another file."""
    with (folder / "somebody").open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(65_536))
        except OSError:
            pass


def record_until_full(path: Path, before: int) -> tuple[int | None, RecordingError]:
    """Record while the disk fills up until a write fails; return the durable count and the error."""
    writer = new_writer(path, Settings(flush_ms=10.0))
    durable: int | None = None
    now = OPENED_NS
    try:
        for number, record in enumerate(records(ROWS)):
            now += MS
            writer.write(record, number, now)
            if writer.is_due(now):
                durable = writer.flush(now)
            if number == before:
                occupy(path.parent)
    except RecordingError as error:
        if writer.is_open:
            writer.finish(now, str(error))
        return durable, error
    raise AssertionError("no write failed")


def test_recording_on_a_disk_that_fills_up_is_finished_properly(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(partfile, "_RESERVE", MEGABYTE)
    durable, error = record_until_full(small_disk / "a.mcap", 500)
    assert "No space left" in str(error)
    assert sorted(file.name for file in small_disk.iterdir()) == ["a.mcap", "somebody"]
    with Recording(small_disk / "a.mcap") as recording:
        recording.check()
        ticks = recording.ticks()
        assert int(recording.end["next_record"]) >= (durable or 0) >= 500
        assert "No space left" in recording.end["ended"]
    assert ticks.tobytes() == ROWS[: len(ticks)].tobytes()


def test_without_reserved_space_the_part_is_recoverable_to_its_last_chunk(
    small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(partfile, "allocate", lambda *_: False)
    durable, error = record_until_full(small_disk / "a.mcap", 500)
    assert "No space left" in str(error)
    report = recover(small_disk / "a.mcap.part", tmp_path / "whole.mcap")
    assert report.damage == ()
    assert sum(report.messages.values()) >= (durable or 0) >= 500
    with Recording(report.output) as recording:
        assert np.array_equal(recording.ticks()["tick"], np.arange(report.messages["/ticks"]))


def test_recording_that_cannot_start_leaves_no_file(small_disk: Path) -> None:
    occupy(small_disk)
    with pytest.raises(RecordingError, match="No space left"):
        new_writer(small_disk / "a.mcap")
    assert [file.name for file in small_disk.iterdir()] == ["somebody"]


@pytest.mark.skipif(os.name == "nt", reason="no such limit there")
def test_part_at_the_file_size_limit_is_recoverable_to_its_last_chunk(tmp_path: Path) -> None:
    """A substitute for a full disk without root rights: a file size limit of the kernel."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limits[1]))
    try:
        durable, error = record_until_full(tmp_path / "a.mcap", -1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "File too large" in str(error)
    assert (tmp_path / "a.mcap.part").stat().st_size < 200_000
    report = recover(tmp_path / "a.mcap.part")
    assert report.damage == ()
    assert sum(report.messages.values()) >= (durable or 0) > 100


@pytest.mark.skipif(os.name == "nt", reason="no such limit there")
def test_recovery_at_the_file_size_limit_names_its_output_and_leaves_nothing(tmp_path: Path) -> None:
    import resource

    whole = write_recording(tmp_path / "whole.mcap", random_rows(500))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (whole.stat().st_size // 2, limits[1]))
    try:
        with pytest.raises(RecordingError, match=r"/out\.mcap: cannot be written: File too large"):
            recover(whole, tmp_path / "out.mcap")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == [whole]
