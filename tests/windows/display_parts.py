"""Views, a Qt waiting loop and a small server for the display tests."""

import os
from collections.abc import Callable
from dataclasses import replace

from netboard.base.clock import now_ns
from netboard.base.config import Config, resolve
from netboard.base.tables.rig import Display, Network
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.stage.view import View
from netboard.windows.participant.language import load_words

WORDS = load_words("en")
VIEW = View(
    station="left",
    tick=1,
    sent_ns=0,
    phase="running",
    z=0.0,
    theta=0.0,
    p=-0.15,
    target=0.15,
    left=0.0,
    right=None,
    trial=4,
    trials=60,
    failures=1,
    completion=None,
    best=None,
    notice="",
    seq=0,
    share=0.0,
    block=1,
    blocks=1,
    rest=None,
)


TIMEOUT = 60.0
"""Upper limit of a wait; the condition holds long before, even on a busy machine [s]."""


def until(app, true: Callable[[], bool], seconds: float = TIMEOUT) -> bool:
    """Run the Qt event loop until a condition holds or the time is up; return whether it holds."""
    from PySide6.QtCore import QEventLoop, QTimer

    loop, look, limit = QEventLoop(), QTimer(interval=2), QTimer(singleShot=True)
    look.timeout.connect(lambda: loop.quit() if true() else None)
    limit.timeout.connect(loop.quit)
    look.start()
    limit.start(round(seconds * 1000))
    loop.exec()
    look.stop()
    return true()


def bytes_from(terminal: int, count: int) -> list[int]:
    """Read `count` bytes from a pseudo-terminal, which may deliver them in several pieces."""
    came = b""
    while len(came) < count:
        came += os.read(terminal, count)
    return list(came)


def local_config(port: int, link_timeout_ms: float = 60_000.0) -> Config:
    return replace(
        Config(), network=Network(port=port), display=Display(width=840, height=480, link_timeout_ms=link_timeout_ms)
    )


class SmallServer:
    """A minimal server for a display: it publishes views and exchanges messages on the control channel."""

    def __init__(self, port: int) -> None:
        self.context = context = sockets.Context()
        where = channels.Addresses("127.0.0.1", "127.0.0.1", port)
        self.views = sockets.view_publisher(context, where.listen(channels.VIEW["left"]))
        self.control = sockets.control_server(context, where.listen(channels.CONTROL))
        self.messages = []
        self.peer = b""
        self._seq = 0

    def has_received(self, kind: type) -> bool:
        """Return whether a message of this kind has arrived so far."""
        while (received := self.control.receive()) is not None:
            self.peer, frame = received
            self.messages.append(decode(frame))
        return any(isinstance(message, kind) for message in self.messages)

    def send(self, message) -> None:
        assert self.control.send(self.peer, encode(message))

    def show(self, **changes) -> bool:
        """Publish a view; return True, so that a waiting loop can repeat it."""
        self.views.send(encode(replace(VIEW, **{"seq": self._seq, "sent_ns": now_ns(), **changes})))
        self._seq += 1
        return True

    def close(self) -> None:
        self.views.close()
        self.control.socket.close()
        self.context.term()


class DisplayRig:
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
        assert until(self.app, lambda: self.server.has_received(Hello))
        self.server.send(Welcome(session, PROTOCOL_VERSION, 0, resolve(config or Config())))
        assert until(self.app, lambda: self.client.session == session)

    def shows(self, state, **view):
        """Return whether the window reaches a state; meanwhile publish the view, if one is given."""
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
