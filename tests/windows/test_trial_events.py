"""Events between two views are reported once and in order."""

from dataclasses import replace

from display_parts import VIEW

from netboard.windows.participant.trial_events import SHOWN_TICKS, events_after


def events_of(*views):
    """Events of consecutive views, and the last state."""
    last, events = None, []
    for tick, changes in enumerate(views):
        last = events_after(last, replace(VIEW, **{"tick": 8 * tick, **changes}))
        events += last.events
    return events, last


def test_each_phase_is_reported_when_it_begins():
    events, _ = events_of(
        *({"phase": phase} for phase in ("idle", "levelling", "levelling", "running", "holding", "running"))
    )
    assert events == ["idle", "levelling", "running", "holding", "running"]


HOLDING = {"phase": "holding", "trial": 1, "share": 0.99}


def test_success_is_reported_even_if_no_view_showed_it():
    after = {"phase": "levelling", "trial": 2, "completion": 2.0}
    events, last = events_of(HOLDING, after)
    assert events == ["holding", "succeeded", "levelling"]
    assert last.result == "succeeded"
    events, last = events_of(HOLDING, {"phase": "succeeded", "trial": 1, "completion": 2.0}, after)
    assert events == ["holding", "succeeded", "levelling"]
    assert last.result == "succeeded"


def test_success_with_the_same_completion_time_is_reported():
    timed = {"completion": 2.0}
    assert events_of(HOLDING | timed, {"phase": "levelling", "trial": 2} | timed)[0][1:] == ["succeeded", "levelling"]


def test_last_success_of_the_block_is_reported_before_its_end():
    assert events_of(HOLDING, {"phase": "finished", "trial": 1, "completion": 2.0})[0][1:] == ["succeeded", "finished"]


def test_failure_is_reported_even_if_no_view_showed_it():
    before, after = {"phase": "running", "failures": 0}, {"phase": "levelling", "failures": 1}
    for views in ((before, after), (before, {"phase": "failed", "failures": 1}, after)):
        events, last = events_of(*views)
        assert events == ["running", "failed", "levelling"]
        assert last.result == "failed"


def test_interrupted_hold_is_neither_success_nor_failure():
    for phase in ("levelling", "paused", "finished"):
        events, last = events_of(HOLDING | {"share": 0.2}, {"phase": phase, "trial": 1})
        assert events == ["holding", phase]
        assert last.result == ""


def test_result_is_kept_for_a_while_but_not_into_the_next_trial():
    after = {"phase": "levelling", "trial": 2, "completion": 2.0}
    assert events_of(HOLDING, after, after | {"tick": SHOWN_TICKS})[1].result == "succeeded"
    assert events_of(HOLDING, after, after | {"tick": SHOWN_TICKS + 9})[1].result == ""
    assert events_of(HOLDING, after, {"phase": "running", "trial": 2, "completion": 2.0})[1].result == ""


def test_new_block_reports_no_result_of_the_previous_one():
    events, last = events_of(HOLDING | {"block": 1}, {"phase": "idle", "block": 2, "trial": 1})
    assert events == ["holding", "idle"]
    assert last.result == ""
