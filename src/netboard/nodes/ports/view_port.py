"""The server's endpoint of the two view channels: each station gets what its participant may see, at the view rate."""

from math import ceil
from typing import Any

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.tables.rig import Network
from netboard.base.tick import TICK
from netboard.network.protocol.codec import encode
from netboard.network.transport import channels, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.stage.curtain import Curtain, view_of

SAME_VIEW_TICKS = 50
"""Ticks after which an unchanged view is sent again, so that a display knows that the link is alive [1]."""

_AT = {name: place for place, name in enumerate(TICK.names or ())}
_SHOWN = ("phase", "z", "theta", "p", "target", "trial", "attempt", "failures", "completion", "counted")
_SEEN = np.array([_AT[name] for name in (*_SHOWN, "left_used_z", "right_used_z")])
"""Words of a row that determine the views: while they are the same, so are the views."""


class ViewPort:
    """The publishers of both stations' views. ``network`` has their addresses, and the largest rate of views."""

    def __init__(self, network: Network, context: sockets.Context, authenticator: Authenticator | None) -> None:
        where = channels.addresses(network, authenticator)
        self._views = {side: sockets.view_publisher(context, where.listen(channels.VIEW[side])) for side in SIDES}
        self._every = ceil(1000 / network.view_rate_hz)
        self._turn = 0
        self._seen: dict[Side, tuple[int, bytes]] = {}
        self._seq = dict.fromkeys(SIDES, 0)
        self.renew()

    @property
    def wanted(self) -> bool:
        """Whether anybody has subscribed to a view."""
        return any(publisher.wanted() for publisher in self._views.values())

    @property
    def due(self) -> int | None:
        """Elapsed time at which the next view is due, None as long as nobody subscribes [ms]."""
        return self._turn + 1 if self.wanted else None

    def renew(self) -> None:
        """Forget the last views, because a new block changes everything."""
        self._seen = dict.fromkeys(SIDES, (-SAME_VIEW_TICKS, b""))

    def show(
        self, following: int, curtain: Curtain, row: Any, words: Any, best: float | None, rest: float | None
    ) -> None:
        """Publish the stations' views if they are due; each if somebody subscribes to it, and it has changed.

        ``following``: elapsed time by which views are due [ms]; live, the number of the following tick.
        """
        if following > self._turn:
            self._turn = following - following % self._every + self._every
            for side in SIDES:
                self._show_to(side, following, curtain, row, words, best, rest)

    def _show_to(
        self, side: Side, following: int, curtain: Curtain, row: Any, words: Any, best: float | None, rest: float | None
    ) -> None:
        publisher = self._views[side]
        if not publisher.wanted():
            return
        sent_tick, sent = self._seen[side]
        seen = words[_SEEN].tobytes()
        if seen == sent and following - sent_tick < SAME_VIEW_TICKS:
            return
        self._seen[side] = following, seen
        publisher.send(encode(view_of(curtain, row, side, best, now_ns(), self._seq[side], rest)))
        self._seq[side] += 1

    def close(self) -> None:
        """Close both publishers."""
        for publisher in self._views.values():
            publisher.close()
