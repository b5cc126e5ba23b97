"""A display as input device: it sends the pointer to the agent of the same side, and receives the force.

Both use local sockets of this user on this computer. The server and the other station take no part, so the curtain
holds: players see only the stylus and the force of their own side.
"""

from PySide6.QtCore import QObject, QTimer

from netboard.base import settings
from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side, played_sides
from netboard.base.errors import WireError
from netboard.devices.mouse import Options
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.motion import Felt, Pointer
from netboard.network.transport import channels, sockets
from netboard.stage.view import View
from netboard.windows.participant.grip import grip_of
from netboard.windows.participant.language import load_words
from netboard.windows.participant.pointing import Pointing
from netboard.windows.participant.scene import Grip
from netboard.windows.participant.window import BoardWindow

ALIVE_MS = 50
"""Longest interval between two pointer messages; they are the agent's heartbeat of this window [ms]."""

FELT_TIMEOUT_NS = 500_000_000
"""Older forces are not shown [ns]."""


class Playing(QObject):
    """The pointer and the force of one side's player.

    Parameters
    ----------
    config : Config
        The local configuration; its options of this side's device are used.
    """

    def __init__(self, station: Side, config: Config, context: sockets.Context, window: BoardWindow) -> None:
        super().__init__(window)
        agent = config.agents.left if station == "left" else config.agents.right
        options = settings.check(Options, dict(agent.options), ("agents", station, "options"))
        where = channels.addresses(config.network)
        self._station = station
        self._words = load_words(config.display.language)
        self._keys = options.input == "keys"
        self._force: float | None = None
        self._felt_ns = 0
        self._pointer = sockets.pointer_sender(context, where.pointer(station))
        self._felt = sockets.felt_subscriber(context, where.felt(station))
        self._pointing = Pointing(window, options.reach, keys=self._keys)
        self._pointing.moved.connect(self._tell)
        self._alive = QTimer(self, interval=ALIVE_MS)
        self._alive.timeout.connect(self._tell)
        self._alive.start()
        if played_sides(config) == SIDES:
            window.take_half(station)
        if self._keys:
            window.activateWindow()

    def grip(self, view: View | None, config: Config) -> Grip:
        """Return what is drawn of the player's own hand with this view."""
        self._feel()
        return grip_of(view, config, self._words, self._station, self._pointing.height, self._force, keys=self._keys)

    def close(self) -> None:
        """Close the sockets; a second call does nothing."""
        if self._pointer.closed:
            return
        self._alive.stop()
        self._pointing.close()
        self._pointer.close()
        self._felt.close()

    def _tell(self) -> None:
        """Send the pointer's height."""
        sockets.send(self._pointer, encode(Pointer(self._station, self._pointing.height)))

    def _feel(self) -> None:
        """Read the newest force; discard one older than `FELT_TIMEOUT_NS`."""
        now = now_ns()
        frame = sockets.receive(self._felt)
        if frame is not None:
            try:
                message = decode(frame)
            except WireError:
                return
            if isinstance(message, Felt) and message.side == self._station:
                self._force, self._felt_ns = message.force, now
        if now - self._felt_ns > FELT_TIMEOUT_NS:
            self._force = None
