"""Lossless recording of a real session whose disk fails or whose logger is absent for a long time."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.control import Status
from netboard.recording.integrity.account import Account, account_of
from netboard.recording.recovery.spilled import recover_any

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(300)]

QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "block.trials=50",
    "network.log_ring_s=1",
    "network.sample_timeout_ms=1000",
)
"""The ball is released at once, the ring buffer soon overflows, and a slow machine does not pause the trial."""

FREE_BYTES = 230_000_000
FILLER_BYTES = 40_000_000
"""Size of a file that leaves less free space than a recording needs."""


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with Rig(tmp_path, QUICK_TRIALS) as rig:
        yield rig


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """The folder of the recordings, on a small file system of its own."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    mount = shutil.which("mount")
    if mount is None or os.name == "nt" or os.geteuid() != 0:
        pytest.skip("mounting needs root")
    options = ("-t", "tmpfs", "-o", f"size={FREE_BYTES}")
    if subprocess.run([mount, *options, "none", folder], check=False, capture_output=True).returncode:
        pytest.skip("mounting is not permitted")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def check_complete(account: Account) -> None:
    """Check that every tick up to the end is present and every pause has its cause."""
    assert account.sound, account
    assert (account.lost, account.lost_records) == ((), ()), account
    assert len(account.present) == 1
    assert account.present[0].first == 0
    assert "session_ended" in [event.name for event in account.events]


def recorded(status: Status) -> bool:
    """Whether a trial runs and the logger has reported a file on its disk, so that its folder exists."""
    return status.phase == "running" and any(size > 0 for _, _, size, _ in status.recordings)


@pytest.mark.sampled(0, of="longest")
def test_full_disk_ends_the_recording_and_pauses_the_trial_without_data_loss(rig: Rig, disk: Path) -> None:
    rig.start_all()
    rig.until(recorded)
    with (disk / "filler").open("wb") as file:
        file.write(bytes(FILLER_BYTES))
    assert rig.wait("logger") == 1
    assert "free: the recording had to end" in rig.output_of("logger")
    paused = rig.until(lambda s: s.phase == "paused")
    assert "the logger has left" in paused.notice
    assert "free: the recording had to end" in paused.notice
    elsewhere = rig.folder / "elsewhere"
    rig.start("logger", "logger", "--once", "--set", f"recording.directory={elsewhere}")
    rig.until(lambda s: s.phase == "running")
    first = rig.finish()
    assert not list(disk.glob("*.part"))
    account = account_of([*first, *elsewhere.glob("*.mcap")])
    check_complete(account)
    assert account.complete
    assert account.pauses
    (left, *_) = [event for event in account.events if event.name == "logger_left"]
    assert "free: the recording had to end" in left.details["reason"]


@pytest.mark.sampled(0, of="longest")
def test_deleted_folder_ends_the_recording_without_data_loss(rig: Rig) -> None:
    rig.start_all()
    rig.until(recorded)
    shutil.rmtree(rig.folder / "recordings")
    assert rig.wait("logger") == 1
    assert "was deleted while it was being written" in rig.output_of("logger")
    rig.until(lambda s: s.phase == "paused" and "was deleted" in s.notice)
    rig.start("logger", "logger", "--once")
    rig.until(lambda s: s.phase == "running")
    account = account_of(rig.finish())
    check_complete(account)
    assert len(account.parts) == 2


@pytest.mark.sampled(0, of="longest")
def test_records_without_a_logger_are_spilled_and_recovered(rig: Rig) -> None:
    rig.start_all()
    status = rig.until(lambda s: s.phase == "running")
    rig.kill("logger")
    status = rig.until(lambda s: "no logger is connected" in s.notice)
    (spill,) = rig.folder.glob("*.spill")
    rig.until(lambda s: s.tick > status.tick + 2000)
    rig.start("logger", "logger", "--once")
    rig.until(lambda s: not spill.exists())
    rig.kill("logger")
    last = rig.until(lambda s: spill.exists())
    assert rig.stop("server") == 1
    assert f"{spill}: netboard recover" in rig.output_of("server")
    unfinished = sorted((rig.folder / "recordings").glob("*.part"))
    assert len(unfinished) == 2
    reports = (report for path in (*unfinished, spill) for report in recover_any(path))
    account = account_of([report.output for report in reports])
    check_complete(account)
    assert account.present[0].last >= last.tick > status.tick + 2000
