"""A Motion-BIDS export satisfies the BIDS validator, has two people on one clock, and keeps every bit."""

import csv
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dyads import UTC_NS, dyad, make_session, solo

import rehearsed
from netboard.base.config import Config, parse
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.export import bids, nwb
from netboard.recording.export.task import EVENT_NAMES
from netboard.recording.files.reader import Recording
from netboard.task.trials.state_machine import Cause, Phase
from netboard.testing.difficult_recording import START_NS, make_rows, same_bits, without_payloads, write
from netboard.testing.export_format import Columns, ExportFormatContract

LEFT_TO_THE_LAB = {"JSON_KEY_RECOMMENDED", "NO_AUTHORS", "TOO_FEW_AUTHORS"}


def quiet(what: str, done: int, total: int) -> None:
    assert 0 <= done <= total


def export(recordings: list[Path], folder: Path) -> Path:
    folder.mkdir()
    bids.write(recordings, folder, quiet)
    return folder


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bids")
    return export(make_session(folder), folder / "out")


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))


def motion(folder: Path, subject: str, run: int) -> dict[str, list[str]]:
    """Words of a motion file, by the names in its channels."""
    (found,) = folder.glob(f"sub-{subject}/ses-*/motion/*_run-{run:02d}_motion.tsv")
    with found.open(encoding="ascii", newline="") as file:
        columns = zip(*csv.reader(file, delimiter="\t", quoting=csv.QUOTE_NONE), strict=True)
        names = [row["name"] for row in table(found.with_name(found.name.replace("_motion.", "_channels.")))]
        return dict(zip(names, map(list, columns), strict=True))


def test_texts_of_tables_are_no_formulas(tmp_path: Path) -> None:
    label = "=1 +\t1"
    config = replace(Config(), block=replace(Config().block, label=label))
    folder = export([write(tmp_path / "S01.mcap", make_rows(1), config)], tmp_path / "out")
    (scans,) = folder.glob("sub-D01A/ses-*/*_scans.tsv")
    assert [row["label"] for row in table(scans)] == ["'=1 + 1"]
    (events,) = folder.glob("sub-D01A/ses-*/motion/*_events.tsv")
    assert all(float(row["onset"]) >= 0 for row in table(events))


def test_recording_without_any_event_has_no_empty_events_file(tmp_path: Path) -> None:
    idle = make_rows(1)[:50]
    idle["event"], idle["phase"] = 0, Phase.IDLE
    folder = export([write(tmp_path / "idle.mcap", idle)], tmp_path / "out")
    assert list(folder.rglob("*_motion.tsv"))
    assert [path.name for path in folder.rglob("*.tsv") if not path.stat().st_size] == []
    assert list(folder.rglob("*_events.tsv")) == []


