"""Progress of a session reconstructed from its journal, for any events and any truncation."""

import json
import math
import random
from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.errors import RecordingError
from netboard.base.tables.experiment import Quality
from netboard.task.journal.entries import (
    KINDS,
    AttemptBegan,
    AttemptEnded,
    BlockBegan,
    BlockEnded,
    EmergencyReleased,
    EmergencyStopped,
    Ended,
    Entry,
    FormAwaited,
    Header,
    JournalContent,
    Note,
    Opened,
    Outcome,
    Repeat,
    Resumed,
    Veto,
    line_of,
    read_lines,
)
from netboard.task.journal.progress import SessionProgress, progress_of, resume_words
from netboard.task.journal.same_session import (
    changed_plan,
    changes,
    require_same_people,
    require_same_plan,
    skipped_sessions,
)
from netboard.task.trials.repeats import Repeats, wants_repeat
from session_model import HEADER, PLAN, Planned, check, entries_of_run

AT = "2026-11-22T18:52:03.123Z"
SOURCE = "D03_S01.journal.jsonl"


def written(entries: list[Entry], header: Header = HEADER) -> bytes:
    return b"".join(line_of(entry, AT) for entry in (header, *entries))


def progress_after(*entries: Entry, plan: tuple[Planned, ...] = PLAN) -> SessionProgress:
    return progress_of(HEADER, [Opened("r1", {}), *entries], plan)


def began(trial: int, attempt: int = 1, block: int = 1) -> AttemptBegan:
    return AttemptBegan(block, trial, attempt, "r1", 0)


def ended(trial: int, attempt: int = 1, outcome: Outcome = "success", block: int = 1, **more: Any) -> AttemptEnded:
    completion = 1.5 if outcome == "success" else None
    made = AttemptEnded(block, trial, attempt, outcome, completion, (), 0, False, "r1", 0, 1000 * trial)
    return replace(made, **more)


BEGAN = BlockBegan(1, 1, 1, "r1", 5)


# --- lines -----------------------------------------------------------------------------------------------------------

EVERY_ENTRY: list[Entry] = [
    Opened("r1", {"dyad": "D03", "remark": 'line\nfeed, "quotes", ü'}),
    BEGAN,
    began(1),
    ended(1, flags=("late_ticks", "clipped"), repeats=2, again=True),
    Repeat(1, 1),
    Veto(1, 1),
    Note("müde", "r1", 77),
    EmergencyStopped("emergency stop by an operator", "r1", 80),
    EmergencyReleased("r1", 90),
    BlockEnded(1, "stopped"),
    FormAwaited(1, ("left", "right")),
    Resumed("r2"),
    Ended("the lab closes"),
]


def test_every_entry_survives_a_round_trip() -> None:
    assert {type(entry) for entry in EVERY_ENTRY} == set(KINDS.values()) - {Header}
    data = written(EVERY_ENTRY)
    assert read_lines(data, SOURCE) == JournalContent(HEADER, tuple(EVERY_ENTRY), len(data), b"")
    assert data.count(b"\n") == 1 + len(EVERY_ENTRY)
    assert all(json.loads(line)["at"] == AT for line in data.splitlines())


def test_writing_a_non_finite_value_raises_value_error() -> None:
    with pytest.raises(ValueError, match="Out of range"):
        line_of(ended(1, completion=math.nan), AT)


def test_lone_surrogate_in_a_note_is_replaced() -> None:
    data = written([Note("what \udc80", "r1", 0)])
    assert read_lines(data, SOURCE).entries == (Note("what ?", "r1", 0),)


@pytest.mark.parametrize(
    "tail", [b'{"entry":"no', b'{"entry":"note","at":"x"', b"\0\0\0\0", b"\xff\xfe", b"\0\0\n", b"[]\n"]
)
def test_torn_last_line_is_dropped_and_reported(tail: bytes) -> None:
    data = written(EVERY_ENTRY)
    assert read_lines(data + tail, SOURCE) == JournalContent(HEADER, tuple(EVERY_ENTRY), len(data), tail)


def test_last_line_without_newline_is_torn() -> None:
    data = written(EVERY_ENTRY)
    lines = read_lines(data[:-1], SOURCE)
    assert lines.entries == tuple(EVERY_ENTRY[:-1])
    assert lines.torn == line_of(EVERY_ENTRY[-1], AT)[:-1]


