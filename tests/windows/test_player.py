"""The replay window shows the participant's views and reacts to keys, clicks and drags."""

import numpy as np
import pytest
from display_parts import WORDS, until

from made_recordings import CONFIG, loaded_recording, two_trials
from netboard.base.errors import NetboardError
from netboard.recording.replay.loading import drawable
from netboard.stage.curtain import make_curtain, view_of
from netboard.windows.participant.screens import compose


class Clock:
    """A clock that a test advances by hand."""

    def __init__(self):
        self.time = 50.0

    def __call__(self):
        return self.time


@pytest.fixture
def player(app):
    from netboard.windows.replay.player import PlayerWindow

    clock = Clock()
    window = PlayerWindow([loaded_recording(two_trials())], "left", now=clock)
    window.present(CONFIG.display)
    app.processEvents()
    yield window, clock
    window.close()


def test_non_finite_values_are_drawn_at_zero():
    ticks = two_trials()
    assert drawable(ticks) is ticks
    ticks["theta"][3:] = np.nan
    ticks["p"][7] = np.inf
    drawn = drawable(ticks)
    assert not drawn["theta"][3:].any()
    assert drawn["p"][7] == 0
    assert (drawn["p"][8:] == ticks["p"][8:]).all()
    assert np.isnan(ticks["theta"][3:]).all()


def expected(position):
    ticks = two_trials()
    index = round(position * 1000)
    view = view_of(make_curtain(CONFIG), ticks[index], "left", 3.0 if index >= 4000 else None, 0)
    return compose(view, CONFIG, WORDS)


def test_player_starts_at_the_block_and_follows_the_clock_to_the_end(player):
    window, clock = player
    assert window.playback.position == pytest.approx(0.5)
    window.toggle()
    clock.time += 2.0
    window.refresh()
    assert window.board.picture == expected(2.5)
    assert window.bar.cursor_line.value() == pytest.approx(2.5)
    clock.time += 100.0
    window.refresh()
    assert not window.playback.playing
    assert window.board.picture == expected(9.999)


def test_keys_seek_step_loop_and_change_the_speed(player):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    window, _ = player

    def press(key, modifier=Qt.KeyboardModifier.NoModifier):
        QTest.keyClick(window, key, modifier)
        return window.playback

    assert press(Qt.Key.Key_Right).position == pytest.approx(1.5)
    assert press(Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier).position == pytest.approx(9.999)
    assert press(Qt.Key.Key_Left).position == pytest.approx(8.999)
    assert press(Qt.Key.Key_Up).speed == 2.0
    assert press(Qt.Key.Key_Down).speed == 1.0
    assert press(Qt.Key.Key_Home).position == pytest.approx(0.5)
    assert press(Qt.Key.Key_Space).playing
    assert not press(Qt.Key.Key_Space).playing
    assert press(Qt.Key.Key_Period).position == pytest.approx(0.501)
    assert press(Qt.Key.Key_Comma).position == pytest.approx(0.5)
    assert press(Qt.Key.Key_PageDown).position == pytest.approx(0.501)
    assert press(Qt.Key.Key_PageDown).position == pytest.approx(4.001)
    assert press(Qt.Key.Key_PageDown).position == pytest.approx(4.001), "there is no later trial"
    assert press(Qt.Key.Key_L, Qt.KeyboardModifier.ShiftModifier).loop == pytest.approx((4.001, 9.999))
    assert "0:04.0" in window.line.text()
    assert press(Qt.Key.Key_L).loop is None
    assert press(Qt.Key.Key_L).loop == pytest.approx((0.0, 9.999))
    assert press(Qt.Key.Key_PageUp).position == pytest.approx(0.501)


def test_loop_wraps_around_and_keeps_playing(player):
    window, clock = player
    window.seek(8.0)
    window.loop(trial=True)
    window.toggle()
    clock.time += 3.0
    window.refresh()
    assert window.playback.position == pytest.approx(11.0 - 9.999 + 4.001)
    assert window.playback.playing


@pytest.mark.slow
def test_missing_ticks_are_named_and_the_last_view_before_them_is_shown(app):
    from netboard.windows.replay.player import PlayerWindow

    window = PlayerWindow([loaded_recording(np.delete(two_trials(), slice(3000, 3200)))], "left", now=Clock())
    window.seek(3.1)
    assert "ticks 3100 to 3299 are missing" in window.line.text()
    assert window.board.picture == expected(2.999)
    window.close()


def test_two_recordings_play_side_by_side_on_one_timeline(app):
    from netboard.windows.replay.player import PlayerWindow

    later = loaded_recording(two_trials()[400:], name="later.mcap")
    window = PlayerWindow([loaded_recording(two_trials()), later], "left", sync="trial", now=Clock())
    window.present(CONFIG.display)
    app.processEvents()
    window.seek(3.0)
    assert [pane.board.picture for pane in window.panes] == [expected(3.0), expected(3.0)]
    assert window.panes[0].board.width() == pytest.approx(window.panes[1].board.width(), abs=2)
    window.next_trial(back=False)
    assert window.pairing.at(window.playback.position) == pytest.approx((4.001, 3.601))
    window.close()


@pytest.mark.slow
def test_trials_of_two_recordings_are_those_of_the_first(app):
    from netboard.windows.replay.player import PlayerWindow

    slower = two_trials()
    slower["event"][500], slower["event"][400] = 0, slower["event"][500]  # its block begins earlier
    window = PlayerWindow([loaded_recording(two_trials()), loaded_recording(slower)], "left", now=Clock())
    window.seek(1.0)
    window.loop(trial=True)
    assert window.playback.loop == pytest.approx((0.501, 4.001))
    window.close()


def test_long_names_and_events_do_not_make_the_window_wider(app):
    from netboard.windows.replay.player import PlayerWindow

    names = (f"{which}_of_the_recordings_of_a_session_with_a_long_name.part03.mcap" for which in ("one", "other"))
    window = PlayerWindow([loaded_recording(two_trials(), name=name) for name in names], "left", now=Clock())
    window.present(CONFIG.display)
    window.seek(4.5)
    app.processEvents()
    assert window.width() == CONFIG.display.width
    assert window.minimumSizeHint().width() <= 700
    window.close()


def test_dragging_or_clicking_the_timeline_seeks(app, player):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    window, _ = player
    window.bar.cursor_line.setValue(7.0)
    window.bar.cursor_line.sigDragged.emit(window.bar.cursor_line)
    assert window.board.picture == expected(7.0)
    viewport = window.bar.viewport()
    middle = viewport.rect().center()
    middle.setY(20)
    QTest.mouseClick(viewport, Qt.MouseButton.LeftButton, pos=middle)
    assert until(app, lambda: window.playback.position != 7.0)
    assert window.playback.position == pytest.approx(5.0, abs=0.1)


def test_player_runs_until_stopped_or_until_its_screenshot(app, tmp_path):
    from netboard.windows.replay.player import run

    recordings = [loaded_recording(two_trials()[:1000])]
    asked = []
    run(recordings, "right", lambda: len(asked) > 3 or bool(asked.append(True)))
    assert len(asked) > 3
    picture = tmp_path / "replay.png"
    run(recordings, "left", lambda: False, picture=picture, at=0.7)
    assert picture.stat().st_size > 1000
    with pytest.raises(NetboardError, match="already exists"):
        run(recordings, "left", lambda: False, picture=picture)
