"""A motion port with a fake router and its peers, in one process and in simulated time."""

from collections.abc import Callable
from typing import Any

import zmq
from fake_router import WELCOME

from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import Message
from netboard.network.transport import channels, sockets
from netboard.nodes.ports.motion_port import MotionPort

TIMEOUT_NS = 50_000_000
BOUND_NS = 500_000

ROUNDS = 8
"""Number of drains after which every message of a test has been handled [1]."""


class Peers:
    """Sockets connected to a router, one for each name, whose queues have no limit."""

    def __init__(self, context: sockets.Context, address: str) -> None:
        self._context = context
        self._address = address
        self._sockets: dict[bytes, sockets.Socket] = {}

    def _of(self, peer: bytes) -> sockets.Socket:
        if peer not in self._sockets:
            socket = self._context.socket(zmq.DEALER)
            socket.setsockopt(zmq.SNDHWM, 0)
            socket.setsockopt(zmq.RCVHWM, 0)
            socket.setsockopt(zmq.IDENTITY, peer)
            socket.connect(self._address)
            self._sockets[peer] = socket
        return self._sockets[peer]

    def send_from(self, peer: bytes, *messages: Message | bytes) -> None:
        """Send one message with these parts from a peer."""
        parts = [message if isinstance(message, bytes) else encode(message) for message in messages]
        self._of(peer).send_multipart(parts, zmq.NOBLOCK)

    def received_by(self, peer: bytes) -> list[Message]:
        """Return all messages that a peer has received."""
        found = []
        while (frame := sockets.receive(self._of(peer))) is not None:
            found.append(decode(frame))
        return found

    def disconnect(self, peer: bytes) -> None:
        """Close the socket of a peer."""
        self._sockets.pop(peer).close()


class MotionRig:
    """The port, its router and its peers."""

    def __init__(self, context: sockets.Context, ends: Any = None) -> None:
        address = f"inproc://motion-{id(self)}"
        self.real = sockets.motion_server(context, channels.Endpoint(address))
        self.router = Peers(context, address)
        self.port = MotionPort(self.real, WELCOME, TIMEOUT_NS, BOUND_NS, ends)

    def drain(self, clock: Callable[[], int], due_ns: int = 0) -> bool:
        """Handle everything that has arrived, at one time, and return whether the tick is complete."""
        self.port.fast.record["simulated_ns"] = clock()
        for _ in range(ROUNDS):
            complete = self.port.drain(clock, due_ns)
            self.port.attend(clock(), due_ns)
        return complete