def numbers(words: list[str], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
    return np.array([float("nan") if word == "n/a" else dtype.type(word) for word in words], dtype)


class TestBids(ExportFormatContract):
    name, keeps_payloads = "bids", False

    def read(self, folder: Path, recording: str) -> Columns:
        words = motion(folder, "D01A", int(recording[-1]))
        fields = {"left_stylus_z": "left_sent_z", "board_tilt": "theta", "ball_velocity": "vp", "phase": "phase"}
        return {field: numbers(words[name], TICK[field]) for name, field in fields.items()}


def issues(folder: Path) -> list[dict[str, Any]]:
    """What the BIDS validator finds, in all rows, without a network."""
    tool = shutil.which("bids-validator-deno", path=Path(sys.executable).parent)
    if tool is None:
        pytest.skip("bids-validator-deno is not installed")
    done = subprocess.run(
        [tool, "--format", "json", "--max-rows", "-1", str(folder)], capture_output=True, check=False, timeout=120
    )
    return list(json.loads(done.stdout)["issues"]["issues"])


@pytest.mark.slow
def test_bids_validator_asks_only_for_metadata_of_the_lab(dataset: Path) -> None:
    found = issues(dataset)
    assert {issue["code"] for issue in found} == LEFT_TO_THE_LAB
    assert all(issue["severity"] == "warning" for issue in found)
    wanted = {issue["subCode"] for issue in found if issue["code"] == "JSON_KEY_RECOMMENDED"}
    assert wanted == {"HEDVersion", "License", "SourceDatasets"}


@pytest.mark.slow
def test_bids_validator_reports_a_missing_channel(dataset: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(dataset, tmp_path / "broken"))
    channels = next(broken.rglob("*_channels.tsv"))
    channels.write_text("\n".join(channels.read_text(encoding="utf-8").splitlines()[:-1]) + "\n", encoding="utf-8")
    assert "error" in {issue["severity"] for issue in issues(broken)}


def test_participants_have_their_own_stylus_and_the_same_board_bit_for_bit(dataset: Path) -> None:
    rows = without_payloads(make_rows(1))
    a, b = motion(dataset, "D07A", 1), motion(dataset, "P22", 1)
    fields = {"x": "x", "y": "y", "z": "sent_z", "vz": "sent_vz", "force_on_board": "coupling", "sample": "seq"}
    fields |= {"force_on_hand": "force", "force_rendered": "rendered", "fresh": "live", "safeguards": "safeguards"}
    for name, field in fields.items():
        for words, side in ((a, "right"), (b, "left")):  # seat_a = "right"
            column = rows[f"{side}_{field}"]
            assert same_bits(numbers(words[f"{side}_stylus_{name}"], column.dtype), column)
    for name, field in {"board_z": "z", "board_tilt_rate": "omega", "ball_velocity": "vp", "phase": "phase"}.items():
        assert same_bits(numbers(a[name], rows[field].dtype), rows[field])
        assert a[name] == b[name]
    assert not [name for name in a if name.startswith("left_")]
    assert not [name for name in b if name.startswith("right_")]


def test_both_participants_share_one_time_axis_with_its_gap(dataset: Path) -> None:
    a, b = motion(dataset, "D07A", 1), motion(dataset, "P22", 1)
    assert a["latency"] == b["latency"]
    assert a["latency"][:2] == ["0.000000000", "0.001000000"]
    assert a["latency"][99:101] == ["0.099000000", "0.101000000"]
    scans = [table(path) for path in sorted(dataset.glob("sub-*/ses-D07S2/*_scans.tsv"))]
    first, second = (rows[0] for rows in scans)
    assert first["acq_time"] == second["acq_time"]
    assert first["acq_time"].endswith("Z")
    assert (first["stylus"], first["other_hand"]) == ("right", "sub-P22")
    assert (second["stylus"], second["other_hand"]) == ("left", "sub-D07A")
    assert first["force"] == "partner_only"


def test_bimanual_block_belongs_to_one_participant(dataset: Path) -> None:
    assert not list(dataset.glob("sub-D07A/ses-D07S2/motion/*run-02*"))
    words, rows = motion(dataset, "P22", 2), without_payloads(make_rows(2))
    assert same_bits(numbers(words["left_stylus_y"], np.dtype(float)), rows["left_y"])
    assert same_bits(numbers(words["right_stylus_force_on_hand"], np.dtype(float)), rows["right_force"])
    (sidecar,) = dataset.glob("sub-P22/ses-D07S2/motion/*run-02_motion.json")
    metadata = json.loads(sidecar.read_text(encoding="utf-8"))
    assert (metadata["POSChannelCount"], metadata["TrackedPointsCount"]) == (6, 2)
    assert metadata["MotionChannelCount"] == len(words)
    assert metadata["SamplingFrequencyEffective"] == pytest.approx(1000 * 299 / 300)


def test_participant_dyad_and_session_tables_link_the_partners(dataset: Path) -> None:
    people = {row["participant_id"]: row for row in table(dataset / "participants.tsv")}
    assert set(people) == {"sub-D07A", "sub-P22"}
    assert people["sub-P22"]["handedness"] == "left"
    (row,) = table(dataset / "docs" / "dyads.tsv")
    assert (row["session_id"], row["participant_a"], row["participant_b"]) == ("ses-D07S2", "sub-D07A", "sub-P22")
    assert row["runs"] == "2"
    (session,) = table(dataset / "sub-P22" / "sub-P22_sessions.tsv")
    assert (session["session_id"], session["partner"]) == ("ses-D07S2", "sub-D07A")


def test_events_list_attempts_levelling_and_outcomes(dataset: Path, tmp_path: Path) -> None:
    with Recording(write(tmp_path / "same.mcap", make_rows(1))) as recording:
        attempts = recording.attempts()
    events = table(next(dataset.glob("sub-D07A/ses-*/motion/*run-01_events.tsv")))
    rows = [row for row in events if row["trial_type"] == "attempt"]
    assert [row["outcome"] for row in rows] == [attempt.outcome for attempt in attempts]
    assert [float(row["onset"]) for row in rows] == [attempt.tick / 1000 for attempt in attempts]
    assert [float(row["duration"]) for row in rows] == [attempt.duration for attempt in attempts]
    assert [row["completion_time"] for row in rows] == ["n/a", "0.04", "n/a", "n/a", "n/a"]
    assert [row["catch_trial"] for row in rows] == ["false", "false", "true", "true", "true"]
    levelling = [row for row in events if row["trial_type"] == "levelling"]
    assert [float(row["onset"]) for row in levelling] == [attempt.began / 1000 for attempt in attempts]
    assert [row["trial_type"] for row in events if row["duration"] == "0"] == ["fell", "success", "timed_out", "abort"]
    onsets = [float(row["onset"]) for row in events]
    assert onsets == sorted(onsets)


def test_every_cause_has_an_event_name() -> None:
    assert set(EVENT_NAMES) == {int(cause) for cause in Cause} - {int(Cause.NONE)}


def test_configuration_is_exported_for_each_recording(dataset: Path) -> None:
    texts = [path.read_text(encoding="utf-8") for path in sorted(dataset.glob("sourcedata/*/netboard.toml"))]
    assert len(texts) == 2
    assert all('dyad = "D-07"' in text for text in texts)


def test_runs_are_numbered_chronologically(tmp_path: Path) -> None:
    early, late = dyad(tmp_path / "z.mcap", minute=1), solo(tmp_path / "a.mcap", minute=2)
    out = export([late, early], tmp_path / "out")
    assert [row["recording"] for row in table(next(out.glob("sub-P22/ses-*/*_scans.tsv")))] == ["z.mcap", "a.mcap"]


def test_blocks_keep_their_order_after_a_step_of_the_wall_clock(tmp_path: Path) -> None:
    first = dyad(tmp_path / "z.mcap", minute=60)
    second = dyad(tmp_path / "a.mcap", minute=1, block={"number": 2})
    before = dyad(tmp_path / "m.mcap", minute=0, session="00000000")
    resumed = dyad(tmp_path / "b.mcap", minute=0, block={"number": 2}, session="11111111")
    out = export([resumed, second, before, first], tmp_path / "out")
    rows = table(next(out.glob("sub-P22/ses-*/*_scans.tsv")))
    assert [row["recording"] for row in rows] == ["m.mcap", "z.mcap", "a.mcap", "b.mcap"]


def test_acquisition_time_uses_the_best_clock_probe_of_its_own_logger(tmp_path: Path) -> None:
    # The logger's clock is 5 s ahead of the server's, by the better of two probes; another logger has another clock.
    clocks = [("logger", 5_000_000_900, 800), ("logger", 5_000_000_000, 100), ("logger", 10**15, 1)]
    path = dyad(tmp_path / "a.mcap", clocks=clocks, opened_monotonic=START_NS + 5_030_000_000, welcome=START_NS)
    out = export([path], tmp_path / "out")
    (row,) = table(next(out.glob("sub-P22/ses-*/*_scans.tsv")))
    opened = datetime.fromtimestamp(UTC_NS // 10**9, UTC)
    assert datetime.fromisoformat(row["acq_time"]) == opened - timedelta(milliseconds=30)


@pytest.fixture
def refused(tmp_path: Path) -> Iterator[Any]:
    def match(recordings: list[Path], pattern: str) -> None:
        with pytest.raises(RecordingError, match=pattern):
            export(recordings, tmp_path / "out")

    return match


def test_duplicate_block_is_refused(refused: Any, tmp_path: Path) -> None:
    refused([dyad(tmp_path / "a.mcap"), dyad(tmp_path / "b.mcap")], "is a copy of")


def test_participants_with_the_same_label_are_refused(refused: Any, tmp_path: Path) -> None:
    other = dyad(tmp_path / "b.mcap", session="other", names={"dyad": "D08", "participant_b": "P-22"})
    refused([dyad(tmp_path / "a.mcap"), other], "participants P22 and P-22 would both be called P22")


def test_same_name_for_both_participants_is_refused(refused: Any, tmp_path: Path) -> None:
    refused([dyad(tmp_path / "a.mcap", names={"participant_a": "P22"})], "both participants are called P22")


def test_recording_without_ticks_is_refused(refused: Any, tmp_path: Path) -> None:
    refused([dyad(tmp_path / "a.mcap", rows=np.empty(0, TICK))], "contains no ticks")


def test_robot_partner_has_no_files(tmp_path: Path) -> None:
    out = export([dyad(tmp_path / "a.mcap", block={"left": "robot"})], tmp_path / "out")
    assert [path.name for path in out.glob("sub-*")] == ["sub-D07A"]
    (row,) = table(next(out.glob("sub-D07A/ses-*/*_scans.tsv")))
    assert row["other_hand"] == "robot"


@pytest.mark.parametrize("form", [bids, nwb])
def test_block_of_two_robots_has_no_person_to_be_written(tmp_path: Path, form: Any) -> None:
    if form is nwb:
        pytest.importorskip("pynwb")
    config = parse("", overrides=["block.left=leader", "block.right=follower"])
    file = rehearsed.write(tmp_path / "robots.mcap", rehearsed.rows(), config)
    (tmp_path / "out").mkdir()
    with pytest.raises(RecordingError, match=r"no person takes part in this block \(left: leader, right: follower\)"):
        form.write([file], tmp_path / "out", quiet)