@pytest.mark.parametrize(
    ("number", "line", "words"),
    [
        (3, b'{"entry":"attem', "is damaged: found"),
        (3, b"", "is damaged: found ''"),
        (3, b'{"entry":"dance"}', "found the entry 'dance', expected one of header, opened"),
        (3, b'{"at":"x"}', "found the entry None"),
        (3, b'{"entry":["a"]}', "found the entry ['a']"),
        (4, b'{"entry":"repeat","block":1}', "repeat: trial: field required"),
        (4, b'{"entry":"repeat","block":1,"trial":"2"}', "repeat: trial: input should be a valid integer"),
        (4, b'{"entry":"repeat","block":1,"trial":2,"who":"me"}', "repeat: who: "),
        (4, b'{"entry":"block_ended","block":1,"how":"well"}', "block_ended: how: input should be 'finished'"),
        (1, b'{"entry":"header","format":2,"netboard":"0.9.0"}', "has format version 2, this netboard reads version 1"),
        (1, b'{"entry":"repeat","block":1,"trial":2}', 'found "repeat", expected the header of a journal'),
        (5, line_of(HEADER, AT)[:-1], "a second header"),
    ],
)
def test_damage_elsewhere_is_reported_with_file_and_line(number: int, line: bytes, words: str) -> None:
    lines = written(EVERY_ENTRY).split(b"\n")
    lines[number - 1] = line
    with pytest.raises(RecordingError) as caught:
        read_lines(b"\n".join(lines), SOURCE)
    assert str(caught.value).startswith(f"{SOURCE}, line {number}: ")
    assert words in str(caught.value)


@pytest.mark.parametrize("data", [b"", b'{"entry":"hea', b"\0\0\n"])
def test_journal_without_header_is_reported_as_empty(data: bytes) -> None:
    with pytest.raises(RecordingError, match="nothing was recorded in it; delete it"):
        read_lines(data, SOURCE)


@given(st.integers(0, 2**32), st.integers(0, 400), st.data())
@settings(max_examples=60, deadline=None)
def test_one_corrupted_byte_raises_only_recording_error(seed: int, place: int, data: st.DataObject) -> None:
    entries = list(entries_of_run(random.Random(seed), "r1", [], Quality()))
    whole = bytearray(written(entries))
    whole[place % len(whole)] = data.draw(st.integers(0, 255))
    with suppress(RecordingError):
        lines = read_lines(bytes(whole), SOURCE)
        assert len(lines.entries) <= len(entries)
        assert progress_of(lines.header, lines.entries, PLAN, SOURCE).block <= progress_of(HEADER, entries, PLAN).block


# --- progress --------------------------------------------------------------------------------------------------------


def test_empty_journal_starts_at_the_first_block() -> None:
    found = progress_after()
    assert (found.block, found.trial, found.attempt, found.begun, found.complete) == (1, 1, 1, False, False)
    assert resume_words(found) == "begins at the start of block 1 of 3"


def test_session_resumes_at_the_first_trial_not_done() -> None:
    done = [entry for trial in range(1, 23) for entry in (began(trial), ended(trial))]
    done[6:6] = [began(4, 1), ended(4, 1, "fell"), began(4, 2), ended(4, 2, "fell"), began(4, 3), ended(4, 3, "paused")]
    done[12:14] = [began(4, 4), ended(4, 4)]
    now = progress_after(BEGAN, *done, began(23, 1), ended(23, 1, "timed_out"), began(23, 2), plan=(Planned(1, 60),))
    assert (now.block, now.trial, now.attempt) == (1, 23, 3)
    assert (now.successes, now.failures, now.skipped, now.extra, now.block_ticks) == (22, 3, 0, 0, 23_000)
    assert now.under_way == (1, 23, 2)
    assert now.incomplete == ((1, 23, 2),)
    assert now.outcomes[-1][:4] == (1, 23, 2, "incomplete")
    assert min(now.completions) == 1.5
    assert resume_words(now) == (
        "resumes at block 1 of 1, trial 23 of 60 (22 done, 3 failed attempts), attempt 3; "
        "the unfinished attempt is kept as incomplete"
    )


