"""A recording on the sockets of a server: displays, consoles and clients in any language connect as to a live session.

Curtain, ports and authentication are those of the server. The views follow a `ReplayPosition`, which commands and keys
control. Nothing is computed and there are no forces: agents and loggers are refused with the reason.
"""

import logging
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.base.process.stopping import Stopping
from netboard.base.tables.rig import Network
from netboard.base.terminal.logs import log_to_stderr
from netboard.base.terminal.output import plain_console
from netboard.network import keys
from netboard.network.transport import channels, endpoints, poller, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.nodes.operator.keyboard import Keyboard
from netboard.nodes.ports.control_port import CommandRequest, ControlPort
from netboard.nodes.ports.refusals import Refusals
from netboard.nodes.ports.view_port import ViewPort
from netboard.nodes.ports.welcomes import unblinded, welcomes_of
from netboard.nodes.replay.replay_answers import ReplayAnswers, ReplayState
from netboard.nodes.server.event_log import printable, printable_line
from netboard.recording.replay.commands import KEYS, KEYS_LINE, ReplayCommand, in_words, run_command
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.loading import load_with_progress
from netboard.recording.replay.position import ReplayPosition, require_inside

log = logging.getLogger(__name__)

PERIOD_NS = 1_000_000
"""Period of the loop; views are scheduled in milliseconds [ns]."""

HOUSEKEEPING_ROUNDS = 20
"""Rounds between two checks of peers and authentication [1]."""

CLOSING_SECONDS = 0.2
"""Time before the channels close, for peers to read the last messages [s].

With `zmq.IMMEDIATE`, libzmq drops what a peer has not read when its connection ends.
"""

MAX_CHARACTERS = 1000
"""Longest answer: it may quote the question, and must fit into its frame [1]."""

MAX_REFUSED = 16
"""Frames on a closed channel taken at once [1]."""


class ClosedPort:
    """A channel that a replay does not serve; its peers are refused with the reason."""

    def __init__(self, router: endpoints.Router, reason: str) -> None:
        self.news: list[tuple[str, dict[str, str]]] = []
        self._router, self._reason = router, reason
        self.refusals = Refusals(router, self.news)

    def drain(self, now_ns: int) -> None:
        """Refuse the frames that have arrived [ns]."""
        for _ in range(MAX_REFUSED):
            received = self._router.receive()
            if received is None:
                return
            if received != endpoints.REFUSED:
                self.refusals.refuse(received[0], self._reason, now_ns)

    def close(self) -> None:
        """Close after the last messages."""
        self._router.close_after_goodbye()


