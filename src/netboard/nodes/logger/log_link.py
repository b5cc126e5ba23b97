"""The log channel as its peers have it: whoever takes records from the server, to disk or elsewhere."""

from typing import Protocol

from netboard.base.process import NAME
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.transport import channels, poller, sockets

HELLO_NS = 500_000_000
"""Hello is said again after so long without an answer [ns]."""

SILENT_NS = 1_000_000_000
"""A server silent for so long may have been started anew: it is greeted again [ns]."""

WAIT_SECONDS = 0.02
BURST = 16


class Link(Protocol):
    """The peer's end of the log channel."""

    def wait(self, seconds: float) -> bool:
        """Wait until there is something to receive, at most so long [s]."""

    def receive(self) -> bytes | None:
        """Next frame, or None if there is none now."""

    def send(self, frame: bytes) -> bool:
        """Send without waiting; False if nobody is there."""


class SocketLink:
    """The log channel over a real socket."""

    def __init__(self, network: Network, role: str, context: sockets.Context) -> None:
        endpoint = keys.reach(network, role).reach(channels.LOG)
        self._socket = sockets.log_client(context, endpoint, f"{role}@{NAME}")

    def wait(self, seconds: float) -> bool:
        """Wait until there is something to receive, at most so long [s]."""
        return poller.wait_readable(self._socket, seconds)

    def receive(self) -> bytes | None:
        """Next frame, or None if there is none now."""
        return sockets.receive(self._socket)

    def send(self, frame: bytes) -> bool:
        """Send without waiting; False if nobody is there."""
        return sockets.send_or_renew(self._socket, frame)
