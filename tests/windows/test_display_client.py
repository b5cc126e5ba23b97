"""The display client with a small server over real sockets."""

from dataclasses import replace

import pytest
from display_parts import DisplayRig, SmallServer, local_config, until

from netboard.base.config import Config, resolve
from netboard.base.errors import NetboardError
from netboard.base.tables.experiment import Block
from netboard.base.tables.rig import Display
from netboard.base.tables.scene import Geometry
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.views import Frames
from netboard.network.transport.ports import free_port
from netboard.windows.participant.scene import PictureState

WIDE = Geometry(board_length=0.8)

pytestmark = pytest.mark.integration


@pytest.fixture
def rig(app):
    made = DisplayRig(app)
    yield made
    made.close()


@pytest.fixture
def impatient_rig(app):
    """A rig with a short link timeout."""
    made = DisplayRig(app, link_timeout_ms=150.0)
    yield made
    made.close()


def test_display_waits_joins_shows_views_and_reports_frames(rig):
    picture = rig.window.board.picture
    assert picture.headline == "Waiting for the experiment"
    assert str(rig.port) in picture.detail
    server = rig.serve()
    rig.welcome()
    hello = next(message for message in server.messages if isinstance(message, Hello))
    assert (hello.role, hello.side, hello.protocol) == ("display", "left", PROTOCOL_VERSION)
    assert server.peer.startswith(b"display.left@")
    assert rig.shows(PictureState.RUN, tick=77)
    assert until(rig.app, lambda: server.has_received(Frames))
    frames = next(message for message in server.messages if isinstance(message, Frames))
    ((tick, received_ns, painted_ns),) = frames.shown
    assert (frames.station, tick) == ("left", 77)
    assert 0 < received_ns <= painted_ns


def test_closing_the_window_in_a_trial_needs_a_second_key(rig, monkeypatch):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    monkeypatch.setattr("netboard.windows.participant.window.LEAVE_MS", 0)
    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.RUN, tick=5)
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert rig.window.isVisible()
    assert until(rig.app, lambda: not rig.window._leaving)
    monkeypatch.setattr("netboard.windows.participant.window.LEAVE_MS", 60_000)
    QTest.keyClick(rig.window, Qt.Key.Key_Q)
    assert rig.window.isVisible(), "that was too late to confirm the first"
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert not rig.window.isVisible()


def test_key_that_is_held_down_in_a_trial_counts_once(rig):
    from PySide6.QtCore import QEvent, Qt
    from PySide6.QtGui import QGuiApplication, QKeyEvent
    from PySide6.QtTest import QTest

    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.RUN, tick=5)
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    key = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, Qt.KeyboardModifier.NoModifier, "", autorep=True)
    QGuiApplication.sendEvent(rig.window, key)
    assert rig.window.isVisible()
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert not rig.window.isVisible()


def test_window_closes_with_one_key_between_trials(rig):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.PAUSED, tick=5, phase="paused")
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert not rig.window.isVisible()


def test_board_geometry_comes_from_the_servers_configuration(rig):
    rig.serve()
    rig.welcome(replace(Config(), geometry=Geometry(ball_radius=0.04)))
    assert rig.shows(PictureState.RUN, tick=5)
    assert rig.window.board.picture.ball_radius == 0.04


def test_next_block_applies_without_a_restart(rig):
    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.RUN, tick=5)
    block = Block(number=2, blocks=18, instructions="Now the other way round.")
    rig.server.send(Welcome("s1", PROTOCOL_VERSION, 0, resolve(replace(Config(), block=block, geometry=WIDE))))
    assert until(rig.app, lambda: rig.client.config.block == block)
    assert rig.shows(PictureState.WAIT, phase="idle", block=2, blocks=18)
    assert until(rig.app, lambda: rig.window.board.picture.text == "Now the other way round.")
    assert rig.window.board.picture.headline == "Block 2 of 18"
    assert rig.shows(PictureState.RUN, block=2, blocks=18)
    assert rig.window.board.picture.extent[0] > 0.9


def test_screen_settings_come_from_the_displays_own_configuration(rig):
    rig.serve()
    theirs = Display(language="de", patch=True, mm_per_pixel=0.3)
    rig.welcome(replace(Config(), display=theirs))
    assert rig.client.config.display == local_config(rig.port).display
    assert rig.shows(PictureState.LEVEL, phase="levelling")
    assert rig.window.board.picture.headline == "Hold the board level and still"
    assert rig.window.board.picture.patch is None


def test_board_wider_than_the_window_is_logged(rig, caplog):
    rig.window.board.mm_per_pixel = 0.3
    rig.client.display = replace(rig.client.display, mm_per_pixel=0.3)
    rig.serve()
    rig.welcome(replace(Config(), geometry=WIDE))
    assert "the window is 252 mm wide but the board needs 920 mm" in caplog.text


