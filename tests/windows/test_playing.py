"""A display that plays with the mouse or keys: its two channels to the agent, over real sockets, and its pictures."""

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
    """The left side's playing display, its server, and the agent's end of its two channels."""

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

    def agent_receives(self, height):
        """Return whether the agent receives this height; None stands for a window without any input so far."""

        self.latest = None

        def received():
            frame = sockets.receive(self.pointer)
            if frame is not None:
                self.latest = decode(frame)
            return self.latest == Pointer("left", height if height is None else pytest.approx(height, abs=1e-3))

        return until(self.app, received)

    def shows(self, condition, **view):
        """Return whether these views bring a grip that meets a condition to the screen."""
        return until(self.app, lambda: self.server.show(**view) and condition(self.grip))

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


def test_playing_window_reports_itself_before_the_first_input(app):
    rig = Rig(app, input="keys")
    assert rig.agent_receives(None)
    assert "Press" in rig.grip.hint[0]
    rig.close()


def test_pointer_height_is_sent_repeatedly_and_follows_the_mouse(rig):
    rig.move_to(0.03)
    assert rig.agent_receives(0.03)
    assert rig.agent_receives(0.03)
    rig.move_to(-0.02)
    assert rig.agent_receives(-0.02)


def test_hint_explains_how_to_play_before_the_first_view(rig):
    assert len(rig.grip.hint) == 2
    rig.move_to(0.01)
    assert until(rig.app, lambda: "mouse" in rig.grip.hint[0])


def test_agents_force_is_shown_and_disappears_when_no_longer_received(rig):
    rig.move_to(0.02)
    assert rig.shows(lambda grip: bool(grip.mark), left=0.01)

    def felt(force):
        def shown(grip):
            rig.felt.send(encode(Felt("left", force)))
            return grip.label == f"{abs(force):.1f} N"

        return shown

    assert rig.shows(felt(-1.5), left=0.01)
    rig.app.processEvents()
    image = rig.window.board.grab().toImage()
    place = rig.window.board.pixel_at((-0.25, 0.01 - 0.03))
    assert image.pixelColor(place.toPoint()).name() == FORCE_COLOUR
    assert rig.shows(lambda grip: not grip.label, left=0.01), "a force that is no longer received is still shown"


def test_other_sides_force_and_malformed_messages_are_not_shown(rig):
    rig.move_to(0.02)
    assert rig.shows(lambda grip: bool(grip.mark), left=0.01)
    for odd in (encode(Felt("right", 2.0)), b"", encode(Pointer("left", 0.0))):
        for _ in range(20):
            rig.felt.send(odd)
            assert rig.shows(lambda grip: not grip.label, left=0.01)


def test_display_that_does_not_play_has_no_grip(app, board):
    from netboard.base.config import Config
    from netboard.windows.participant.screens import compose

    view, _ = board
    view.show_picture(compose(VIEW, Config(), WORDS))
    assert view.picture.grip is None
    assert view.grab().toImage().pixelColor(view.pixel_at((-0.25, 0.0)).toPoint()).name() != FORCE_COLOUR


def test_closing_twice_is_harmless(rig):
    rig.client.close()
    assert rig.client._views.closed
    rig.client.close()
    assert rig.client._views.closed


def test_two_players_share_the_screen_in_halves(app):
    from netboard.windows.participant.window import BoardWindow, screen_of

    windows = {side: BoardWindow(side) for side in ("left", "right")}
    for side, window in windows.items():
        window.take_half(side)
    left, right = (window.geometry() for window in windows.values())
    assert not left.intersects(right)
    assert left.width() == right.width() == screen_of(windows["left"]).availableGeometry().width() // 2
    for window in windows.values():
        window.close()
