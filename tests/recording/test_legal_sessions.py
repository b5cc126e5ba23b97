"""Recordings of all valid sessions are not called damaged; contradictions still are."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import legal_sessions
import rehearsed
from legal_sessions import Operated, Session, session_of, write
from netboard.base.config import Config
from netboard.base.tables.experiment import Block, Quality, Task
from netboard.network.protocol.records import EventRecord
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import CheckReport, Severity
from netboard.task.journal.entries import AttemptEnded, Ended, Opened, Resumed
from netboard.task.trials.state_machine import Cause, Phase

pytestmark = pytest.mark.slow

BLOCK = Block(trials=3, first_target="left", seed=3)
CONFIG = Config(block=BLOCK)

KINDS = {
    "plain": CONFIG,
    "random target": replace(CONFIG, block=replace(BLOCK, first_target="random", seed=9)),
    "catch trials": replace(CONFIG, block=replace(BLOCK, catch=(2,))),
    "no force": replace(CONFIG, block=replace(BLOCK, force="none")),
    "the partner's force, late": replace(CONFIG, block=replace(BLOCK, force="partner_only", force_delay_ms=40)),
    "so much time": replace(CONFIG, block=replace(BLOCK, trials=100, duration=9.0)),
    "a time limit": replace(CONFIG, task=Task(time_limit=3.0)),
    "both hands": replace(CONFIG, block=replace(BLOCK, configuration="bimanual")),
    "a robot": replace(CONFIG, block=replace(BLOCK, right="robot")),
    "nobody at the right": replace(CONFIG, block=replace(BLOCK, right="still")),
    "a strict referee": replace(CONFIG, quality=Quality(start_tilt_deg=0.1, stuck=0.05, shortest=4.0, longest=5.0)),
}


def findings_text(report: CheckReport, severity: Severity = Severity.DAMAGE) -> str:
    return " | ".join(finding.text for finding in report.findings if finding.severity == severity)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.sampled(5)
def test_no_operator_action_counts_as_damage(tmp_path: Path, kind: str, seed: int) -> None:
    chance = random.Random(f"{kind} {seed}")
    config = KINDS[kind]
    rows = Operated(config, chance, {}).rows()
    stopped = chance.choice((len(rows), chance.randrange(600, len(rows))))  # in mid-trial, by the server's end
    rows = rows[:stopped]
    made = session_of(config, rows, chance.choice((500, 3000)), chance.choice((0, stopped // 2)))
    cuts = sorted(chance.sample(range(600, len(made.records)), chance.randrange(3)))
    for path in write(tmp_path, made, cuts):
        assert findings_text(check(path)) == "", path


def made_of(config: Config = CONFIG, **given: int) -> Session:
    return session_of(config, Operated(config, None, {}).rows(), **given)


def report_on(folder: Path, made: Session) -> CheckReport:
    (path,) = write(folder, made)
    return check(path)


def test_repeat_vetoed_in_the_last_tick_of_a_trial_ends_the_block(tmp_path: Path) -> None:
    config = replace(CONFIG, block=replace(BLOCK, trials=1))
    rows = Operated(config, None, {}).rows()
    succeeded = int(rows["tick"][rows["phase"] == Phase.SUCCEEDED][0])
    rows = Operated(config, None, {1000: Cause.REPEAT, succeeded: Cause.VETO}).rows()
    assert (rows["event"][-1], rows["extra"][-1]) == (Cause.LAST, 1)
    report = report_on(tmp_path, session_of(config, rows))
    assert (findings_text(report), report.result) == ("", "complete")
    assert "1 of the block's 1 trials done" in findings_text(report, Severity.SOUND)


def test_repeated_trials_are_counted_beyond_the_planned_ones_and_leave_other_memory_alone() -> None:
    block = Operated(replace(CONFIG, block=replace(BLOCK, trials=1)), None, {1000: Cause.REPEAT})
    kept = len(block._completions)
    memory = np.full(kept + 10, -1.0)
    block._completions = memory[:kept]  # the loop writes there without a check of its own
    block.rows()
    assert block.successes == 2
    assert (memory[kept:] == -1.0).all()
    assert block.summary().completions == (memory[1],)


# --- the journal --------------------------------------------------------------------------------------------------


def ended(made: Session) -> list[AttemptEnded]:
    return [entry for entry in made.entries if isinstance(entry, AttemptEnded)]


def changed(made: Session, place: int, change: Callable[[AttemptEnded], AttemptEnded]) -> None:
    """Change one of the attempts in the journal."""
    entry = ended(made)[place]
    made.entries[made.entries.index(entry)] = change(entry)


def test_frames_reported_too_late_are_a_loss(tmp_path: Path) -> None:
    report = report_on(tmp_path, made_of(reported_ticks=5000))
    assert findings_text(report) == ""
    assert "differs in the flag for a frozen display" in findings_text(report, Severity.LOSS)


def test_journal_of_a_killed_server_ends_before_its_recording(tmp_path: Path) -> None:
    made = made_of()
    last = ended(made)[-1]
    del made.entries[made.entries.index(last) :]
    made.entries.append(Resumed("another run"))
    made.entries.append(Ended("the session was ended"))
    report = report_on(tmp_path, made)
    assert findings_text(report) == ""
    assert f"ends before these attempts: trial {last.trial}, attempt {last.attempt}" in findings_text(
        report, Severity.LOSS
    )


@pytest.mark.parametrize("place", [0, -1])
def test_attempt_missing_in_a_finished_journal_is_damage(tmp_path: Path, place: int) -> None:
    made = made_of()
    made.entries.remove(ended(made)[place])
    assert "is in the recording only" in findings_text(report_on(tmp_path, made))


def test_attempt_missing_in_the_middle_of_a_journal_is_damage(tmp_path: Path) -> None:
    made = made_of()
    made.entries.remove(ended(made)[0])
    made.entries.pop()
    assert not isinstance(made.entries[-1], Ended)
    assert "trial 1, attempt 1 is in the recording only" in findings_text(report_on(tmp_path, made))


@pytest.mark.parametrize("flags", [("late_ticks",), ("lost_samples", "frozen_display")])
def test_flag_not_supported_by_the_ticks_is_damage(tmp_path: Path, flags: tuple[str, ...]) -> None:
    made = made_of()
    changed(made, 1, lambda entry: replace(entry, flags=flags))
    assert "trial 2, attempt 1 has the flags" in findings_text(report_on(tmp_path, made))


def test_attempt_split_over_two_files_is_judged_by_its_outcome_alone(tmp_path: Path) -> None:
    made = made_of()
    first = ended(made)[0]
    changed(made, 0, lambda entry: replace(entry, flags=("stuck_left",)))
    cut = first.tick - 300
    parts = write(tmp_path, made, [cut])
    assert [findings_text(check(path)) for path in parts] == ["", ""]
    for path in parts:
        path.unlink()
    changed(made, 0, lambda entry: replace(entry, completion=9.0))
    assert "took 9.0 s in the journal" in findings_text(check(write(tmp_path, made, [cut])[1]))


def test_run_missing_from_the_journal_is_a_loss(tmp_path: Path) -> None:
    made = made_of()
    made.entries[:] = [Opened("another run", {}), Ended("the session was ended")]
    report = report_on(tmp_path, made)
    assert findings_text(report) == ""
    assert "trial 1, attempt 1" in findings_text(report, Severity.LOSS)


# --- time and losses ----------------------------------------------------------------------------------------------


def test_reported_server_stall_is_a_loss(tmp_path: Path) -> None:
    report = report_on(tmp_path, made_of(stood_still=2000))
    assert findings_text(report) == ""
    assert "the server stalled 1 times, for 30 ms in all" in findings_text(report, Severity.LOSS)


def test_event_without_a_pulse_of_the_trigger_box_is_a_loss(tmp_path: Path) -> None:
    made = made_of()
    place = max(k for k, record in enumerate(made.records) if isinstance(record, EventRecord))
    last = made.records[place]
    assert isinstance(last, EventRecord)
    given = [
        ("trigger", ""),
        ("trigger_lost", "the port is full"),
        ("trigger_lost", "no box"),
        ("trigger_lost", "no box"),
    ]
    made.records[place + 1 : place + 1] = [
        replace(last, seq=last.seq + number, name=name, details={"event": "held", "reason": reason})
        for number, (name, reason) in enumerate(given, start=1)
    ]
    report = report_on(tmp_path, made)
    assert findings_text(report) == ""
    assert "3 events had no pulse: no box (2); the port is full (1)" in findings_text(report, Severity.LOSS)
    assert "1 event had a pulse" in findings_text(report, Severity.SOUND)


@pytest.mark.parametrize("reported", [("29", 0), ("31", 0), ("30", 1)])
def test_time_jump_that_differs_from_the_reported_stall_is_damage(tmp_path: Path, reported: tuple[str, int]) -> None:
    made = made_of(stood_still=2000)
    (event,) = (r for r in made.records if isinstance(r, EventRecord) and r.name == "stood_still")
    place = made.records.index(event)
    made.records[place] = replace(event, tick=event.tick + reported[1], details={"milliseconds": reported[0]})
    assert "1 tick is not 1 ms after the one before: 2000" in findings_text(report_on(tmp_path, made))


def lossy(folder: Path, losses: tuple[int, ...], noted: int) -> CheckReport:
    """Check a session whose server stood still at tick 2000, while some records in a row were lost."""
    made = made_of(stood_still=2000)
    place = next(k for k, r in enumerate(made.records) if isinstance(r, EventRecord) and r.name == "stood_still")
    writer = rehearsed.writer_of(folder / "a.mcap", made.config, {})
    now = rehearsed.UTC_NS
    for number, record in enumerate(made.records[: place - 5]):
        now += rehearsed.MS // 2
        writer.write(record, number, now)
    number = place - 5
    for count in losses[:noted]:
        writer.note_lost(number, count, now)
        number += count
    stop = place - 5 + sum(losses)
    for record in made.records[stop:]:
        now += rehearsed.MS // 2
        writer.write(record, number, now)
        number += 1
    writer.finish(now)
    return check(folder / "a.mcap")


@pytest.mark.parametrize("losses", [(10,), (3, 7), (1,) * 10])
def test_noted_consecutive_losses_are_a_loss(tmp_path: Path, losses: tuple[int, ...]) -> None:
    report = lossy(tmp_path, losses, len(losses))
    assert findings_text(report) == ""
    assert "records were lost after tick 1994" in findings_text(report, Severity.LOSS)


def test_more_missing_ticks_than_noted_are_damage(tmp_path: Path) -> None:
    assert "ticks are missing without a note by the logger" in findings_text(lossy(tmp_path, (3, 7), 1))


def test_random_operators_trigger_every_event(tmp_path: Path) -> None:
    """The random operators above trigger every possible event."""
    events: set[int] = set()
    for seed in range(12):
        rows = Operated(CONFIG, random.Random(seed), {}).rows()
        events |= set(np.unique(rows["event"]).tolist())
    assert events >= set(map(int, legal_sessions.WISHES))
