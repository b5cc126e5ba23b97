"""The display's client with a small server over real sockets."""

from dataclasses import replace

import pytest
from display_parts import SmallServer, local_config, until

from netboard.base.config import Config, resolve
from netboard.base.errors import NetboardError
from netboard.base.tables.experiment import Block
from netboard.base.tables.rig import Display
from netboard.base.tables.scene import Geometry
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.views import Frames
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.windows.participant.scene import PictureState

WIDE = Geometry(board_length=0.8)

pytestmark = pytest.mark.integration


class Rig:
    """A display, and a server that can be started and stopped."""

    def __init__(self, app, link_timeout_ms=60_000.0):
        from netboard.windows.participant.client import DisplayClient
        from netboard.windows.participant.window import BoardWindow

        self.app = app
        self.port = free_port()
        self.context: sockets.Context = sockets.Context()
        self.server = None
        self.window = BoardWindow("netboard: left station")
        config = local_config(self.port, link_timeout_ms)
        self.window.present(config.display)
        self.client = DisplayClient("left", config, self.context, self.window)

    def serve(self):
        self.server = SmallServer(self.port)
        return self.server

    def welcome(self, config=None, session="s1"):
        assert until(self.app, lambda: self.server.hear(Hello))
        self.server.tell(Welcome(session, PROTOCOL_VERSION, 0, resolve(config or Config())))
        assert until(self.app, lambda: self.client.session == session)

    def shows(self, state, **view):
        """Whether the window shows a state in the end, while a view is published if one is given."""
        return until(
            self.app,
            lambda: (not view or self.server.show(**view)) and self.window.board.picture.state is state,
        )

    def close(self):
        self.client.close()
        if self.server is not None:
            self.server.close()
        self.window.close()
        self.context.term()


@pytest.fixture
def rig(app):
    made = Rig(app)
    yield made
    made.close()


@pytest.fixture
def hasty(app):
    """A rig that misses its views soon."""
    made = Rig(app, link_timeout_ms=150.0)
    yield made
    made.close()


def test_it_waits_in_words_then_greets_then_shows_and_reports(rig):
    picture = rig.window.board.picture
    assert picture.headline == "Waiting for the experiment"
    assert str(rig.port) in picture.detail
    server = rig.serve()
    rig.welcome()
    hello = next(message for message in server.heard if isinstance(message, Hello))
    assert (hello.role, hello.side, hello.protocol) == ("display", "left", PROTOCOL_VERSION)
    assert server.peer.startswith(b"display.left@")
    assert rig.shows(PictureState.RUN, tick=77)
    assert until(rig.app, lambda: server.hear(Frames))
    frames = next(message for message in server.heard if isinstance(message, Frames))
    ((tick, received_ns, painted_ns),) = frames.shown
    assert (frames.station, tick) == ("left", 77)
    assert 0 < received_ns <= painted_ns


def test_the_servers_configuration_says_what_the_board_looks_like(rig):
    rig.serve()
    rig.welcome(replace(Config(), geometry=Geometry(ball_radius=0.04)))
    assert rig.shows(PictureState.RUN, tick=5)
    assert rig.window.board.picture.ball_radius == 0.04


def test_another_block_is_taken_over_without_a_restart(rig):
    rig.serve()
    rig.welcome()
    assert rig.shows(PictureState.RUN, tick=5)
    block = Block(number=2, blocks=18, instructions="Now the other way round.")
    rig.server.tell(Welcome("s1", PROTOCOL_VERSION, 0, resolve(replace(Config(), block=block, geometry=WIDE))))
    assert until(rig.app, lambda: rig.client.config.block == block)
    assert rig.shows(PictureState.WAIT, phase="idle", block=2, blocks=18)
    assert until(rig.app, lambda: rig.window.board.picture.text == "Now the other way round.")
    assert rig.window.board.picture.headline == "Block 2 of 18"
    assert rig.shows(PictureState.RUN, block=2, blocks=18)
    assert rig.window.board.picture.extent[0] > 0.9


