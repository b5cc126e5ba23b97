"""The view, the information and the marks at each position of a recording."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_recordings import CONFIG, loaded_recording, two_trials
from netboard.base.config import SIDES
from netboard.base.errors import RecordingError
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord
from netboard.recording.replay.marks import ANY, near
from netboard.stage.curtain import make_curtain, view_of
from netboard.task.trials.state_machine import Phase

RECORDING = loaded_recording(two_trials())
FIRST_NS = 5_000_000_000


def event(tick, what, /, **details):
    return EventRecord(0, tick, FIRST_NS + (tick - 100) * 1_000_000, what, details)


def test_marks_show_trials_and_their_outcomes():
    assert [(mark.time, mark.kind, mark.label) for mark in RECORDING.marks] == [
        (pytest.approx(0.501), "trial", "trial 1: success in 3.000 s"),
        (pytest.approx(1.0), "release", "level 1"),
        (pytest.approx(4.0), "success", "held 1"),
        (pytest.approx(4.001), "trial", "trial 2: fell"),
        (pytest.approx(6.0), "release", "level 2"),
        (pytest.approx(8.0), "failure", "fell 2"),
    ]


@pytest.mark.parametrize("lost", [slice(3900, 6300), slice(0, 1500)])
def test_mark_of_an_attempt_whose_release_is_missing_says_so(lost):
    found = loaded_recording(np.delete(two_trials(), lost))
    second = lost.start > 0
    told = [(mark.trial, mark.label) for mark in found.marks if mark.kind == "trial"]
    unreleased = [(trial, label) for trial, label in told if label.endswith(", its release is not recorded")]
    assert unreleased == [told[second]]
    assert unreleased[0][0] == 1 + second
    assert [one.tick for one in found.attempts] == [one.tick for one in RECORDING.attempts]


def test_marks_show_notes_events_and_gaps_without_duplicates():
    ticks = np.delete(two_trials(), slice(3000, 3200))
    events = (
        event(100, BLOCK_BEGAN, config="..."),
        event(1100, "level"),
        event(2100, "command", name="note", argument='{"text": "he laughs", "tick": 2050}'),
        event(2200, "command", name="note", argument="she too"),
        event(2300, "stood_still", milliseconds="31"),
        event(2400, "agent_left", side="right", reason="fell silent"),
        event(4100, "attempt_ended", trial="1", attempt="1", outcome="success", flags="late"),
    )
    marks = [(mark.tick, mark.kind, mark.label) for mark in loaded_recording(ticks, *events).marks]
    assert [mark for mark in marks if mark[1] in ("note", "event", "gap")] == [
        (2050, "note", "he laughs"),
        (2200, "note", "she too"),
        (2300, "event", "stood still: 31 ms"),
        (2400, "event", "right agent left: fell silent"),
        (3099, "gap", "ticks 3100 to 3299 are missing"),
    ]


@pytest.mark.parametrize("words", ["{the ball is stuck", "{}", '{"text": 5}'])
def test_note_that_the_server_refused_does_not_prevent_the_replay(words):
    refused = event(2100, "command", name="note", argument=words, accepted="false", reason="the note is not JSON")
    marks = loaded_recording(two_trials(), refused).marks
    assert [mark.label for mark in marks if mark.kind in ("note", "event")] == ["command note: the note is not JSON"]


def test_note_after_spaces_shows_its_text():
    note = event(2100, "command", name="note", argument=' {"text": "he laughs", "tick": 2050}', accepted="true")
    marks = loaded_recording(two_trials(), note).marks
    assert [(mark.tick, mark.label) for mark in marks if mark.kind == "note"] == [(2050, "he laughs")]


def test_next_and_previous_mark_are_found():
    def to(position, kind, *, back=False):
        found = near(RECORDING.marks, position, kind, back=back)
        return None if found is None else found.time

    assert to(0.0, "trial") == pytest.approx(0.501)
    assert to(0.501, "trial") == pytest.approx(4.001), "the next mark is not the current one"
    assert to(4.001, "trial") is None
    assert to(3.0, ANY) == pytest.approx(4.0)
    assert to(5.0, "trial", back=True) == pytest.approx(4.001)
    assert to(4.1, "trial", back=True) == pytest.approx(0.501), "going back twice goes back two marks"
    assert to(0.2, "trial", back=True) is None


def test_next_trial_is_not_another_attempt_of_the_same():
    ticks = two_trials()
    ticks["trial"][4001:], ticks["attempt"][4001:] = 1, 2
    marks = loaded_recording(ticks).marks
    assert [mark.label[:18] for mark in marks if mark.kind == "trial"] == ["trial 1: success i", "trial 1, attempt 2"]
    assert near(marks, 0.6, "trial", back=False) is None
    assert near(marks, 9.0, "trial", back=True).time == pytest.approx(0.501)


def test_row_applies_until_the_next_tick():
    assert [RECORDING.at(position) for position in (-1.0, 0.0, 0.0009, 0.001, 0.0015, 9.999, 99.0)] == [
        *(0, 0, 0, 1, 1, 9999, 9999)
    ]


@given(st.integers(0, 9999), st.integers(-20_000, 20_000))
def test_steps_move_by_ticks(index, count):
    here = float(RECORDING.times[index])
    assert RECORDING.at(here) == index
    assert RECORDING.at(RECORDING.stepped(here, count)) == min(max(index + count, 0), 9999)


def test_trials_are_found_by_number():
    assert RECORDING.trials == (1, 2)
    assert RECORDING.trial(1) == pytest.approx((0.501, 4.001))
    assert RECORDING.trial(3) is None
    assert RECORDING.time_of(1100) == pytest.approx(1.0)


def test_gap_shows_the_last_tick_before_it_and_is_named():
    recording = loaded_recording(np.delete(two_trials(), slice(3000, 3200)))
    assert recording.at(3.1) == 2999
    assert recording.gap_at(3.1) == "ticks 3100 to 3299 are missing"
    assert "ticks 3100 to 3299 are missing" in recording.where(3.1)
    assert recording.gap_at(2.999) == recording.gap_at(3.2) == ""
    assert recording.stepped(3.1, 1) == pytest.approx(3.2)
    one = loaded_recording(np.delete(two_trials(), 3000))
    assert one.gap_at(3.0) == "tick 3100 is missing"


def test_best_time_applies_from_the_tick_of_the_success():
    assert two_trials()["completion"][4000] == 0.0, "a row has the state that its tick found"
    assert (RECORDING.best(3999), RECORDING.best(4000), RECORDING.best(9999)) == (None, 3.0, 3.0)
    assert loaded_recording(two_trials()[4001:]).best(0) == 3.0


def test_rest_counts_down_from_the_start_of_the_block_while_idle():
    config = replace(CONFIG, block=replace(CONFIG.block, rest=0.4))
    recording = loaded_recording(two_trials(), event(100, BLOCK_BEGAN), config=config)
    assert recording.rest(100) == pytest.approx(0.3)
    assert recording.rest(450) is None
    assert loaded_recording(two_trials(), config=config).rest(100) is None, "the start of the block is unknown"
    active = two_trials()
    active["phase"][:500] = Phase.PAUSED
    assert loaded_recording(active, event(100, BLOCK_BEGAN), config=config).rest(100) is None


@given(st.integers(0, 9999), st.sampled_from(SIDES))
def test_replayed_view_equals_that_of_the_curtain(index, station):
    view = RECORDING.view(index, station, 7, 3)
    assert view == view_of(make_curtain(CONFIG), two_trials()[index], station, 3.0 if index >= 4000 else None, 7, 3)
    assert (view.left is None) == (station == "right")


def test_outcomes_include_only_attempts_judged_so_far():
    judged = loaded_recording(
        two_trials(),
        event(4100, "held", completion="2.5"),
        event(4100, "attempt_ended", trial="1", attempt="1", outcome="success", flags="late,lost"),
        event(8100, "attempt_ended", trial="2", attempt="1", outcome="fell", flags="", repeats="1"),
    )
    assert judged.outcomes(3999) == []
    assert judged.outcomes(4000) == [(1, 1, 1, "success", 2.5, "late,lost", 0)]
    block, trial, attempt, outcome, completion, flags, repeats = judged.outcomes(9999)[1]
    assert (block, trial, attempt, outcome, flags, repeats) == (1, 2, 1, "fell", "", 1)
    assert np.isnan(completion)


def test_outcomes_come_from_the_attempts_without_verdicts():
    assert [(row[1], row[3]) for row in RECORDING.outcomes(9999)] == [
        (attempt.trial, attempt.outcome) for attempt in RECORDING.attempts
    ]


def test_marks_name_the_station_of_a_form_and_the_event_of_a_trigger():
    form = event(2100, "questionnaire_unanswered", station="left", block="1")
    lost = event(2200, "trigger_lost", event="held", event_tick="2199", code="4", reason="no box")
    labels = [mark.label for mark in loaded_recording(two_trials(), form, lost).marks]
    assert "left questionnaire unanswered" in labels
    assert "trigger lost held: no box" in labels


def test_position_text_has_tick_phase_trial_and_last_event():
    assert RECORDING.where(3.0) == "tick 3100, running, trial 1, last event: level 1"
    long = loaded_recording(two_trials(), event(2100, "command", name="note", argument="x" * 5000))
    assert len(long.where(3.0)) < 200


def test_recording_without_ticks_cannot_be_replayed():
    with pytest.raises(RecordingError, match="no tick"):
        loaded_recording(two_trials()[:0])
