"""Processes that ran instead of the server, from a real kernel trace with an interfering program.

A program with SCHED_FIFO priority 75 took core 1, the server's, for 4 ms every half second. Its process was 13823.
"""

from pathlib import Path

import pytest
from staged_timing import MS, START, Staged
from typer.testing import CliRunner

import rehearsed
from netboard.base.errors import RecordingError
from netboard.recording.timing.scheduler import ran_instead, read
from netboard.services.cli import app

TEXT = Path(__file__).parent.parent / "data" / "sched_switch.txt"
DUE_NS, BEGAN_NS = 62_132_444_863_519, 62_132_448_682_159
"""Deadline and start of the tick, by the recording of that demo [ns]."""

MAX_NS = 448_650_000 - 444_863_519
"""From the deadline to the switch of core 1 away from that program [ns]."""

runner = CliRunner()


def test_program_that_ran_instead_is_named() -> None:
    took = ran_instead(read(TEXT), DUE_NS, BEGAN_NS)
    assert took is not None
    thread, longest_ns = took.most_common(1)[0]
    assert thread == "python (13823)"
    assert longest_ns == pytest.approx(MAX_NS, abs=1000)
    assert took.total() <= BEGAN_NS - DUE_NS


def test_time_outside_of_the_trace_is_unknown() -> None:
    switches = read(TEXT)
    assert ran_instead(switches, DUE_NS - 1000 * MS, BEGAN_NS) is None
    assert ran_instead(switches, BEGAN_NS + 500 * MS, BEGAN_NS + 501 * MS) is None


def test_file_that_is_not_a_trace_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read"):
        read(tmp_path / "nowhere")
    (tmp_path / "empty.txt").write_text("# tracer: nop\n")
    with pytest.raises(
        RecordingError, match="found no sched_switch event, expected the text of /sys/kernel/tracing/trace"
    ):
        read(tmp_path / "empty.txt")


def test_trace_command_lists_the_program_that_ran_instead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    stall = (399_600_000, 400 * MS + BEGAN_NS - DUE_NS)
    rows = Staged(500, server=[stall]).rows()
    for name in ("time_ns", "left_stamp_ns", "right_stamp_ns"):
        rows[name] += DUE_NS - START - 400 * MS
    rehearsed.write(tmp_path / "S01.mcap", rows)
    result = runner.invoke(app, ["trace", str(tmp_path / "S01.mcap"), "--scheduler", str(TEXT)])
    assert result.exit_code == 0, result.output
    line = next(line for line in result.output.splitlines() if "13823" in line)
    assert line.split()[0] == "470"
    assert "python (13823) 3." in line
