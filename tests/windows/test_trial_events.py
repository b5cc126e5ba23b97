"""Events between two views are reported once and in order."""

from dataclasses import replace

from display_parts import VIEW

from netboard.windows.participant.trial_events import SHOWN_TICKS, events_after


def told(*views):
    """Events of some views after each other, and the last state."""
    last, events = None, []
    for tick, changes in enumerate(views):
        last = events_after(last, replace(VIEW, **{"tick": 8 * tick, **changes}))
        events += last.events
    return events, last


def test_phases_are_told_as_they_begin():
    events, _ = told(
        *({"phase": phase} for phase in ("idle", "levelling", "levelling", "running", "holding", "running"))
    )
    assert events == ["idle", "levelling", "running", "holding", "running"]


HOLDING = {"phase": "holding", "trial": 1, "share": 0.99}


def test_a_success_is_told_whether_it_was_shown_or_not():
    after = {"phase": "levelling", "trial": 2, "completion": 2.0}
    events, last = told(HOLDING, after)
    assert events == ["holding", "succeeded", "levelling"]
    assert last.result == "succeeded"
    events, last = told(HOLDING, {"phase": "succeeded", "trial": 1, "completion": 2.0}, after)
    assert events == ["holding", "succeeded", "levelling"]
    assert last.result == "succeeded"


def test_a_success_in_the_same_time_as_the_one_before_is_one_too():
    timed = {"completion": 2.0}
    assert told(HOLDING | timed, {"phase": "levelling", "trial": 2} | timed)[0][1:] == ["succeeded", "levelling"]


def test_the_last_success_ends_the_block():
    assert told(HOLDING, {"phase": "finished", "trial": 1, "completion": 2.0})[0][1:] == ["succeeded", "finished"]


def test_a_failure_is_told_whether_it_was_shown_or_not():
    before, after = {"phase": "running", "failures": 0}, {"phase": "levelling", "failures": 1}
    for views in ((before, after), (before, {"phase": "failed", "failures": 1}, after)):
        events, last = told(*views)
        assert events == ["running", "failed", "levelling"]
        assert last.result == "failed"


def test_who_gives_up_has_neither_failed_nor_succeeded():
    for phase in ("levelling", "paused", "finished"):
        events, last = told(HOLDING | {"share": 0.2}, {"phase": phase, "trial": 1})
        assert events == ["holding", phase]
        assert last.result == ""


def test_a_result_is_told_for_a_while_and_not_in_the_next_trial():
    after = {"phase": "levelling", "trial": 2, "completion": 2.0}
    assert told(HOLDING, after, after | {"tick": SHOWN_TICKS})[1].result == "succeeded"
    assert told(HOLDING, after, after | {"tick": SHOWN_TICKS + 9})[1].result == ""
    assert told(HOLDING, after, {"phase": "running", "trial": 2, "completion": 2.0})[1].result == ""


def test_another_block_is_another_series():
    events, last = told(HOLDING | {"block": 1}, {"phase": "idle", "block": 2, "trial": 1})
    assert events == ["holding", "idle"]
    assert last.result == ""