def test_the_screen_is_the_displays_own(rig):
    rig.serve()
    theirs = Display(language="de", patch=True, mm_per_pixel=0.3)
    rig.welcome(replace(Config(), display=theirs))
    assert rig.client.config.display == local_config(rig.port).display
    assert rig.shows(PictureState.LEVEL, phase="levelling")
    assert rig.window.board.picture.headline == "Hold the board level"
    assert rig.window.board.picture.patch is None


def test_a_board_that_does_not_fit_is_said(rig, caplog):
    rig.window.board.mm_per_pixel = 0.3
    rig.client.own = replace(rig.client.own, mm_per_pixel=0.3)
    rig.serve()
    rig.welcome(replace(Config(), geometry=WIDE))
    assert "the window is 252 mm wide but the board needs 920 mm" in caplog.text


def test_views_that_show_nothing_new_are_not_painted(rig):
    server = rig.serve()
    assert rig.shows(PictureState.RUN, tick=0)
    ticks = iter(range(8, 10_000, 8))
    assert until(rig.app, lambda: server.show(tick=next(ticks)) and next(ticks) > 500)
    assert rig.client.tally.painted == 1
    assert rig.shows(PictureState.HOLD, phase="holding", tick=20_000)
    assert until(rig.app, lambda: rig.client.tally.painted == 2)


def test_a_lost_link_is_said_and_heals_by_itself(hasty):
    server = hasty.serve()
    hasty.welcome()
    assert hasty.shows(PictureState.RUN, tick=1)
    assert hasty.shows(PictureState.LOST)
    assert hasty.window.board.picture.headline == "Connection lost"
    assert not hasty.window.board.picture.board
    server.close()
    hasty.serve()
    assert hasty.shows(PictureState.RUN, tick=3)
    hasty.welcome(session="s2")


def test_it_greets_again_when_the_server_does_not_know_it(rig):
    server = rig.serve()
    rig.welcome()
    server.heard.clear()
    server.tell(Refusal("say hello first"))
    rig.welcome(session="s2")
    assert any(isinstance(message, Hello) for message in server.heard)
    assert rig.client.session == "s2"


def test_a_refusal_is_shown_while_there_is_nothing_else(rig):
    server = rig.serve()
    assert until(rig.app, lambda: server.hear(Hello))
    server.tell(Refusal("the server speaks protocol 9, the display 1"))
    assert until(rig.app, lambda: "protocol 9" in rig.window.board.picture.detail)


def test_the_end_of_the_session_is_no_lost_link(hasty):
    server = hasty.serve()
    hasty.welcome()
    assert hasty.shows(PictureState.FINISHED, phase="finished")
    server.tell(Goodbye("the session is over"))
    assert until(hasty.app, lambda: hasty.window.board.picture.headline == "The session is over")


def test_what_breaks_the_protocol_is_left_out(rig, caplog):
    server = rig.serve()
    assert rig.shows(PictureState.RUN, tick=1)
    assert until(rig.app, lambda: server.views.send(b"\xc1 no message at all") and bool(caplog.records))
    assert rig.shows(PictureState.LEVEL, phase="levelling")


def test_it_says_goodbye(rig):
    server = rig.serve()
    rig.welcome()
    rig.client.close()
    assert until(rig.app, lambda: server.hear(Goodbye))


def run_display(port, picture, stopping=lambda _: False, after=None):
    """Run a whole display while a server shows it views; tell how often it asked whether to stop."""
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


def test_the_first_picture_is_taken_and_the_display_stops(app, tmp_path):
    picture = tmp_path / "left.png"
    run_display(free_port(), picture)
    assert picture.stat().st_size > 1000
    with pytest.raises(NetboardError, match="does not overwrite"):
        run_display(free_port(), picture)


def test_a_picture_for_later_is_taken_at_the_end_and_the_display_goes_on(app, tmp_path):
    picture = tmp_path / "left.png"
    asked = run_display(free_port(), picture, stopping=lambda times: times >= 8, after=3600.0)
    assert asked == 8
    assert picture.stat().st_size > 1000
