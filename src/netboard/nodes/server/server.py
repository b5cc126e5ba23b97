"""The physics server: one loop that runs the sessions of any number of dyads in real time.

It sleeps until a message arrives or a tick is due, then runs the session concerned. The sessions' ticks are spread
evenly over the millisecond so that they do not fall together. All decisions are made in
`netboard.nodes.server.session`.
"""

import logging
from collections.abc import Callable, Sequence

from netboard.base.clock import now_ns
from netboard.base.process.realtime import steady_loop
from netboard.base.tick import TICK_NS
from netboard.network.transport import sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.session import DyadSession
from netboard.nodes.server.turns import CONTROL, MOTION, Turns

log = logging.getLogger(__name__)

MAX_SLEEP_NS = 100_000_000
"""Longest sleep of the loop, so that it notices a request to stop [ns]."""


class Server:
    """The sessions and their loop.

    ``authenticators``: each dyad's; None without authentication. ``confirmation``: words of the command line that
    confirm stand-ins; see `netboard.nodes.server.stand_ins`.
    """

    def __init__(
        self,
        sessions: Sequence[tuple[BlockSequence, Attempts]],
        context: sockets.Context,
        authenticators: Sequence[Authenticator | None],
        *,
        autostart: bool,
        confirmation: str = "",
    ) -> None:
        Turns(0)  # compiles what waits, before a tick is due
        self.sessions = [
            DyadSession(sequence, attempts, context, authenticator, autostart=autostart, confirmation=confirmation)
            for (sequence, attempts), authenticator in zip(sessions, authenticators, strict=True)
        ]

    @property
    def everything_recorded(self) -> bool:
        """Whether every record that matters is known to be on disk."""
        return all(session.records.everything_recorded for session in self.sessions)

    def run(self, stopping: Callable[[], bool], machine: dict[str, str]) -> None:
        """Run all sessions until each has ended, by itself or because the process is asked to stop.

        ``machine``: real-time settings that the process got from its machine, for the recording.
        """
        steady_loop()
        first_ns = now_ns() + TICK_NS
        for place, session in enumerate(self.sessions):
            # Spread, so that the sessions do not all tick, or do their periodic work, at once.
            share = place / len(self.sessions)
            session.begin(first_ns + int(share * TICK_NS), machine, share)
        running = list(self.sessions)
        while running:
            self._run(running, stopping)
            for session in [session for session in running if session.records.over]:
                session.records.close()
                running.remove(session)

    def _run(self, running: list[DyadSession], stopping: Callable[[], bool]) -> None:
        """Run the sessions until one begins to end or is over, which changes the sockets to wait for."""
        for session in running:
            session.sleeps = len(running) == 1
        turns = Turns(len(running))
        for place, session in enumerate(running):
            turns.plan(place, session.wake_ns, *session.files)
        while True:
            for place, found in enumerate(turns.wait(MAX_SLEEP_NS)):
                if not found:
                    continue
                session = running[place]
                if session.run_once(bool(found & MOTION), bool(found & CONTROL)):
                    return
                turns.plan(place, session.wake_ns, *session.files)
            if stopping():
                for place, session in enumerate(running):
                    session.stop()
                    turns.plan(place, session.wake_ns, *session.files)