class ReplayServer:
    """The server of a recording.

    ``network`` has its addresses, and the largest rate of views. ``authenticator`` is None without authentication.
    ``at``: where to begin; None for the start of the block [s].
    """

    def __init__(
        self,
        recording: LoadedRecording,
        network: Network,
        context: sockets.Context,
        authenticator: Authenticator | None,
        speed: float = 1.0,
        at: float | None = None,
    ) -> None:
        begin = min(recording.begin if at is None else at, recording.length)
        self.state = ReplayState(recording, ReplayPosition(recording.length, begin, now_ns() * 1e-9, speed))
        self._authenticator = authenticator
        self._over = False
        where = channels.addresses(network, authenticator)
        control = sockets.control_server(context, where.listen(channels.CONTROL))
        texts = unblinded(recording.config, recording.text)
        self.control = ControlPort(control, welcomes_of(texts, self.state.session).shown)
        self._answers = ReplayAnswers(self.state, self.control)
        self._views = ViewPort(network, context, authenticator)
        what = f"this is a replay of {recording.name}"
        motion = sockets.motion_server(context, where.listen(channels.MOTION))
        records = sockets.log_server(context, where.listen(channels.LOG))
        self._closed = (
            ClosedPort(motion, f"{what}: it has no forces, so no agent can connect"),
            ClosedPort(records, f"{what}: it has no records for a logger"),
        )
        self._waiter = poller.Waiter([control.socket])

    def run(
        self, stopping: Callable[[], bool], keys: Callable[[], ReplayCommand | None], say: Callable[[str], None]
    ) -> None:
        """Serve until somebody ends it.

        ``keys``: returns the order of a key pressed at this terminal, or None. ``say``: takes a line for people
        whenever an order was carried out or refused.
        """
        self.state.playback = self.state.playback.play(now_ns() * 1e-9)
        begun_ns, rounds = now_ns(), 0
        while not (self._over or stopping()):
            for words in self.run_once((now_ns() - begun_ns) // PERIOD_NS):
                say(words)
            if rounds % HOUSEKEEPING_ROUNDS == 0:
                self.housekeeping()
                if (order := keys()) is not None:
                    say(self._carry_out(order, "a key")[1])
            rounds += 1
            left_ns = PERIOD_NS - (now_ns() - begun_ns) % PERIOD_NS
            self._waiter.wait(left_ns * 1e-9)
        self.leave()

    def run_once(self, milliseconds: int) -> list[str]:
        """Publish the views and carry out the commands that are due; return what to say about them.

        ``milliseconds``: time for which the server has been running [ms].
        """
        self._show(milliseconds)
        self.control.drain(now_ns)
        self.control.answer(self._answers)
        requests = list(self.control.requests)
        self.control.requests.clear()
        return [self._grant(request) for request in requests]

    def _show(self, milliseconds: int) -> None:
        """Send each station its view, if it is due."""
        index, recording = self.state.index, self.state.recording
        best, rest = recording.best(index), recording.rest(index)
        words = np.frombuffer(recording.ticks[index].data, np.int64)
        self._views.show(milliseconds, recording.curtain, words, best, rest, recording.pause(index))

    def _grant(self, request: CommandRequest) -> str:
        command = request.command
        accepted, words = self._carry_out(ReplayCommand(command.name, command.argument), request.name)
        self.control.reply(request, accepted, words[:MAX_CHARACTERS])
        return words[:MAX_CHARACTERS]

    def _carry_out(self, order: ReplayCommand, by: str) -> tuple[bool, str]:
        """Carry out an order; return whether it succeeded, and what to say."""
        now, state = now_ns() * 1e-9, self.state
        if order.name == "take":
            return True, "every operator may command a replay"
        try:
            state.playback = run_command(state.playback, state.recording, now, order)
        except NetboardError as error:
            return False, str(error)
        self._views.renew()
        self._over = order.name == "end"
        log.info("%s", printable_line(f"{order.name} {order.argument} by {by}"))
        return True, "the replay ends" if self._over else in_words(state.playback, state.recording, now)

    def housekeeping(self) -> None:
        """Check the peers and the authentication."""
        now = now_ns()
        self.control.pump(now)
        self.control.take_frames()  # frames of a replay are not recorded
        for closed in self._closed:
            closed.drain(now)
            closed.refusals.poll(now)
        for port in (self.control, *self._closed):
            for name, details in port.news:
                log.info("%s %s", name, printable(details))
            port.news.clear()
        if self._authenticator is not None:
            self._authenticator.answer_handshakes()
            for details in self._authenticator.reports(now):
                log.info("refused %s", printable(details))

    def leave(self) -> None:
        """Say goodbye and close."""
        self.control.goodbye("the replay is over")
        time.sleep(CLOSING_SECONDS)  # and welcome nobody again
        self._views.close()
        self.control.close()
        for port in self._closed:
            port.close()


def serve_recording(path: Path, network: Network, speed: float, at: float | None, *, insecure: bool) -> None:
    """Replay a recording on the ports of a server, steered with the keys of this terminal, too.

    ``at``: where to begin; None for the start of the block [s]. ``insecure``: accept other machines without encryption.
    """
    if not insecure:
        keys.refuse_open_network(network)
    authenticator = keys.make_authenticator(network)
    console = plain_console()
    recording = load_with_progress(path)
    require_inside(at, recording.length, recording.name)
    log_to_stderr("replay")
    with Stopping() as stopping, sockets.open_context() as context, Keyboard() as keyboard:
        server = ReplayServer(recording, network, context, authenticator, speed, at)
        console.print(f"{recording.name} is replayed at {network.bind}:{network.port}")
        if keyboard.available:
            console.print(KEYS_LINE)
        server.run(
            stopping, lambda: KEYS.get(keyboard.pressed() or ""), lambda words: console.print(printable_line(words))
        )