def test_skipped_trials_and_repeats_are_counted() -> None:
    plan = (Planned(1, 3),)
    now = progress_after(
        BEGAN,
        began(1),
        ended(1, again=True),
        began(2),
        ended(2, 1, "paused"),
        ended(2, 1, "skipped"),
        Repeat(1, 2),
        began(3),
        ended(3),
        plan=plan,
    )
    assert (now.trial, now.successes, now.skipped, now.extra) == (4, 2, 1, 2)
    assert now.repeats == Repeats(3, (1, 2))
    assert now.repeats.repeated_by(now.trial) == 1
    assert resume_words(now) == "resumes at block 1 of 1, trial 4 of 5 (2 done, 1 skipped, 2 trials added)"


def test_veto_of_the_last_repeat_completes_the_block() -> None:
    plan = (Planned(1, 1), Planned(2, 1))
    asked = (BEGAN, began(1), ended(1, again=True))
    assert progress_after(*asked, plan=plan).block == 1
    vetoed = progress_after(*asked, Veto(1, 1), plan=plan)
    assert vetoed.done == (1,)
    assert resume_words(vetoed) == "resumes at the start of block 2 of 2"


def test_block_with_all_trials_done_is_complete_without_its_end_entry() -> None:
    assert progress_after(BEGAN, began(1), ended(1), plan=(Planned(1, 1),)).complete


def test_completed_session_has_nothing_to_resume() -> None:
    now = progress_after(BEGAN, BlockEnded(1, "given_up"), plan=(Planned(1, 5),))
    assert now.complete
    assert resume_words(now) == "nothing to resume: all 1 blocks are complete"


def test_awaited_answers_are_those_of_the_newest_entry() -> None:
    asked, answered, nobody = (FormAwaited(1, stations) for stations in (("left", "right"), ("right",), ()))
    over = (BEGAN, began(1), ended(1))
    plan = (Planned(1, 1),)
    assert progress_after(*over, asked, answered, plan=plan).form == answered
    assert progress_after(*over, asked, nobody, plan=plan).form == nobody
    words = resume_words(progress_after(*over, asked, plan=plan))
    assert "complete; answers to the questionnaires of block 1 are lost" in words
    assert "left" not in words, "only people answer, and the block may be blinded"


def test_stopped_block_resumes_unless_a_later_block_begins() -> None:
    stopped = (BEGAN, began(1), ended(1), BlockEnded(1, "stopped"))
    assert (progress_after(*stopped).block, progress_after(*stopped).trial) == (1, 2)
    later = progress_after(*stopped, BlockBegan(2, 1, 1, "r1", 0))
    assert (later.done, later.block) == ((1,), 2)


def test_attempt_interrupted_by_a_crash_stays_incomplete() -> None:
    now = progress_after(BEGAN, began(1), Resumed("r2"), BlockBegan(1, 1, 2, "r2", 9), began(1, 2), ended(1, 2))
    assert [row[:4] for row in now.outcomes] == [(1, 1, 1, "incomplete"), (1, 1, 2, "success")]
    assert now.under_way is None
    assert now.runs == ("r1", "r2")


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([BlockBegan(9, 1, 1, "r1", 0)], "block 9, and the plan has blocks 1 to 3"),
        ([BlockBegan(2, 1, 1, "r1", 0)], "block 2 begins before the end of block 1"),
        ([BEGAN, BlockEnded(1, "given_up"), BEGAN], "block 1 begins, although it is over"),
        ([began(1)], "an entry of block 1, which is not the current block"),
        ([BEGAN, began(2)], "trial 2, attempt 1 of block 1, where trial 1, attempt 1 comes next"),
        ([BEGAN, began(1), ended(1, 1, "fell"), began(1)], "where trial 1, attempt 2 comes next"),
        ([BEGAN, began(1), ended(1), ended(1)], "where trial 2, attempt 1 comes next"),
        ([BEGAN, Veto(1, 1)], "a veto of the repeat of trial 1, which was not requested"),
    ],
)
def test_contradictory_entries_are_reported_with_their_line(entries: list[Entry], words: str) -> None:
    with pytest.raises(RecordingError) as caught:
        progress_of(HEADER, entries, PLAN, SOURCE)
    line = len(entries) + 1
    assert str(caught.value).startswith(f"{SOURCE}, line {line}: does not fit session S01 of dyad D03: ")
    assert words in str(caught.value)


