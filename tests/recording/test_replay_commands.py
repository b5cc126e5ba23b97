"""Commands of a replay, and their refusals."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_recordings import loaded_recording, two_trials
from netboard.base.errors import NetboardError
from netboard.network.protocol.control import COMMANDS, REPLAY_COMMANDS
from netboard.nodes.server.operators import CAUSES
from netboard.recording.replay.commands import KEYS, KNOWN, ReplayCommand, in_words, run_command
from netboard.recording.replay.position import ReplayPosition

RECORDING = loaded_recording(two_trials())
START = ReplayPosition(RECORDING.length, 2.0)
NOW = 0.0


def after(name, argument="", playback=START):
    return run_command(playback, RECORDING, NOW, ReplayCommand(name, argument))


@pytest.mark.parametrize(
    ("name", "argument", "position"),
    [
        ("seek", "3.5", 3.5),
        ("seek", "+2", 4.0),
        ("seek", "-0.5", 1.5),
        ("seek", "99", 9.999),
        ("seek", "trial 2", 4.001),
        ("seek", "tick 1100", 1.0),
        ("step", "", 2.001),
        ("step", "25", 2.025),
        ("step", "-2", 1.998),
        ("step", "back", 1.999),
        ("step", "back 10", 1.99),
        ("next", "", 4.001),
        ("next", "failure", 8.0),
        ("previous", "", 0.501),
        ("previous", "release", 1.0),
        ("loop", "trial 2", 4.001),
        ("loop", "5 6.5", 5.0),
        ("loop", "1 3", 2.0),
    ],
)
def test_command_moves_to_the_position(name, argument, position):
    assert after(name, argument).at(NOW) == pytest.approx(position)


def test_play_pause_speed_and_step():
    assert after("play").playing
    assert after("resume").playing
    playing = START.play(NOW)
    assert not after("pause", playback=playing).playing
    assert not after("step", playback=playing).playing, "stepping pauses the playback"
    assert after("seek", "5", playback=playing).playing
    assert after("speed", "0.5").speed == 0.5


def test_loop_command_sets_and_clears_the_loop():
    assert after("loop").loop == (0.0, RECORDING.length)
    looped = after("loop", "trial 1")
    assert looped.loop == pytest.approx((0.501, 4.001))
    for argument in ("", "off"):
        assert after("loop", argument, looped).loop is None
    assert after("loop", "on", looped).loop == (0.0, RECORDING.length)


@pytest.mark.parametrize(
    ("name", "argument", "words"),
    [
        ("seek", "", "seconds"),
        ("seek", "soon", 'found "soon"'),
        ("seek", "nan", 'found "nan"'),
        ("seek", "trial 9", "there is no trial 9: made.mcap has trials 1 to 2"),
        ("seek", "trial two", "whole number"),
        ("seek", "tick 99999999999999999999", "whole number"),
        ("speed", "99", "expected 0.1 to 16 times real time"),
        ("speed", "fast", "expected 0.1 to 16 times real time"),
        ("step", "half", "whole number"),
        ("loop", "3 2", "two times within"),
        ("loop", "sometimes", "on, off, trial N"),
        ("next", "note", "no note comes after 0:02.0"),
        ("next", "miracle", "one of its kinds"),
    ],
)
def test_invalid_argument_is_refused_with_the_reason(name, argument, words):
    with pytest.raises(NetboardError, match=words.replace("(", r"\(")):
        after(name, argument)


@pytest.mark.parametrize("name", sorted((set(COMMANDS) | set(CAUSES)) - set(KNOWN) - {"take"}))
def test_live_session_command_is_refused_in_a_replay(name):
    with pytest.raises(NetboardError, match=f"cannot {name}: this is a replay of made.mcap; expected one of .*seek"):
        after(name)


def test_every_key_has_an_effect():
    for key, order in KEYS.items():
        assert after(order.name, order.argument) != START or order.name == "end", key


def test_status_text_has_state_position_speed_and_loop():
    assert in_words(START.play(NOW), RECORDING, 1.0).startswith(
        "playing at 0:03.0 of 0:10.0, 1 times real time, tick 3100"
    )
    assert "loop 0:00.5 to 0:04.0" in in_words(after("loop", "trial 1"), RECORDING, 1.0)


ARGUMENTS = st.one_of(
    st.text(max_size=20),
    st.sampled_from(("", "on", "off", "back", "trial 1", "trial 2", "tick 500", "2 3", "1e308", "-5", "note")),
    st.floats().map(str),
    st.integers().map("trial {}".format),
)


ORDERS = st.tuples(st.sampled_from((*REPLAY_COMMANDS, "pause", "next")), ARGUMENTS, st.floats(0, 9))


@given(st.lists(ORDERS, max_size=20))
def test_no_command_sequence_leaves_the_recording(orders):
    playback, now = START, NOW
    for name, argument, wait in orders:
        now += wait
        with suppress(NetboardError):
            playback = run_command(playback, RECORDING, now, ReplayCommand(name, argument))
        assert 0.0 <= playback.at(now) <= RECORDING.length
        assert in_words(playback, RECORDING, now)
