"""The server's endpoint of the view channels: each station gets what its participant may see, at the view rate.

The robot partner of a block gets views of its own, which the display of its side does not get.
"""

from math import ceil, nan

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.compiled import Records, machine_code
from netboard.base.config import SIDES
from netboard.base.tables.rig import VIEW_REPEAT_MS, Network
from netboard.network.protocol.view_frame import CONTENT, MAX_SIZE, write_view
from netboard.network.transport import channels, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.stage.curtain import CURTAIN, Curtain, Pause

ASK_MS = 100
"""Interval at which a publisher is asked whether anybody has subscribed: the answer takes as long as a view [ms]."""

NOTHING_SHOWN = np.full(CONTENT, -(2**62))
"""Content of a view before the first one."""


class ViewPort:
    """The publishers of all views, by channel. ``network`` has their addresses, and the largest rate of views."""

    def __init__(self, network: Network, context: sockets.Context, authenticator: Authenticator | None) -> None:
        where = channels.addresses(network, authenticator)
        every = *channels.VIEW.values(), *channels.PARTNER.values()
        self._views = {channel: sockets.view_publisher(context, where.listen(channel)) for channel in every}
        self._every = ceil(1000 / network.view_rate_hz)
        self._due_ms = 0
        self._asked_ms, self._subscribed = -ASK_MS, list[int]()
        self._shown_ms = dict.fromkeys(every, -VIEW_REPEAT_MS)
        self._content = {channel: NOTHING_SHOWN.copy() for channel in every}
        self._seq = dict.fromkeys(every, 0)
        self._frame = np.zeros(MAX_SIZE, np.uint8)
        numbers = False, 0.0, 0, 0, 0.0, 0
        self._write_view = machine_code(
            write_view, self._frame, np.zeros(1, CURTAIN), np.zeros(1, np.int64), NOTHING_SHOWN, *numbers
        )

    @property
    def wanted(self) -> bool:
        """Whether anybody has subscribed to a view."""
        return any(publisher.wanted() for publisher in self._views.values())

    def due(self, elapsed_ms: int) -> int:
        """Return when to call `show` next [ms]."""
        return max(self._due_ms, elapsed_ms) + 1

    def renew(self) -> None:
        """Forget the last views, because a new block changes everything."""
        self._shown_ms = dict.fromkeys(self._views, -VIEW_REPEAT_MS)

    def show(
        self,
        elapsed_ms: int,
        curtain: Curtain,
        words: NDArray[np.int64],
        best: float | None,
        rest: float | None,
        pause: int = Pause.NONE,
    ) -> None:
        """Publish the stations' views if they are due; each if somebody subscribes to it, and it has changed.

        Only what a station may see counts as a change: otherwise the times of its views would reveal when the partner's
        hand moves.

        ``elapsed_ms``: time since the start of the session, in ticks of 1 ms [ms].
        ``words``: row of the tick as words. ``best``, ``rest``, ``pause``: as in `netboard.stage.curtain.view_of`.
        """
        if elapsed_ms <= self._due_ms:
            return
        self._due_ms = elapsed_ms - elapsed_ms % self._every + self._every
        if elapsed_ms - self._asked_ms >= ASK_MS:
            self._asked_ms = elapsed_ms
            self._subscribed = [channel for channel, publisher in self._views.items() if publisher.wanted()]
        numbers = nan if best is None else best, now_ns(), nan if rest is None else rest, int(pause)
        for channel in self._subscribed:
            seat = _curtain_of(channel, curtain)
            if seat is not None:
                self._show_to(channel, elapsed_ms, seat, words, *numbers)

    def _show_to(
        self,
        channel: int,
        elapsed_ms: int,
        curtain: Records,
        words: NDArray[np.int64],
        best: float,
        sent_ns: int,
        rest: float,
        pause: int,
    ) -> None:
        """Publish the view of a channel if it has changed, or has not been sent for long."""
        at_any_rate, seq = elapsed_ms - self._shown_ms[channel] >= VIEW_REPEAT_MS, self._seq[channel]
        size = self._write_view(
            self._frame, curtain, words, self._content[channel], at_any_rate, best, sent_ns, seq, rest, pause
        )
        if size:
            self._views[channel].send(self._frame[:size].tobytes())
            self._shown_ms[channel], self._seq[channel] = elapsed_ms, seq + 1

    def close(self) -> None:
        """Close all publishers."""
        for publisher in self._views.values():
            publisher.close()


def _curtain_of(channel: int, curtain: Curtain) -> Records | None:
    """Return what may be seen on a channel; None on that of a robot partner, if the block has none there."""
    for side in SIDES:
        if channel == channels.VIEW[side]:
            return curtain.stations[side]
        if channel == channels.PARTNER[side]:
            return curtain.partners.get(side)
    raise ValueError(f"channel {channel} has no views")
