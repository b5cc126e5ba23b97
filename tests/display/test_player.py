"""The player shows what the participant saw, and obeys keys, clicks and drags."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from display_parts import WORDS, two_trials, until

from netboard.config import Block, Config, Display, resolve
from netboard.curtain import make_curtain, view_of
from netboard.display.screens import compose
from netboard.errors import NetboardError, RecordingError
from netboard.recording.provenance import next_recording, provenance
from netboard.recording.writer import RecordingWriter
from netboard.wire.messages import PROTOCOL_VERSION, TickRecord, Welcome

CONFIG = replace(Config(), display=Display(width=840, height=600), block=Block(trials=6))


class Clock:
    """A clock that stands still until it is moved."""

    def __init__(self):
        self.time = 50.0

    def __call__(self):
        return self.time


@pytest.fixture
def player(app):
    from netboard.display.player import PlayerWindow

    clock = Clock()
    window = PlayerWindow(two_trials(), CONFIG, "left", "netboard replay: test", now=clock)
    window.present(CONFIG.display)
    app.processEvents()
    yield window, clock
    window.close()


def test_what_is_not_known_is_drawn_at_zero():
    from netboard.display.player import drawable

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


def test_it_begins_where_the_block_does_and_plays_with_the_clock(player):
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


def test_keys(player):
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


def test_dragging_and_clicking_the_time_line_seek(app, player):
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


def recorded(directory, ticks):
    """A finished recording of some ticks."""
    config = replace(CONFIG, recording=replace(CONFIG.recording, directory=str(directory)))
    welcome = Welcome("0123456789abcdef", PROTOCOL_VERSION, 0, resolve(config))
    path, part = next_recording(directory, config, welcome.session, 0)
    writer = RecordingWriter(path, provenance(welcome, config, part, 0, 0), welcome.config, config.recording, 0)
    for number, row in enumerate(ticks):
        writer.write(TickRecord(row.tobytes()), number, number)
    writer.finish(len(ticks))
    return path


def test_a_recording_is_played_until_stopped_or_photographed(app, tmp_path):
    from netboard.display.player import run

    path = recorded(tmp_path, two_trials()[:1000])
    asked = []
    run(path, "right", lambda: len(asked) > 3 or bool(asked.append(True)))
    assert len(asked) > 3
    picture = tmp_path / "replay.png"
    run(path, "left", lambda: False, picture=picture)
    assert picture.stat().st_size > 1000
    with pytest.raises(NetboardError, match="never overwrites"):
        run(path, "left", lambda: False, picture=picture)


def test_what_cannot_be_played_is_said(app, tmp_path):
    from netboard.display.player import run

    with pytest.raises(RecordingError, match="no tick"):
        run(recorded(tmp_path, two_trials()[:0]), "left", lambda: False)
    with pytest.raises(RecordingError):
        run(Path(tmp_path / "absent.mcap"), "left", lambda: False)
