"""Recordings of every earlier format are read, to the bit."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import msgpack
import numpy as np
import pytest

from netboard.base.config import parse
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import READABLE, Recording
from netboard.recording.format import older
from netboard.recording.format.channels import FORMAT_VERSION
from netboard.recording.integrity.verification import verify_recording
from netboard.recording.recovery.recover import recover

GOLDEN = Path(__file__).parent.parent / "data" / "recordings"


def test_every_readable_format_has_a_golden_recording() -> None:
    assert [path.stem for path in sorted(GOLDEN.glob("*.mcap"))] == [f"format-{version}" for version in READABLE]
    assert READABLE[-1] == FORMAT_VERSION


@pytest.mark.parametrize("version", READABLE)
def test_golden_recording_reads_as_its_json_twin(version: str) -> None:
    expected = json.loads((GOLDEN / f"format-{version}.json").read_text(encoding="utf-8"))
    with Recording(GOLDEN / f"format-{version}.mcap") as recording:
        recording.check()
        rows = recording.ticks()
        assert len(rows) == expected["ticks"] == recording.counts["/ticks"]
        assert rows["theta"][200] == expected["tilt_of_tick_200"]
        for name in TICK.names:
            if name in expected["columns"]:
                assert hashlib.sha256(rows[name].tobytes()).hexdigest() == expected["columns"][name], name
            else:
                assert not rows[name].any()
        assert [asdict(event) for event in recording.events()] == expected["events"]
        assert [asdict(clock) for clock in recording.clocks()] == expected["clocks"]
        assert [asdict(frame) for frame in recording.frames()] == expected["frames"]
        assert [asdict(remark) for remark in recording.remarks()] == expected["remarks"]
        assert recording.end == expected["end"]
        assert recording.metadata["format"] == version
        assert parse(recording.config_text).block.force == "full"
        assert [attempt.trial for attempt in recording.attempts()] == [1]
        assert "/ticks" not in recording.gaps()


@pytest.mark.parametrize("version", READABLE)
def test_golden_recording_can_be_exported_and_analysed(version: str) -> None:
    (run,) = runs_of([GOLDEN / f"format-{version}.mcap"])
    assert (run.session, [person.label for person in run.people]) == ("D01S01", ["D01A", "D01B"])


@pytest.mark.parametrize("version", READABLE[1:])
def test_golden_recording_verifies_bit_for_bit(version: str) -> None:
    with Recording(GOLDEN / f"format-{version}.mcap") as recording:
        assert verify_recording(recording).identical


def test_recording_of_format_1_cannot_be_verified() -> None:
    with (
        Recording(GOLDEN / "format-1.mcap") as recording,
        pytest.raises(RecordingError, match="format 1 lacks the inputs"),
    ):
        verify_recording(recording)


@pytest.mark.parametrize("version", READABLE[1:-1])
def test_older_format_is_recovered_into_the_current_format(tmp_path: Path, version: str) -> None:
    source = GOLDEN / f"format-{version}.mcap"
    report = recover(source, tmp_path / "new.mcap")
    assert (report.damage, report.missing, report.finished) == ((), (), True)
    with Recording(source) as old, Recording(report.output) as new:
        assert new.metadata["format"] == FORMAT_VERSION
        assert new.ticks().tobytes() == old.ticks().tobytes()
        assert (new.events(), new.clocks(), new.frames()) == (old.events(), old.clocks(), old.frames())
        assert (new.end, new.config_text) == (old.end, old.config_text)


def test_recovery_of_format_1_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"format version 1.*recovers versions 2, 3, 4"):
        recover(GOLDEN / "format-1.mcap", tmp_path / "new.mcap")


def test_fields_of_an_older_tick_are_read_by_name() -> None:
    with Recording(GOLDEN / "format-2.mcap") as recording:
        row = recording.ticks(7, 8)
    values = {name: row[name][0].item() for name in reversed(TICK.names)}
    assert older.ticks_of([msgpack.packb(values)], "2").tobytes() == row.tobytes()
    with pytest.raises(RecordingError, match="without the field"):
        older.ticks_of([msgpack.packb({"tick": 1})], "2")


def test_no_older_ticks_give_an_empty_array() -> None:
    assert older.ticks_of([], "2").dtype == TICK
    assert older.ticks_of([], "1").shape == (0,)


@pytest.mark.parametrize(("was", "force"), [("true", "full"), ("false", "none")])
def test_haptics_setting_of_format_1_becomes_the_force_condition(was: str, force: str) -> None:
    text = older.config_of(f"[block]\nhaptics = {was}\n", "1")
    assert parse(text).block.force == force
    assert older.config_of("haptics = true", "2") == "haptics = true"


@pytest.mark.parametrize("version", ["1", "2", "3", "4"])
def test_keys_that_simulated_participants_no_longer_have_are_left_out(version: str) -> None:
    retired = 'haptic_gain = "noise"\nhaptic_noise = 0.002\npartner_prediction = "rate"\n'
    text = older.config_of(f"[participant]\nkp = 2.0\n{retired}kd = 3.0\n", version)
    assert text == "[participant]\nkp = 2.0\nkd = 3.0\n"
    assert parse(text).participant.kd == 3.0


def test_nan_of_an_older_tick_is_preserved() -> None:
    with Recording(GOLDEN / "format-2.mcap") as recording:
        assert np.isnan(recording.ticks()["right_rendered"][7])
