"""The commands check, sessions and whatif with printed and JSON output."""

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import rehearsed
from netboard.services.cli import app

pytestmark = pytest.mark.slow
runner = CliRunner()


@pytest.fixture(autouse=True)
def _run_in_folder_with_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")
    Path("recordings").mkdir()
    rehearsed.write(Path("recordings/whole.mcap"), rehearsed.rows())


def test_check_reports_checksums_trials_and_speed() -> None:
    result = runner.invoke(app, ["check", "recordings/whole.mcap", "--verify"])
    assert result.exit_code == 0, result.output
    for words in (
        "whole.mcap: complete",
        "every checksum is right",
        "2 of the block's 2 trials done",
        "identical",
        "x real time",
    ):
        assert words in result.output


def test_check_exits_with_the_code_of_the_worst_recording() -> None:
    rehearsed.write(Path("recordings/early.mcap"), rehearsed.rows()[:-2000])
    assert runner.invoke(app, ["check", "recordings"]).exit_code == 3
    Path("recordings/cut.mcap").write_bytes(Path("recordings/whole.mcap").read_bytes()[:-9])
    result = runner.invoke(app, ["check", "recordings", "--json", "--verify"])
    assert result.exit_code == 1
    report = json.loads(result.stdout)
    assert report["verdict"] == "damaged"
    assert [entry["verdict"] for entry in report["recordings"]] == [
        "damaged",
        "complete with listed losses",
        "complete",
    ]
    assert report["recordings"][2]["replay"]["identical"] is True
    assert report["recordings"][0]["replay"] is None


def test_recording_that_is_named_twice_is_checked_once() -> None:
    result = runner.invoke(app, ["check", "recordings/whole.mcap", "recordings", str(Path.cwd())])
    assert "every checksum is right" in result.output  # the full report of a single file
    assert "1 recording: 1 complete" in result.output


@pytest.mark.parametrize("command", ["check", "sessions"])
def test_copies_of_a_recording_are_pointed_out(command: str) -> None:
    shutil.copy("recordings/whole.mcap", "recordings/copy.mcap")
    about = "is a copy of recordings/copy.mcap (with the same ticks), so its trials count once"
    line = f"recordings/whole.mcap: {about}\n"
    result = runner.invoke(app, [command, "recordings"])
    assert result.exit_code == 0
    assert result.stdout.endswith(line)
    as_json = runner.invoke(app, [command, "recordings", "--json"])
    assert json.loads(as_json.stdout)
    assert as_json.stderr.endswith(line)


def test_imported_copy_counts_once_in_every_command() -> None:
    """Whoever imports an exported table, perhaps to try it, has the block twice."""
    assert runner.invoke(app, ["export", "recordings", "--to", "csv", "-o", "out"]).exit_code == 0
    assert runner.invoke(app, ["import", "out/ticks/whole.csv"]).exit_code == 0
    (imported,) = (str(path) for path in Path("recordings").glob("*.mcap") if path.stem != "whole")
    about = f"{imported}: is a copy of recordings/whole.mcap (imported from whole.csv, with the same ticks)"
    again = runner.invoke(app, ["export", "recordings", "--to", "csv", "-o", "again"])
    assert f"left out: {about}" in again.stderr
    assert "of 1 recording," in again.stdout
    assert Path("again/trials.csv").read_bytes() == Path("out/trials.csv").read_bytes()
    checked = json.loads(runner.invoke(app, ["check", "recordings", "--json"]).stdout)
    assert [(one["path"], one["of"]) for one in checked["copies"]] == [(imported, "recordings/whole.mcap")]
    assert about in runner.invoke(app, ["check", "recordings"]).stdout
    listed = json.loads(runner.invoke(app, ["sessions", "recordings", "--json"]).stdout)
    assert {one["path"]: one["copy_of"] for one in listed} == {
        imported: "recordings/whole.mcap",
        "recordings/whole.mcap": "",
    }
    assert "1 copy, not counted" in runner.invoke(app, ["sessions", "recordings"]).stdout


def test_recordings_that_claim_to_be_the_same_are_damage() -> None:
    rows = rehearsed.rows()
    rows["left_x"][100] += 0.001
    rehearsed.write(Path("recordings/changed.mcap"), rows)
    result = runner.invoke(app, ["check", "recordings"])
    assert result.exit_code == 1
    assert "claim to be the same part of a block, and differ at tick 100; keep the right one" in result.stdout
    listed = json.loads(runner.invoke(app, ["sessions", "recordings", "--json"]).stdout)
    assert [one["verdict"] for one in listed] == ["damaged", "damaged"]
    assert runner.invoke(app, ["export", "recordings", "--to", "csv"]).exit_code == 1


def test_missing_files_and_folders_are_reported() -> None:
    assert "nowhere: no such file or folder" in runner.invoke(app, ["check", "nowhere"]).stderr
    Path("empty").mkdir()
    assert "no recording in this folder" in runner.invoke(app, ["check", "empty"]).stderr
    assert "no such folder" in runner.invoke(app, ["sessions", "nowhere"]).stderr


