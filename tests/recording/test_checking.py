"""Integrity checks: every kind of damage is found, and reported losses are not damage."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgpack
import numpy as np
import pytest
from mcap.reader import make_reader

import rehearsed
from netboard.base.config import resolve
from netboard.base.errors import RecordingError
from netboard.network.protocol.records import ClockRecord
from netboard.recording.files.locate import recovery_advice
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Attempt
from netboard.recording.integrity import checking
from netboard.recording.integrity.checking import CHECKS, check
from netboard.recording.integrity.severity import CheckReport, Severity
from netboard.recording.recovery.journal_file import journal_path
from netboard.recording.recovery.recover import recover
from netboard.task.journal.entries import AttemptBegan, AttemptEnded, BlockBegan, Entry, Header, Opened, line_of

pytestmark = pytest.mark.slow


def findings_text(report: CheckReport, severity: Severity = Severity.DAMAGE) -> str:
    return " | ".join(finding.text for finding in report.findings if finding.severity == severity)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rehearsed.write(
        tmp_path_factory.mktemp("proofs") / "sound.mcap",
        rehearsed.rows(),
        clocks=rehearsed.probes(30),
        metadata={"block": "1"},
    )


def test_sound_recording_is_complete(sound: Path) -> None:
    progress: list[int] = []
    report = check(sound, replay=True, progress=progress.append)
    assert (report.result, findings_text(report), findings_text(report, Severity.LOSS)) == ("complete", "", "")
    assert report.ticks == len(rehearsed.rows()) == sum(progress)
    assert report.replay is not None
    assert report.replay.identical
    assert report.replay.checked == report.ticks
    parts = {finding.part for finding in report.findings}
    assert parts >= {"file", "numbers", "time", "clocks", "configuration", "trials", "replay"}


def test_every_finding_names_a_registered_check(sound: Path) -> None:
    """A new check is one entry with a function and a text; its findings are reported under its name."""
    names = {one.part for one in CHECKS}
    assert {finding.part for finding in check(sound, replay=True).findings} <= names
    assert all(one.about.endswith(".") for one in CHECKS)
    assert len(names) == len(CHECKS)


def test_tick_count_equals_that_of_the_mcap_library(sound: Path) -> None:
    with sound.open("rb") as file:
        messages = make_reader(file, validate_crcs=True).iter_messages(topics=["/ticks"])
        assert sum(msgpack.unpackb(message.data)["count"] for _, _, message in messages) == check(sound).ticks


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.98])
def test_flipped_bit_is_damage_and_the_rest_is_recoverable(tmp_path: Path, sound: Path, share: float) -> None:
    broken = bytearray(sound.read_bytes())
    broken[int(share * len(broken))] ^= 16
    path = tmp_path / "flipped.mcap"
    path.write_bytes(broken)
    report = check(path)
    assert report.result == "damaged"
    assert "netboard recover" in findings_text(report)
    assert "recoverable" in findings_text(report)
    assert report.ticks > 0.5 * len(rehearsed.rows())
    assert [file.name for file in tmp_path.iterdir()] == ["flipped.mcap"]


def test_check_of_a_truncated_file_reports_the_recoverable_ticks(tmp_path: Path, sound: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(sound.read_bytes()[: sound.stat().st_size * 2 // 3])
    report = check(path)
    assert "is unfinished or cut short" in findings_text(report)
    assert report.ticks == recover(path).messages["/ticks"] > 0


def test_check_of_an_unfinished_part_reports_the_recoverable_ticks(tmp_path: Path) -> None:
    writer = rehearsed.writer_of(tmp_path / "a.mcap", rehearsed.config(), {})
    writer.flush(rehearsed.fill(writer, rehearsed.rows()[:1000]))
    writer.abandon()
    report = check(tmp_path / "a.mcap.part")
    assert (report.result, report.ticks) == ("damaged", 1000)
    assert "recoverable: 1000 ticks, 0 to 999" in findings_text(report)


def test_check_says_if_a_file_may_be_growing_or_was_recovered(tmp_path: Path) -> None:
    writer = rehearsed.writer_of(tmp_path / "a.mcap", rehearsed.config(), {})
    writer.flush(rehearsed.fill(writer, rehearsed.rows()[:100]))
    part = tmp_path / "a.mcap.part"
    assert f"may still be writing it; after its session, run: netboard recover {part}" in findings_text(check(part))
    writer.abandon()
    os.utime(part, (0, 0))
    assert (
        f"is unfinished or cut short, or has other bytes after its end; run: netboard recover {part}"
        in findings_text(check(part))
    )
    recover(part)
    os.utime(part)
    found = findings_text(check(part))
    assert f"it was recovered as {tmp_path / 'a.recovered.mcap'}" in found
    assert "run:" not in found
    gone = tmp_path / "b.mcap.part"  # its logger has finished it since it was opened
    assert recovery_advice(gone) == f"run: netboard recover {gone}"


def test_check_of_another_file_type_finds_nothing_to_recover(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"%PDF-1.4 hello")
    report = check(tmp_path / "a.mcap")
    assert report.result == "damaged"
    assert "nothing can be recovered" in findings_text(report)


def test_full_temporary_folder_does_not_mean_that_nothing_can_be_recovered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, output: Path) -> None:
        raise RecordingError(f"{output}.part: cannot be written: No space left on device")

    monkeypatch.setattr(checking, "recover_any", refuse)
    writer = rehearsed.writer_of(tmp_path / "a.mcap", rehearsed.config(), {})
    writer.abandon()
    found = findings_text(check(tmp_path / "a.mcap.part"))
    assert "what can be recovered is unknown" in found
    assert "nothing can be recovered" not in found


def test_changed_configuration_is_detected_by_its_checksum(tmp_path: Path) -> None:
    other = resolve(rehearsed.config()).replace("k_h = 200.0", "k_h = 201.0")
    path = rehearsed.write(tmp_path / "a.mcap", rehearsed.rows()[:50], text=other, metadata={"config_sha256": "0" * 64})
    assert "its configuration is damaged" in findings_text(check(path))


def test_wrong_configuration_is_detected_by_metadata_and_replay(tmp_path: Path) -> None:
    config = rehearsed.config()
    other = replace(config, physics=replace(config.physics, k_h=201.0))
    path = rehearsed.write(tmp_path / "a.mcap", rehearsed.rows(), other, metadata={"dyad": "D99"})
    report = check(path, replay=True)
    assert "dyad 'D99', expected 'D01'" in findings_text(report)
    assert "not identical: tick" in findings_text(report)


def test_dropped_ticks_without_a_note_are_damage(tmp_path: Path) -> None:
    rows = np.delete(rehearsed.rows(), slice(700, 705))
    report = check(rehearsed.write(tmp_path / "a.mcap", rows), replay=True)
    assert "5 ticks are missing without a note by the logger, from tick 700 on" in findings_text(report)
    assert report.replay is not None
    assert (report.replay.identical, report.replay.gaps) == (True, 1)


def test_dropped_ticks_noted_by_the_logger_are_a_loss(tmp_path: Path) -> None:
    rows = rehearsed.rows()
    writer = rehearsed.writer_of(tmp_path / "a.mcap", rehearsed.config(), {})
    before = rows[:700]
    now = rehearsed.fill(writer, before)
    assert writer.next_record is not None
    writer.note_lost(writer.next_record, 5, now)
    writer.finish(rehearsed.fill(writer, rows[705:], events=int(np.count_nonzero(before["event"]))))
    report = check(tmp_path / "a.mcap")
    assert (report.result, findings_text(report)) == ("complete with listed losses", "")
    assert "5 records were lost after tick 699: the server no longer had them" in findings_text(report, Severity.LOSS)


@pytest.mark.parametrize("place", [10, -10])
def test_swapped_tick_times_are_damage(tmp_path: Path, place: int) -> None:
    rows = rehearsed.rows()
    rows["time_ns"][[place, place + 1]] = rows["time_ns"][[place + 1, place]]
    report = check(rehearsed.write(tmp_path / "a.mcap", rows))
    assert "ticks are not 1 ms after the one before" in findings_text(report)


def test_ticks_out_of_order_are_damage(tmp_path: Path) -> None:
    rows = rehearsed.rows()
    words = rows.view(np.int64).reshape(len(rows), -1)
    words[[300, 301]] = words[[301, 300]]
    text = findings_text(check(rehearsed.write(tmp_path / "a.mcap", rows)))
    assert "is not one recording: tick 300 comes after tick 301" in text
    assert f"recoverable: {len(rows)} ticks" in text


def test_wrong_number_of_trials_is_damage(tmp_path: Path) -> None:
    config = rehearsed.config()
    for trials in (1, 3):
        settings = replace(config, block=replace(config.block, trials=trials))
        report = check(rehearsed.write(tmp_path / f"{trials}.mcap", rehearsed.rows(), settings))
        assert f"2 of the block's {trials} trials done" in findings_text(report)


def test_unfinished_block_is_a_loss(tmp_path: Path) -> None:
    report = check(
        rehearsed.write(tmp_path / "a.mcap", rehearsed.rows()[:-2000], ended="the server began another session")
    )
    assert (report.result, findings_text(report)) == ("complete with listed losses", "")
    assert "ends before its session" in findings_text(report, Severity.LOSS)
    assert "1 of the block's 2 trials done" in findings_text(report, Severity.LOSS)


def test_target_on_the_wrong_side_is_damage(tmp_path: Path) -> None:
    config = rehearsed.config()
    settings = replace(config, block=replace(config.block, first_target="right"))
    report = check(rehearsed.write(tmp_path / "a.mcap", rehearsed.rows(), settings))
    assert "have their target on the wrong side: trial 1" in findings_text(report)


def test_force_that_contradicts_the_condition_is_damage(tmp_path: Path) -> None:
    config = rehearsed.config()
    for changes in ({"force": "none"}, {"catch": (1,)}):
        settings = replace(config, block=replace(config.block, **changes))
        path = rehearsed.write(tmp_path / f"{next(iter(changes))}.mcap", rehearsed.rows(), settings)
        assert "ticks have a force where none is allowed" in findings_text(check(path))


@pytest.mark.parametrize("field", ["theta", "left_force", "right_used_z"])
def test_only_the_replay_detects_a_change_in_the_last_bit(tmp_path: Path, field: str) -> None:
    rows = rehearsed.rows()
    rows[field].view()[4321:4322] = np.nextafter(rows[field][4321], np.inf)
    path = rehearsed.write(tmp_path / "a.mcap", rows)
    assert check(path).result == "complete"
    assert f"tick 4321, {field}" in findings_text(check(path, replay=True))


def test_recovered_file_lists_its_losses(tmp_path: Path, sound: Path) -> None:
    broken = bytearray(sound.read_bytes())
    broken[len(broken) // 2] ^= 1
    (tmp_path / "a.mcap").write_bytes(broken)
    report = check(recover(tmp_path / "a.mcap").output)
    assert (report.result, findings_text(report)) == ("complete with listed losses", "")
    assert "recovered from a.mcap; lost:" in findings_text(report, Severity.LOSS)


Change = Callable[[list[ClockRecord]], None]


def _stamped_back(probes: list[ClockRecord]) -> None:
    probes[4] = replace(probes[4], t3_ns=probes[4].t0_ns - 1)


def _tightened(probes: list[ClockRecord]) -> None:
    probes[4] = replace(probes[4], offset_ns=probes[4].offset_ns + 500_000)


def _loosened(probes: list[ClockRecord]) -> None:
    probes[4] = replace(probes[4], bound_ns=900_000)


@pytest.mark.parametrize(
    ("change", "words"),
    [(_stamped_back, "impossible"), (_tightened, "contradict their own probe"), (_loosened, "contradict")],
)
def test_inconsistent_clock_probe_is_damage(tmp_path: Path, change: Change, words: str) -> None:
    clocks = rehearsed.probes(30)
    change(clocks)
    assert words in findings_text(check(rehearsed.write(tmp_path / "a.mcap", rehearsed.rows()[:50], clocks=clocks)))


def test_journal_that_contradicts_the_recording_is_damage(tmp_path: Path) -> None:
    config = rehearsed.config()
    path = rehearsed.write(tmp_path / "a.mcap", rehearsed.rows())
    with Recording(path) as recording:
        attempts = recording.attempts()
    _keep_journal(tmp_path, attempts, 0.0)
    assert "agrees on all 2 attempts" in findings_text(check(path), Severity.SOUND)
    journal_path(tmp_path, config).unlink()
    _keep_journal(tmp_path, attempts, 0.5)
    assert "contradicts the recording: trial 1, attempt 1 took" in findings_text(check(path))


def _keep_journal(folder: Path, attempts: tuple[Attempt, ...], wrong: float) -> None:
    header = Header(
        1, "own", "", "", 1, "D01", "S01", 1, ("A", "B"), pilot=True, consent=False, netboard="0", config_digest=""
    )
    entries: list[Entry] = [Opened(rehearsed.SESSION, {}), BlockBegan(1, 1, 1, rehearsed.SESSION, 0)]
    for one in attempts:
        entries += [
            AttemptBegan(1, one.trial, one.attempt, rehearsed.SESSION, one.began),
            AttemptEnded(
                1,
                one.trial,
                one.attempt,
                "success",
                one.completion + wrong,
                (),
                0,
                again=False,
                run=rehearsed.SESSION,
                tick=one.stop - 1,
                block_ticks=one.stop,
            ),
        ]
    lines = [line_of(entry, "now") for entry in (header, *entries)]
    journal_path(folder, rehearsed.config()).write_bytes(b"".join(lines))
