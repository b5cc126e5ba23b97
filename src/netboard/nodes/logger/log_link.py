"""The client's endpoint of the log channel, for loggers and subscribers."""

from typing import Protocol

from netboard.base.process import NAME
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.transport import channels, poller, sockets

HELLO_INTERVAL_NS = 500_000_000
"""Time without an answer after which `Hello` is sent again [ns]."""

SILENCE_TIMEOUT_NS = 1_000_000_000
"""Silence after which the server may have been restarted and is sent another `Hello` [ns]."""

WAIT_SECONDS = 0.02
BURST = 16


class Link(Protocol):
    """The client's endpoint of the log channel."""

    def wait(self, seconds: float) -> bool:
        """Wait until a frame can be received, or until the timeout [s]."""

    def receive(self) -> bytes | None:
        """Return the next frame, or None if there is none now."""

    def send(self, frame: bytes) -> bool:
        """Send without waiting; return False if no peer is connected."""


class SocketLink:
    """The log channel over a ZeroMQ socket."""

    def __init__(self, network: Network, role: str, context: sockets.Context) -> None:
        endpoint = keys.reach(network, role).reach(channels.LOG)
        self._socket = sockets.log_client(context, endpoint, f"{role}@{NAME}")

    def wait(self, seconds: float) -> bool:
        """Wait until a frame can be received, or until the timeout [s]."""
        return poller.wait_readable(self._socket, seconds)

    def receive(self) -> bytes | None:
        """Return the next frame, or None if there is none now."""
        return sockets.receive(self._socket)

    def send(self, frame: bytes) -> bool:
        """Send without waiting; return False if no peer is connected."""
        return sockets.send_or_renew(self._socket, frame)