RULES = st.sampled_from([Quality(), Quality(repeat="flagged")])


@pytest.mark.slow
@given(st.integers(0, 2**32), RULES, st.lists(st.integers(0, 60), max_size=6))
@settings(max_examples=150, deadline=None)
def test_counts_are_correct_after_any_number_of_crashes(seed: int, rules: Quality, crashes: list[int]) -> None:
    chance = random.Random(seed)
    entries: list[Entry] = []
    for run, written_before in enumerate([*crashes, *[1000] * 20]):
        for number, entry in enumerate(entries_of_run(chance, f"r{run}", entries, rules)):
            if number >= written_before:
                break
            entries.append(entry)
            check(entries, progress_of(HEADER, entries, PLAN))
        if progress_of(HEADER, entries, PLAN).complete:
            return
    raise AssertionError("the session did not complete")


@given(st.integers(0, 2**32), RULES, st.data())
@settings(max_examples=100, deadline=None)
def test_journal_truncated_at_any_byte_gives_the_progress_at_that_point(
    seed: int, rules: Quality, data: st.DataObject
) -> None:
    entries = list(entries_of_run(random.Random(seed), "r1", [], rules))
    whole, header = written(entries), len(line_of(HEADER, AT))
    cut = data.draw(st.integers(header, len(whole)))
    found = read_lines(whole[:cut], SOURCE)
    count = len(found.entries)
    assert list(found.entries) == entries[:count]
    assert whole.startswith(written(entries[:count]) + found.torn)
    assert len(whole[:cut]) == found.sound + len(found.torn)
    now, final = progress_of(HEADER, found.entries, PLAN), progress_of(HEADER, entries, PLAN)
    check(entries[:count], now)
    assert final.done[: len(now.done)] == now.done
    sure = len(now.outcomes) - (now.under_way is not None)
    assert repr(final.outcomes[:sure]) == repr(now.outcomes[:sure])


# --- repeats ---------------------------------------------------------------------------------------------------------


def test_flagged_successful_trials_are_repeated_once() -> None:
    rules, none = Quality(repeat="flagged"), Repeats(60)
    assert wants_repeat(rules, "success", ("clipped",), 7, none)
    assert not wants_repeat(Quality(), "success", ("clipped",), 7, none)
    assert not wants_repeat(rules, "success", (), 7, none)
    assert not wants_repeat(rules, "fell", ("clipped",), 7, none)
    assert not wants_repeat(rules, "success", ("clipped",), 7, none.ask(7)), "twice"
    assert not wants_repeat(rules, "success", ("clipped",), 61, none.ask(7)), "a repeat"
    assert not wants_repeat(rules, "success", ("clipped",), 7, none.ask(7).veto(7)), "against the operator"


def test_extra_trials_map_to_the_trials_they_repeat() -> None:
    asked = Repeats(60).ask(5).ask(9).ask(5)
    assert asked.extra == 3
    assert [asked.repeated_by(trial) for trial in (1, 60, 61, 62, 63, 64)] == [0, 0, 5, 9, 5, 0]
    assert asked.veto(5).asked == (5, 9)
    assert Repeats(60).ask(5).veto(5).ask(5).vetoed == ()


def test_refused_repeats_and_vetoes_state_the_reason() -> None:
    asked = Repeats(60).ask(5).ask(9)
    assert asked.why_not_ask(7, 20) == ""
    assert asked.why_not_ask(5, 20) == "trial 5 is already to be repeated"
    assert asked.why_not_ask(5, 62) == ""
    assert asked.why_not_ask(20, 20) == "trial 20 cannot be repeated: trials 1 to 19 are done in this block"
    assert asked.why_not_ask(20, 20, under_way=True) == ""
    assert asked.why_not_ask(21, 20, under_way=True) != ""
    assert asked.why_not_ask(1, 1) == "no trial is done in this block, so none can be repeated"
    assert asked.why_not_veto(9, 61) == ""
    assert asked.why_not_veto(5, 61) == "the repeat of trial 5 has begun; skip it to leave it out"
    assert asked.why_not_veto(8, 61) == "no repeat of trial 8 was requested"
    assert [asked.newest(present) for present in (1, 60, 61, 62)] == [9, 9, 9, 0]