def deny(folder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder in `recordings` that may not be read."""
    Path("recordings", folder).mkdir()
    really = os.scandir

    def scandir(path: Any) -> Any:
        if Path(path).name == folder:
            raise PermissionError(errno.EACCES, "Permission denied", os.fspath(path))
        return really(path)

    monkeypatch.setattr(os, "scandir", scandir)


@pytest.mark.parametrize("command", ["check", "sessions"])
def test_subfolder_that_cannot_be_read_does_not_pass_for_an_empty_one(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    deny("of-another-user", monkeypatch)
    result = runner.invoke(app, [command, "recordings"])
    assert result.exit_code == 1, result.output
    assert result.stderr == "netboard: recordings/of-another-user: cannot be read: Permission denied\n"


@pytest.mark.parametrize("command", ["check", "sessions"])
@pytest.mark.parametrize("folder", ["lost+found", ".Trash-0"])
def test_folders_of_the_disk_itself_need_not_be_readable(
    command: str, folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    deny(folder, monkeypatch)
    result = runner.invoke(app, [command, "recordings"])
    assert result.exit_code == 0, result.output
    assert "whole" in result.stdout


@pytest.mark.parametrize("command", ["check", "sessions"])
def test_link_to_a_recording_that_is_not_there_is_reported(command: str) -> None:
    Path("recordings/unmounted.mcap").symlink_to("/nowhere/unmounted.mcap")
    Path("recordings/circle.mcap").symlink_to("circle.mcap")
    result = runner.invoke(app, [command, "recordings", "--json"])
    assert '"recordings/unmounted.mcap"' in result.stdout
    assert "cannot be read: No such file or directory" in result.stdout
    assert '"recordings/circle.mcap"' in result.stdout
    assert "cannot be read: Too many levels of symbolic links" in result.stdout


def test_temporary_files_of_killed_commands_are_no_recordings() -> None:
    Path("recordings/.whole.recovered.mcap.1a2b3c4d.part").write_bytes(b"half")
    Path("recordings/.figure.png.42.part").write_bytes(b"half")
    result = runner.invoke(app, ["check", "recordings"])
    assert result.exit_code == 0, result.output


def test_sessions_lists_the_configured_folder() -> None:
    result = runner.invoke(app, ["sessions"])
    assert result.exit_code == 0, result.output
    for words in ("D01 S01", "whole.mcap", "2 of 2", "complete", "1 session, 1 file ("):
        assert words in result.output
    (entry,) = json.loads(runner.invoke(app, ["sessions", "--json", "--check", "--no-pilot"]).stdout)
    assert (entry["done"], entry["trials"], entry["verdict"], entry["quick"]) == (2, 2, "complete", False)
    assert json.loads(runner.invoke(app, ["sessions", "--json"]).stdout)[0]["quick"] is True
    assert "no matching recording" in runner.invoke(app, ["sessions", "--dyad", "D99"]).output
    Path("empty").mkdir()
    assert runner.invoke(app, ["sessions", "empty"]).output == "empty: no recording\n"


def test_whatif_shows_recorded_and_changed_outcomes() -> None:
    result = runner.invoke(app, ["whatif", "recordings/whole.mcap", "--set", "physics.g=0", "--figure", "a.png"])
    assert result.exit_code == 0, result.output
    for words in ("-> unfinished", "[mm]", "Open loop"):
        assert words in result.output
    assert Path("a.png").stat().st_size > 10_000
    again = runner.invoke(app, ["whatif", "recordings/whole.mcap", "--figure", "a.png"])
    assert (again.exit_code, "already exists" in again.stderr) == (2, True)


def test_whatif_without_a_change_is_identical() -> None:
    result = runner.invoke(app, ["whatif", "recordings/whole.mcap", "--json"])
    assert json.loads(result.stdout)["identical"] is True


def test_whatif_refuses_its_output_before_the_computation(monkeypatch: pytest.MonkeyPatch) -> None:
    def compute(*given: object) -> None:
        raise AssertionError("computed before the refusal")

    monkeypatch.setattr("netboard.recording.counterfactual.what_if.what_if", compute)
    Path("there.mcap").touch()
    for option, output, why in (
        ("--output", "there.mcap", "already exists"),
        ("--output", "recording.csv", "ends in .mcap"),
        ("--output", "nowhere/new.mcap", "there is no folder nowhere"),
        ("--output", "/proc/new.mcap", "/proc/new.mcap: cannot be written: "),
        ("--figure", "nowhere/new.png", "there is no folder nowhere"),
        ("--figure", "/proc/new.png", "/proc/new.png: cannot be written: "),
    ):
        result = runner.invoke(app, ["whatif", "recordings/whole.mcap", option, output])
        assert (result.exit_code, why in result.stderr) == (1 if "/proc" in output else 2, True), result.output


def test_check_verifies_the_output_of_whatif() -> None:
    command = ["whatif", "recordings/whole.mcap", "--model", "lagrangian", "--output", "b.mcap"]
    assert runner.invoke(app, command).exit_code == 0
    assert runner.invoke(app, ["check", "b.mcap", "--verify"]).exit_code == 3
    assert runner.invoke(app, command).exit_code == 2


def test_whatif_refuses_ticks_that_no_stage_has_computed() -> None:
    rows = "".join(f"{k / 1000},0.01,0.02,{0.1 - k / 1000},1\n" for k in range(50))
    Path("theirs.csv").write_text(f"time,left_z,right_z,p,trial\n{rows}")
    assert runner.invoke(app, ["import", "theirs.csv", "--output", "imported"]).exit_code == 0
    (measured,) = Path("imported").glob("*.mcap")
    result = runner.invoke(app, ["whatif", str(measured), "--set", "physics.k_h=400"])
    assert (result.exit_code, "measured by another program" in result.stderr) == (1, True), result.output


def test_whatif_reports_an_invalid_setting() -> None:
    result = runner.invoke(app, ["whatif", "recordings/whole.mcap", "--set", "physics.k_h=-1"])
    assert (result.exit_code, "k_h: found -1" in result.stderr) == (2, True)