def test_unchanged_views_are_not_painted(rig):
    server = rig.serve()
    assert rig.shows(PictureState.RUN, tick=0)
    ticks = iter(range(8, 10_000, 8))
    assert until(rig.app, lambda: server.show(tick=next(ticks)) and next(ticks) > 500)
    assert rig.client.tally.painted == 1
    assert rig.shows(PictureState.HOLD, phase="holding", tick=20_000)
    assert until(rig.app, lambda: rig.client.tally.painted == 2)


def test_lost_link_is_shown_and_recovers_when_views_return(impatient_rig):
    server = impatient_rig.serve()
    impatient_rig.welcome()
    assert impatient_rig.shows(PictureState.RUN, tick=1)
    assert impatient_rig.shows(PictureState.LOST)
    assert impatient_rig.window.board.picture.headline == "Connection lost"
    assert not impatient_rig.window.board.picture.board
    server.close()
    impatient_rig.serve()
    assert impatient_rig.shows(PictureState.RUN, tick=3)
    impatient_rig.welcome(session="s2")


def test_display_rejoins_when_the_server_asks_for_a_hello(rig):
    server = rig.serve()
    rig.welcome()
    server.messages.clear()
    server.send(Refusal("it has not joined yet"))
    rig.welcome(session="s2")
    assert any(isinstance(message, Hello) for message in server.messages)
    assert rig.client.session == "s2"


def test_display_rejoins_at_the_first_view_of_another_server(rig):
    """Its board may be another one; before, the display asked only after the next report of frames."""
    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.RUN, tick=5, seq=10**6)
    rig.server.close()
    rig.serve()
    assert rig.shows(PictureState.HOLD, tick=1, phase="holding")
    rig.welcome(replace(Config(), geometry=WIDE), session="s2")
    assert rig.client.config.geometry == WIDE


def test_refusal_is_shown_before_the_first_view(rig):
    server = rig.serve()
    assert until(rig.app, lambda: server.has_received(Hello))
    server.send(Refusal("the server speaks protocol 9, the display 1"))
    assert until(rig.app, lambda: "protocol 9" in rig.window.board.picture.detail)


def test_end_of_session_is_not_shown_as_a_lost_link(impatient_rig):
    server = impatient_rig.serve()
    impatient_rig.welcome()
    assert impatient_rig.shows(PictureState.FINISHED, phase="finished")
    server.send(Goodbye("the session is over"))
    assert until(impatient_rig.app, lambda: impatient_rig.window.board.picture.headline == "The session is over")


def test_malformed_view_is_logged_and_skipped(rig, caplog):
    server = rig.serve()
    assert rig.shows(PictureState.RUN, tick=1)

    def logged():
        server.views.send(b"\xc1 not a message")
        return bool(caplog.records)

    assert until(rig.app, logged)
    assert rig.shows(PictureState.LEVEL, phase="levelling")


def test_closing_display_sends_goodbye(rig):
    server = rig.serve()
    rig.welcome()
    rig.client.close()
    assert until(rig.app, lambda: server.has_received(Goodbye))


def run_display(port, picture, stopping=lambda _: False, after=None):
    """Run a whole display while a server publishes views; return how often it asked whether to stop."""
    from PySide6.QtCore import QTimer

    from netboard.windows.participant.client import run

    server, showing, asked = SmallServer(port), QTimer(interval=5), []
    showing.timeout.connect(server.show)
    showing.start()
    try:
        run(local_config(port), "left", lambda: asked.append(True) or stopping(len(asked)), picture, after)
    finally:
        showing.stop()
        server.close()
    return len(asked)


def test_screenshot_of_the_first_picture_ends_the_display(app, tmp_path):
    picture = tmp_path / "left.png"
    run_display(free_port(), picture)
    assert picture.stat().st_size > 1000
    with pytest.raises(NetboardError, match="already exists"):
        run_display(free_port(), picture)


def test_screenshot_without_a_server_is_given_up(app, tmp_path, monkeypatch):
    from netboard.windows.participant import client, window

    monkeypatch.setattr(window, "SCREENSHOT_WAIT_NS", 0)
    config = local_config(free_port())
    with pytest.raises(NetboardError, match=rf"no data came from the server at 127\.0\.0\.1:{config.network.port}"):
        client.run(config, "left", lambda: False, tmp_path / "new" / "left.png")
    assert list(tmp_path.iterdir()) == []


def test_screenshot_that_cannot_be_saved_is_refused_at_once(app, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(NetboardError, match=r"left\.png: cannot be written: "):
        run_display(free_port(), tmp_path / "file" / "left.png")


def test_delayed_screenshot_is_taken_at_the_latest_when_the_display_stops(app, tmp_path):
    picture = tmp_path / "left.png"
    asked = run_display(free_port(), picture, stopping=lambda times: times >= 8, after=3600.0)
    assert asked == 8
    assert picture.stat().st_size > 1000
