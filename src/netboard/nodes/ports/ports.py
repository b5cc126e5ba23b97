"""The server's endpoints of one session's channels: opened together, and renewed together when a block begins.

Each port handles its own channel; the session handles what the ports bring.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, Side
from netboard.network.protocol.control import RefusalCount
from netboard.network.transport import channels, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.network.transport.waiting import waitable
from netboard.nodes.ports.control_port import ControlPort
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.ports.motion_port import MotionPort
from netboard.nodes.ports.refusals import Refusals
from netboard.nodes.ports.view_port import ViewPort
from netboard.nodes.ports.welcomes import Welcomes
from netboard.recording.recovery.spill import Spill, spill_path

RING_SHARE = 1.5
"""Records that the log's ring holds for each millisecond: one tick, and room for others [1]."""

MAX_REFUSED = 8
"""Number of kinds of refusals shown to operators, the most frequent ones [1]."""


class Ports:
    """All ports of a session. ``authenticator`` is None without authentication."""

    def __init__(
        self, config: Config, welcomes: Welcomes, context: sockets.Context, authenticator: Authenticator | None
    ) -> None:
        welcome = welcomes.full
        network = config.network
        where = channels.addresses(network, authenticator)
        motion = sockets.motion_server(context, where.listen(channels.MOTION))
        control = sockets.control_server(context, where.listen(channels.CONTROL))
        self.motion = MotionPort(
            motion, welcome, int(network.sample_timeout_ms * 1e6), int(network.clock_bound_ms * 1e6)
        )
        self.control = ControlPort(control, welcomes.shown)
        spill = Spill(spill_path(config, welcome.session), welcome, int(network.log_spill_mb * 1e6))
        ring = int(network.log_ring_s * 1000 * RING_SHARE)
        self.log = LogPort(sockets.log_server(context, where.listen(channels.LOG)), welcome, ring, spill)
        self.views = ViewPort(network, context, authenticator)
        # Numbers of the files that wake the session when a message arrives: motion, control.
        self.files = waitable(motion.socket.fileno()), waitable(control.socket.fileno())

    def renew(self, welcomes: Welcomes, ends: NDArray[np.float64], people: tuple[Side, ...]) -> None:
        """Send the welcome of a new block to all peers. ``people``: the sides whose hand is a person's."""
        self.motion.renew(welcomes.full, ends, people)
        self.control.renew(welcomes.shown)
        self.log.renew(welcomes.full)
        self.views.renew()

    @property
    def unused(self) -> bool:
        """Whether no peer is connected to any channel."""
        channels = self.motion.empty, self.control.empty, self.log.empty, not self.views.wanted
        return all(channels)

    @property
    def refusals(self) -> tuple[Refusals, ...]:
        """The refusals of each channel."""
        return self.motion.refusals, self.control.refusals, self.log.refusals

    def refused(self, authenticator: Authenticator | None) -> tuple[RefusalCount, ...]:
        """Return the most frequent refusals, of handshakes and on the channels."""
        totals = [("handshake", authenticator.totals)] if authenticator is not None else []
        totals += [(refusals.channel, refusals.totals) for refusals in self.refusals]
        found = [RefusalCount(channel, reason, times) for channel, of in totals for reason, times in of.items()]
        return tuple(sorted(found, key=lambda refusals: -refusals.times)[:MAX_REFUSED])

    def goodbye(self, reason: str) -> None:
        """Tell agents and operators that the session is over."""
        self.motion.goodbye(reason)
        self.control.goodbye(reason)

    def close(self) -> None:
        """Close the ports that do not close by themselves after the last record."""
        self.views.close()
        self.control.close()
