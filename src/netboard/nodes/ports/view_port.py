"""The server's endpoint of the two view channels: each station gets what its participant may see, at the view rate."""

from dataclasses import fields
from math import ceil
from operator import attrgetter
from typing import Any

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.tables.rig import Network
from netboard.network.protocol.codec import encode
from netboard.network.transport import channels, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.stage.curtain import Curtain, view_of
from netboard.stage.view import View

SAME_VIEW_TICKS = 50
"""Ticks after which an unchanged view is sent again, so that a display knows that the link is alive [1]."""

_ALWAYS_NEW = ("tick", "sent_ns", "seq", "rest")
_content = attrgetter(*(field.name for field in fields(View) if field.name not in _ALWAYS_NEW))
"""Takes from a view the fields whose change is shown at once; that of `rest` may wait, because it counts in seconds."""


class ViewPort:
    """The publishers of both stations' views. ``network`` has their addresses, and the largest rate of views."""

    def __init__(self, network: Network, context: sockets.Context, authenticator: Authenticator | None) -> None:
        where = channels.addresses(network, authenticator)
        self._views = {side: sockets.view_publisher(context, where.listen(channels.VIEW[side])) for side in SIDES}
        self._every = ceil(1000 / network.view_rate_hz)
        self._due_ms = 0
        self._last_shown: dict[Side, tuple[int, tuple[Any, ...]]] = {}
        self._seq = dict.fromkeys(SIDES, 0)
        self.renew()

    @property
    def wanted(self) -> bool:
        """Whether anybody has subscribed to a view."""
        return any(publisher.wanted() for publisher in self._views.values())

    def due(self, now_ms: int) -> int:
        """Return when to call `show` next, given the present elapsed time [ms]."""
        return max(self._due_ms, now_ms) + 1

    def renew(self) -> None:
        """Forget the last views, because a new block changes everything."""
        self._last_shown = dict.fromkeys(SIDES, (-SAME_VIEW_TICKS, ()))

    def show(self, now_ms: int, curtain: Curtain, row: Any, best: float | None, rest: float | None) -> None:
        """Publish the stations' views if they are due; each if somebody subscribes to it, and it has changed.

        ``now_ms``: elapsed time by which views are due [ms]; in a live session, the number of the following tick.
        """
        if now_ms <= self._due_ms:
            return
        self._due_ms = now_ms - now_ms % self._every + self._every
        values = row.item()
        for side in SIDES:
            if self._views[side].wanted():
                self._show_to(side, now_ms, curtain, values, best, rest)

    def _show_to(
        self,
        side: Side,
        now_ms: int,
        curtain: Curtain,
        values: tuple[Any, ...],
        best: float | None,
        rest: float | None,
    ) -> None:
        """Publish a station's view if it has changed, or has not been sent for long.

        Only what this station may see counts as a change: otherwise the times of its views would reveal when the
        partner's hand moves.
        """
        shown_ms, sent = self._last_shown[side]
        view = view_of(curtain, values, side, best, now_ns(), self._seq[side], rest)
        content = _content(view)
        if content == sent and now_ms - shown_ms < SAME_VIEW_TICKS:
            return
        self._last_shown[side] = now_ms, content
        self._views[side].send(encode(view))
        self._seq[side] += 1

    def close(self) -> None:
        """Close both publishers."""
        for publisher in self._views.values():
            publisher.close()
