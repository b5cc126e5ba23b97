"""`netboard info` and `netboard recover` over real files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rehearsed
from netboard.base.config import Config, resolve
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.services.cli import app

runner = CliRunner()
TICKS = 700


@pytest.fixture(autouse=True)
def _run_in_wide_plain_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


@pytest.fixture
def writer(tmp_path: Path) -> RecordingWriter:
    """Writer of a recording that is flushed but not finished."""
    config = Config()
    welcome = Welcome(session="a1b2c3d4", protocol=1, server_ns=0, config=resolve(config))
    metadata = provenance(welcome, config, 1, 10**18, 0)
    unfinished = RecordingWriter(tmp_path / "S01.mcap", metadata, welcome.config, config.recording, 0)
    rows = np.zeros(TICKS, TICK)
    rows["tick"] = np.arange(TICKS)
    for row in rows:
        unfinished.write(TickRecord(row=row.tobytes()), int(row["tick"]), int(row["tick"]) * 1_000_000)
    unfinished.flush(TICKS * 1_000_000)
    return unfinished


def test_info_describes_a_recording(writer: RecordingWriter) -> None:
    writer.finish(TICKS * 1_000_000)
    result = runner.invoke(app, ["info", "S01.mcap"])
    assert result.exit_code == 0, result.exception
    account = f"{TICKS}: 0 to {TICKS - 1}"
    for words in ("S01, dyad D01, run a1b2c3d4", "dyadic, haptics on, 60 trials", "complete", str(TICKS), account):
        assert words in result.output


def test_recording_with_names_too_long_for_a_new_one_is_readable() -> None:
    """Earlier versions limited no name, and a participant's name is in no file name."""
    config = replace(rehearsed.config(), session=replace(rehearsed.config().session, participant_a="p" * 100))
    rehearsed.write(Path("S01.mcap"), rehearsed.rows(), config)
    result = runner.invoke(app, ["check", "S01.mcap"])
    assert (result.exit_code, "complete" in result.output) == (0, True), result.output
    with Recording(Path("S01.mcap")) as recording:
        assert recording.config == config


def test_info_marks_catch_trials() -> None:
    config = replace(rehearsed.config(), block=replace(rehearsed.config().block, catch=(2,)))
    rehearsed.write(Path("S01.mcap"), rehearsed.rows(), config)
    result = runner.invoke(app, ["info", "S01.mcap"])
    assert result.exit_code == 0, result.exception
    table = result.output.partition("Trials")[2].partition("Timing")[0]
    rows = [line.replace("│", " ").split() for line in table.splitlines()]
    assert {(row[0], row[-2]) for row in rows if row and row[0].isdigit()} == {("1", "test"), ("2", "catch")}


def test_info_of_an_unfinished_file_suggests_recover(writer: RecordingWriter) -> None:
    writer.abandon()
    result = runner.invoke(app, ["info", "S01.mcap.part"])
    assert result.exit_code == 1
    assert "netboard recover" in result.stderr


def test_recover_writes_a_complete_file_and_reports_losses(writer: RecordingWriter) -> None:
    writer.abandon()
    with Path("S01.mcap.part").open("ab") as file:
        file.write(b"torn")
    result = runner.invoke(app, ["recover", "S01.mcap.part", "-o", "whole.mcap"])
    assert result.exit_code == 0, result.exception
    assert result.output.startswith(f"whole.mcap: ticks 0 to {TICKS - 1}, 0 missing, {TICKS} messages\n")
    assert "lost: 4 bytes at" in result.output
    assert "recovered" in runner.invoke(app, ["info", "whole.mcap"]).output


def test_recover_never_overwrites_a_file(writer: RecordingWriter) -> None:
    writer.abandon()
    Path("whole.mcap").write_bytes(b"mine")
    assert runner.invoke(app, ["recover", "S01.mcap.part", "-o", "whole.mcap"]).exit_code == 2
    assert Path("whole.mcap").read_bytes() == b"mine"


def test_recover_of_a_folder_continues_after_an_unreadable_file(writer: RecordingWriter) -> None:
    writer.abandon()
    Path("torn.mcap.part").write_bytes(b"never was one")
    result = runner.invoke(app, ["recover", ".", "../" + Path.cwd().name])
    assert result.exit_code == 1
    assert result.stderr.count("netboard:") == 1
    assert result.output.startswith(f"S01.recovered.mcap: ticks 0 to {TICKS - 1}, 0 missing")
    assert "torn.mcap.part: not an MCAP file" in result.stderr


def test_recover_of_a_folder_leaves_out_what_was_recovered_before(writer: RecordingWriter) -> None:
    writer.abandon()
    assert runner.invoke(app, ["recover", "."]).exit_code == 0
    again = runner.invoke(app, ["recover", "."])
    assert (again.exit_code, again.output.partition(";")[0]) == (0, ".: nothing is left to recover in this folder")


def test_recover_refuses_one_output_for_several_files(writer: RecordingWriter) -> None:
    writer.abandon()
    result = runner.invoke(app, ["recover", "S01.mcap.part", "other.mcap.part", "-o", "whole.mcap"])
    assert result.exit_code == 2
    assert "--output: names one file" in result.stderr
    assert not Path("whole.mcap").exists()


def test_recover_reports_a_folder_with_nothing_to_recover(tmp_path: Path) -> None:
    result = runner.invoke(app, ["recover", str(tmp_path)])
    assert (result.exit_code, result.output) == (
        0,
        f"{tmp_path}: nothing is left to recover in this folder; for a damaged recording, name the file. A server "
        "leaves its .spill in the folder in which it was started\n",
    )
