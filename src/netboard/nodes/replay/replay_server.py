"""A recording on the sockets of a server: displays, consoles and clients in any language connect as if it were live.

It is the same curtain, the same ports and the same door. What is shown follows a `Playback`, which commands and keys
change. Nothing is computed and no force exists: agents and loggers are told so and sent away.
"""

import logging
import uuid
from collections.abc import Callable

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import authenticator, channels, endpoints, poller, sockets
from netboard.nodes.ports.control_port import ControlPort, Wish
from netboard.nodes.ports.refusals import Refusals
from netboard.nodes.ports.view_port import ViewPort
from netboard.nodes.replay.replay_answers import ReplayAnswers
from netboard.recording.replay.loaded import Reel
from netboard.recording.replay.orders import Order, in_words, obey
from netboard.recording.replay.position import Playback

log = logging.getLogger(__name__)

ROUND_NS = 1_000_000
"""The loop looks up so often: whose turn it is to be shown a view is counted in milliseconds [ns]."""

HOUSE_ROUNDS = 20
"""After so many rounds it looks after peers and door [1]."""

FAREWELL_SECONDS = 0.2
"""Peers get this long to read what they were told last: closing would take it from them [s]."""

MOST_LETTERS = 1000
"""An answer has at most so many letters: it may quote what was asked, and must fit into its frame [1]."""

MOST_REFUSED = 16
"""Frames on a closed channel taken in one go [1]."""


class ClosedPort:
    """A channel on which there is nothing to be had; whoever comes is told why."""

    def __init__(self, router: endpoints.Router, reason: str) -> None:
        self.news: list[tuple[str, dict[str, str]]] = []
        self._router, self._reason = router, reason
        self.refusals = Refusals(router, self.news)

    def drain(self, now_ns: int) -> None:
        """Refuse whatever has come [ns]."""
        for _ in range(MOST_REFUSED):
            received = self._router.receive()
            if received is None:
                return
            if received != endpoints.NOBODY:
                self.refusals.refuse(received[0], self._reason, now_ns)

    def close(self) -> None:
        """Close, after the last words."""
        self._router.close_after_goodbye()


class ReplayServer:
    """The server of a recording.

    Parameters
    ----------
    network : Network
        Where it listens, and how often a view may be sent.
    door : doors.Door or None
        Where peers show their keys; None where no keys are asked for.
    at : float or None
        Where to begin; None for the start of the block [s].

    Attributes
    ----------
    session : str
        Id of this run: not that of the recording, for everything is counted anew.
    """

    def __init__(
        self,
        reel: Reel,
        network: Network,
        context: sockets.Context,
        door: authenticator.Door | None,
        speed: float = 1.0,
        at: float | None = None,
    ) -> None:
        self.reel = reel
        self.session = uuid.uuid4().hex
        self.playback = Playback(
            reel.length, min(reel.begin if at is None else at, reel.length), now_ns() * 1e-9, speed
        )
        self._words = reel.ticks.view(np.int64).reshape(len(reel.ticks), -1)
        self._door = door
        self._over = False
        where = channels.addresses(network, door)
        control = sockets.control_server(context, where.listen(channels.CONTROL))
        welcome = Welcome(self.session, PROTOCOL_VERSION, now_ns(), reel.text)
        self.control = ControlPort(control, welcome, ReplayAnswers(self))
        self._views = ViewPort(network, context, door)
        what = f"this is a replay of {reel.name}"
        motion = sockets.motion_server(context, where.listen(channels.MOTION))
        records = sockets.log_server(context, where.listen(channels.LOG))
        self._closed = (
            ClosedPort(motion, f"{what}: it exerts no force, and takes no agent"),
            ClosedPort(records, f"{what}: there is nothing to record"),
        )
        self._waiter = poller.Waiter([control.socket])

    @property
    def index(self) -> int:
        """The row that is shown now [1]."""
        return self.reel.at(self.playback.at(now_ns() * 1e-9))

    def run(self, stopping: Callable[[], bool], keys: Callable[[], Order | None], say: Callable[[str], None]) -> None:
        """Serve until somebody ends it.

        Parameters
        ----------
        keys : callable
            A key that was pressed at this terminal, if one was.
        say : callable
            Takes a line for people whenever an order was carried out or refused.
        """
        self.playback = self.playback.play(now_ns() * 1e-9)
        begun_ns, rounds = now_ns(), 0
        while not (self._over or stopping()):
            for words in self.go_on((now_ns() - begun_ns) // ROUND_NS):
                say(words)
            if rounds % HOUSE_ROUNDS == 0:
                self.keep_house()
                if (order := keys()) is not None:
                    say(self._carry_out(order, "a key")[1])
            rounds += 1
            left_ns = ROUND_NS - (now_ns() - begun_ns) % ROUND_NS
            self._waiter.wait(left_ns * 1e-9)
        self.leave()

    def go_on(self, milliseconds: int) -> list[str]:
        """Show what is to be seen, and do what is wished; what is to be said of it.

        Parameters
        ----------
        milliseconds : int
            How long the server has been running: views are sent in turns [1].
        """
        self._show(milliseconds)
        self.control.drain(now_ns())
        self.control.answer()
        wishes = list(self.control.wishes)
        self.control.wishes.clear()
        return [self._grant(wish) for wish in wishes]

    def _show(self, milliseconds: int) -> None:
        """Send each station what it may see, if it is its turn."""
        index, reel = self.index, self.reel
        seen = reel.ticks[index], self._words[index]
        self._views.show(milliseconds, reel.curtain, *seen, reel.best(index), reel.rest(index))

    def _grant(self, wish: Wish) -> str:
        """Carry out a command and answer it."""
        command = wish.command
        accepted, words = self._carry_out(Order(command.name, command.argument), wish.name)
        self.control.reply(wish, accepted, words[:MOST_LETTERS])
        return words[:MOST_LETTERS]

    def _carry_out(self, order: Order, by: str) -> tuple[bool, str]:
        """Carry out an order; whether it could be, and what is to be said."""
        now = now_ns() * 1e-9
        if order.name == "take":
            return True, "everybody may command a replay"
        try:
            self.playback = obey(self.playback, self.reel, now, order)
        except NetboardError as error:
            return False, str(error)
        self._views.renew()
        self._over = order.name == "end"
        log.info("%s", printable_line(f"{order.name} {order.argument} by {by}"))
        return True, "the replay ends" if self._over else in_words(self.playback, self.reel, now)

    def keep_house(self) -> None:
        """Look after the peers and the door."""
        now = now_ns()
        self.control.pump(now)
        self.control.take_frames()  # what is shown of a replay is not recorded
        for closed in self._closed:
            closed.drain(now)
            closed.refusals.look(now)
        for port in (self.control, *self._closed):
            for name, details in port.news:
                log.info("%s %s", name, printable(details))
            port.news.clear()
        if self._door is not None:
            self._door.attend()
            for details in self._door.news(now):
                log.info("refused %s", printable(details))

    def leave(self) -> None:
        """Say goodbye and close."""
        self.control.goodbye("the replay is over")
        until_ns = now_ns() + int(FAREWELL_SECONDS * 1e9)
        while (left_ns := until_ns - now_ns()) > 0:
            self._waiter.wait(left_ns * 1e-9)
            self.control.drain(now_ns())
        self._views.close()
        self.control.close()
        for port in self._closed:
            port.close()


def printable(details: dict[str, str]) -> str:
    """Write the details of an event as one line."""
    return printable_line(" ".join(f"{key}={value}" for key, value in details.items()))


def printable_line(words: str) -> str:
    """Write words of a stranger so that they have no power over the terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in words)