# --- the same session ------------------------------------------------------------------------------------------------


def test_same_plan_may_be_resumed() -> None:
    require_same_plan(HEADER, replace(HEADER, netboard="0.2.0", config_digest="d1", consent=False), SOURCE)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"dyad": "D04"}, "dyad: D03 when the session began, D04 now"),
        ({"seed": 8, "plan_digest": "x"}, "seed: 7 when the session began, 8 now"),
        ({"participants": ("P05", "P07")}, "participants: P05 and P06 when the session began, P05 and P07 now"),
        ({"pilot": True}, "pilot run: no when the session began, yes now"),
        ({"study_digest": "x", "plan_digest": "y"}, "the text of the study has changed"),
        ({"plan_digest": "y"}, "the same study now gives another plan; expected the same --blocks and --trials"),
    ],
)
def test_resuming_with_another_plan_is_refused_with_the_difference(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(RecordingError) as caught:
        require_same_plan(HEADER, replace(HEADER, **changed), SOURCE)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{SOURCE}: cannot be resumed: {words}")


def test_other_session_of_a_dyad_must_have_the_same_people() -> None:
    other = replace(HEADER, name="S02", session=2)
    require_same_people(HEADER, other, SOURCE)
    typed = replace(other, participants=("P05", "P07"))
    with pytest.raises(RecordingError) as caught:
        require_same_people(HEADER, typed, SOURCE)
    assert str(caught.value).startswith("participants: P05 and P07, but P05 and P06 in session S01 of dyad D03; ")
    assert SOURCE in str(caught.value)
    require_same_people(HEADER, replace(typed, pilot=True), SOURCE)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"seed": 8, "plan_digest": "x"}, "seed: 7 in session S01, 8 now"),
        ({"study_digest": "x", "plan_digest": "y"}, "the text of the study has changed"),
        ({"study_digest": "x"}, ""),
        ({"plan_digest": "y"}, "check --dyad"),
        ({"plan_digest": "y", "pilot": True}, ""),
    ],
)
def test_other_session_of_a_dyad_says_how_its_plan_differs(changed: dict[str, Any], words: str) -> None:
    said = changed_plan(HEADER, replace(HEADER, name="S02", session=2, **changed))
    assert words in said
    assert bool(said) == bool(words)


@pytest.mark.parametrize(
    ("number", "others", "pilot", "words"),
    [
        (1, [], False, ""),
        (2, [{}], False, ""),
        (2, [], False, "session 2 of dyad D03 begins, but no journal here is of session 1: check --dyad and --session"),
        (2, [{"pilot": True}], False, "of session 1:"),
        (2, [{"study": "another"}], False, "of session 1:"),
        (2, [], True, ""),
        (4, [{"session": 2}], False, "of session 1 or 3:"),
    ],
)
def test_session_before_its_earlier_ones_says_so(
    number: int, others: list[dict[str, Any]], pilot: bool, words: str
) -> None:
    said = skipped_sessions([replace(HEADER, **one) for one in others], replace(HEADER, session=number, pilot=pilot))
    assert words in said
    assert bool(said) == bool(words)


def test_changes_that_do_not_prevent_resuming_are_listed() -> None:
    assert changes(HEADER, HEADER) == ()
    assert changes(HEADER, replace(HEADER, netboard="0.2.0", config_digest="d1")) == (
        "version of netboard: 0.1.0 when the session began, 0.2.0 now",
        "the rig's configuration has changed",
    )


def test_changed_settings_are_named_when_a_session_resumes() -> None:
    then = replace(HEADER, config='[physics]\nM = 1.0\nmodel = "paper"\n[agents.left]\ndevice = "touch"\n')
    now = replace(HEADER, config_digest="d1", config='[physics]\nM = 1.0\nmodel = "lagrangian"\nnew = [1, 2]\n')
    assert changes(then, now) == (
        "physics.model: paper when the session began, lagrangian now",
        "agents.left.device: touch when the session began, none now",
        "physics.new: none when the session began, [1, 2] now",
    )
