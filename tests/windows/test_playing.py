"""A played display with its agent's ends of the two channels, over real sockets, and its pictures."""

from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS, SmallServer, local_config, until

from netboard.base.tables.rig import Agent, Agents
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.motion import Felt, Pointer
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port

pytestmark = pytest.mark.integration

FORCE_COLOUR = "#cc79a7"


class Rig:
    """The left side's display, played; its server, and its agent's ends."""

    def __init__(self, app, **options):
        from netboard.windows.participant.client import DisplayClient
        from netboard.windows.participant.playing import Playing
        from netboard.windows.participant.window import BoardWindow

        self.app = app
        self.context = sockets.Context()
        played = Agents(left=Agent(device="mouse", options=options))
        config = replace(local_config(free_port()), agents=played)
        self.server = SmallServer(config.network.port)
        where = channels.addresses(config.network)
        self.pointer = sockets.pointer_receiver(self.context, where.pointer("left"))
        self.felt = sockets.felt_publisher(self.context, where.felt("left"))
        self.window = BoardWindow("a test")
        self.window.present(config.display)
        player = Playing("left", config, self.context, self.window)
        self.client = DisplayClient("left", config, self.context, self.window, player)

    def hears(self, height):
        """Whether the agent hears of this height in the end; None for a window in which nobody has pointed."""

        self.heard = None

        def heard():
            frame = sockets.receive(self.pointer)
            if frame is not None:
                self.heard = decode(frame)
            return self.heard == Pointer("left", height if height is None else pytest.approx(height, abs=1e-3))

        return until(self.app, heard)

    def shows(self, what, **view):
        """Whether a view of this kind brings a grip of that kind to the screen."""
        return until(self.app, lambda: self.server.show(**view) and what(self.grip))

    @property
    def grip(self):
        return self.window.board.picture.grip

    def move_to(self, height):
        from PySide6.QtCore import QEvent, Qt
        from PySide6.QtGui import QMouseEvent

        surface, place = self.window.board, self.window.board.pixel_at((0.1, height))
        none = Qt.MouseButton.NoButton
        where = (place, surface.mapToGlobal(place))
        move = QMouseEvent(QEvent.Type.MouseMove, *where, none, none, Qt.KeyboardModifier.NoModifier)
        self.app.sendEvent(surface, move)

    def close(self):
        self.client.close()
        self.window.close()
        self.server.close()
        self.pointer.close()
        self.felt.close()
        self.context.term()


@pytest.fixture
def rig(app):
    made = Rig(app)
    yield made
    made.close()


def test_a_window_says_that_it_is_there_before_its_player_has_done_anything(app):
    rig = Rig(app, input="keys")
    assert rig.hears(None)
    assert "Press" in rig.grip.hint[0]
    rig.close()


def test_it_says_where_the_mouse_is_and_goes_on_saying_so(rig):
    rig.move_to(0.03)
    assert rig.hears(0.03)
    assert rig.hears(0.03)
    rig.move_to(-0.02)
    assert rig.hears(-0.02)


def test_before_anything_is_seen_it_says_how_to_play(rig):
    assert len(rig.grip.hint) == 2
    rig.move_to(0.01)
    assert until(rig.app, lambda: "mouse" in rig.grip.hint[0])


def test_the_force_of_the_own_agent_is_shown_and_forgotten(rig):
    rig.move_to(0.02)
    assert rig.shows(lambda grip: bool(grip.mark), left=0.01)

    def felt(force):
        return lambda grip: rig.felt.send(encode(Felt("left", force))) and grip.label == f"{abs(force):.1f} N"

    assert rig.shows(felt(-1.5), left=0.01)
    rig.app.processEvents()
    image = rig.window.board.grab().toImage()
    place = rig.window.board.pixel_at((-0.25, 0.01 - 0.03))
    assert image.pixelColor(place.toPoint()).name() == FORCE_COLOUR
    assert rig.shows(lambda grip: not grip.label, left=0.01), "a force that is not heard any more"


def test_what_is_no_force_of_this_side_is_not_shown(rig):
    rig.move_to(0.02)
    assert rig.shows(lambda grip: bool(grip.mark), left=0.01)
    for odd in (encode(Felt("right", 2.0)), b"", encode(Pointer("left", 0.0))):
        for _ in range(20):
            rig.felt.send(odd)
            assert rig.shows(lambda grip: not grip.label, left=0.01)


def test_an_unplayed_picture_is_as_it_was(app, board):
    from netboard.base.config import Config
    from netboard.windows.participant.screens import compose

    view, _ = board
    view.show_picture(compose(VIEW, Config(), WORDS))
    assert view.picture.grip is None
    assert view.grab().toImage().pixelColor(view.pixel_at((-0.25, 0.0)).toPoint()).name() != FORCE_COLOUR


def test_it_closes_twice(rig):
    rig.client.close()
    assert rig.client._views.closed
    rig.client.close()
    assert rig.client._views.closed


def test_two_players_share_the_screen(app):
    from netboard.windows.participant.window import BoardWindow, screen_of

    windows = {side: BoardWindow(side) for side in ("left", "right")}
    for side, window in windows.items():
        window.take_half(side)
    left, right = (window.geometry() for window in windows.values())
    assert not left.intersects(right)
    assert left.width() == right.width() == screen_of(windows["left"]).availableGeometry().width() // 2
    for window in windows.values():
        window.close()
