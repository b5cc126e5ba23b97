"""The position arithmetic of a replay."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.recording.replay.position import SPEEDS, ReplayPosition, clock

LENGTH = 100.0


def test_position_advances_with_time_and_speed():
    replay = ReplayPosition(LENGTH).toggle(10.0)
    assert replay.at(13.0) == pytest.approx(3.0)
    faster = replay.faster(13.0, 1)
    assert faster.speed == 2.0
    assert faster.at(14.0) == pytest.approx(5.0)
    paused = faster.toggle(14.0)
    assert paused.at(99.0) == pytest.approx(5.0)
    assert paused.move(99.0, -2.0).at(99.0) == pytest.approx(3.0)
    assert paused.pace(99.0, 0.3).play(99.0).at(109.0) == pytest.approx(8.0)


def test_playback_stops_at_the_end_and_restarts_from_the_beginning():
    replay = ReplayPosition(LENGTH).toggle(0.0)
    ended = replay.now(1e6)
    assert (ended.position, ended.playing) == (LENGTH, False)
    again = ended.toggle(1e6)
    assert again.playing
    assert again.at(1e6 + 1) == pytest.approx(1.0)


def test_play_and_pause_are_idempotent():
    replay = ReplayPosition(LENGTH).play(0.0)
    assert replay.play(1.0).at(2.0) == replay.at(2.0)
    paused = replay.pause(3.0)
    assert paused.pause(4.0).at(9.0) == paused.at(9.0) == pytest.approx(3.0)


def test_speed_is_clamped_and_an_odd_speed_steps_to_its_neighbours():
    replay = ReplayPosition(LENGTH)
    assert replay.faster(0.0, 99).speed == SPEEDS[-1]
    assert replay.faster(0.0, -99).speed == SPEEDS[0]
    odd = ReplayPosition(LENGTH, speed=3.0)
    assert (odd.faster(0.0, 1).speed, odd.faster(0.0, -1).speed) == (4.0, 2.0)


def test_loop_wraps_to_its_start():
    replay = ReplayPosition(LENGTH).repeat(0.0, (10.0, 14.0)).seek(0.0, 12.0).play(0.0)
    assert [replay.at(time) for time in (1.0, 2.0, 3.0, 9.0)] == pytest.approx([13.0, 10.0, 11.0, 13.0])
    assert replay.at(4000.0) < 14.0
    assert replay.now(4000.0).playing
    beyond = replay.seek(1.0, 20.0)
    assert beyond.at(5.0) == pytest.approx(24.0), "playback that starts beyond a loop continues"
    assert replay.repeat(1.0, None).at(9.0) == pytest.approx(21.0)


def test_loop_is_clipped_to_the_recording_and_restarts_at_its_start():
    whole = ReplayPosition(LENGTH).repeat(0.0, (-5.0, 1e9))
    assert whole.loop == (0.0, LENGTH)
    assert whole.play(0.0).at(101.0) == pytest.approx(1.0)
    part = ReplayPosition(LENGTH, position=LENGTH).repeat(0.0, (10.0, 20.0))
    assert part.play(0.0).at(1.0) == pytest.approx(11.0)


@pytest.mark.parametrize("loop", [(5.0, 5.0), (6.0, 5.0), (200.0, 300.0), (-3.0, -1.0)])
def test_empty_loop_is_refused(loop):
    with pytest.raises(ValueError, match="longer than 0 s"):
        ReplayPosition(LENGTH).repeat(0.0, loop)


TIMES = st.floats(-200, 200)
STEPS = st.tuples(
    st.sampled_from(("toggle", "play", "pause", "seek", "move", "faster", "pace", "repeat", "now")),
    TIMES,
    st.floats(0, 50),
)


@given(st.lists(STEPS, max_size=30))
def test_no_key_sequence_leaves_the_recording_or_jumps(steps):
    replay, now = ReplayPosition(LENGTH), 0.0
    for what, value, wait in steps:
        now += wait
        before = replay.at(now)
        match what:
            case "toggle" | "play":
                after = getattr(replay, what)(now)
                begin = 0.0 if replay.loop is None else replay.loop[0]
                assert after.at(now) in (before, begin)
            case "pause" | "now":
                after = getattr(replay, what)(now)
                assert after.at(now) == before
            case "seek":
                after = replay.seek(now, value)
                assert after.at(now) == min(max(value, 0.0), LENGTH)
            case "move":
                after = replay.move(now, value)
                assert after.at(now) == min(max(before + value, 0.0), LENGTH)
            case "repeat":
                begin = min(abs(value), LENGTH - 1.0)
                after = replay.repeat(now, None if value < 0 else (begin, begin + 1.0))
                assert after.at(now) == before
            case _:
                after = replay.faster(now, 1 if value > 0 else -1) if what == "faster" else replay.pace(now, 3.0)
                assert after.at(now) == before
        replay = after
        assert 0.0 <= replay.at(now + 7.0) <= LENGTH


@given(st.floats(0, 90), st.floats(0.01, 10), st.floats(0.1, 16), st.floats(0, 1e4))
def test_position_in_a_loop_is_modular(begin, span, speed, later):
    """Where the hand of a clock with this circumference would be, by the standard library's remainder."""
    replay = ReplayPosition(LENGTH, begin, 0.0, speed).repeat(0.0, (begin, begin + span)).play(0.0)
    position = replay.at(later)
    around = begin + math.fmod(later * speed, span)
    apart = abs(position - around)
    assert min(apart, abs(span - apart)) < 1e-6
    assert begin <= position <= begin + span


@given(st.lists(st.floats(0, 3), min_size=1, max_size=20), st.sampled_from(SPEEDS), st.booleans())
def test_position_is_independent_of_polling(naps, speed, looped):
    seldom = ReplayPosition(LENGTH, 5.0, 0.0, speed, True, (5.0, 9.0) if looped else None)
    often, now = seldom, 0.0
    for nap in naps:
        now += nap
        often = often.now(now)
    apart = abs(often.at(now) - seldom.at(now))
    assert min(apart, abs(4.0 - apart) if looped else apart) < 1e-6


@pytest.mark.parametrize(
    ("position", "words"), [(0.0, "0:00.0"), (61.26, "1:01.3"), (59.96, "1:00.0"), (600, "10:00.0")]
)
def test_clock_text_has_minutes_seconds_and_tenths(position, words):
    assert clock(position) == words
