"""The arithmetic of a replay, and what is marked on its time line."""

import numpy as np
import pytest
from display_parts import two_trials
from hypothesis import given
from hypothesis import strategies as st

from netboard.display.timeline import SPEEDS, Playback, begin, best_so_far, clock, marks, seconds

LENGTH = 100.0


def test_position_goes_with_time_and_speed():
    replay = Playback(LENGTH).toggle(10.0)
    assert replay.at(13.0) == pytest.approx(3.0)
    faster = replay.faster(13.0, 1)
    assert faster.speed == 2.0
    assert faster.at(14.0) == pytest.approx(5.0)
    paused = faster.toggle(14.0)
    assert paused.at(99.0) == pytest.approx(5.0)
    assert paused.step(99.0, -2.0).at(99.0) == pytest.approx(3.0)


def test_it_stops_at_the_end_and_begins_again_from_there():
    replay = Playback(LENGTH).toggle(0.0)
    ended = replay.now(1e6)
    assert (ended.position, ended.playing) == (LENGTH, False)
    again = ended.toggle(1e6)
    assert again.playing
    assert again.at(1e6 + 1) == pytest.approx(1.0)


def test_speeds_stay_in_their_range_and_an_odd_one_finds_its_neighbours():
    replay = Playback(LENGTH)
    assert replay.faster(0.0, 99).speed == SPEEDS[-1]
    assert replay.faster(0.0, -99).speed == SPEEDS[0]
    odd = Playback(LENGTH, speed=3.0)
    assert (odd.faster(0.0, 1).speed, odd.faster(0.0, -1).speed) == (4.0, 2.0)


STEPS = st.tuples(st.sampled_from(("toggle", "seek", "step", "faster")), st.floats(-200, 200), st.floats(0, 50))


@given(st.lists(STEPS, max_size=30))
def test_no_key_leads_out_of_the_recording_or_makes_a_jump(steps):
    replay, now = Playback(LENGTH), 0.0
    for what, value, wait in steps:
        now += wait
        before = replay.at(now)
        if what == "toggle":
            after = replay.toggle(now)
            assert after.at(now) in (before, 0.0)
        elif what == "seek":
            after = replay.seek(now, value)
            assert after.at(now) == min(max(value, 0.0), LENGTH)
        elif what == "step":
            after = replay.step(now, value)
            assert after.at(now) == min(max(before + value, 0.0), LENGTH)
        else:
            after = replay.faster(now, 1 if value > 0 else -1)
            assert after.at(now) == before
        replay = after
        assert 0.0 <= replay.at(now + 7.0) <= LENGTH


def test_marks_are_where_the_events_are():
    found = marks(two_trials())
    assert [(mark.time, mark.kind) for mark in found] == [
        (pytest.approx(1.0), "release"),
        (pytest.approx(4.0), "success"),
        (pytest.approx(6.0), "release"),
        (pytest.approx(8.0), "failure"),
    ]
    assert found[1].label == "held 2"


def test_times_begin_and_best():
    ticks = two_trials()
    assert seconds(ticks)[-1] == pytest.approx(9.999)
    assert begin(ticks) == pytest.approx(0.5)
    assert begin(ticks[600:]) == 0.0
    best = best_so_far(ticks)
    assert np.isinf(best[3999])
    assert best[4000] == 3.0


@pytest.mark.parametrize(
    ("position", "words"), [(0.0, "0:00.0"), (61.26, "1:01.3"), (59.96, "1:00.0"), (600, "10:00.0")]
)
def test_clock(position, words):
    assert clock(position) == words
