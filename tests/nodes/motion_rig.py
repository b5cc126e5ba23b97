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
"""In so many ticks whatever a test has said has been taken [1]."""


class Peers:
    """Sockets that talk to a router, one for each name: nothing they say or are told is dropped."""

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

    def say(self, peer: bytes, *messages: Message | bytes) -> None:
        """Let a peer send one frame, made of these parts."""
        parts = [message if isinstance(message, bytes) else encode(message) for message in messages]
        self._of(peer).send_multipart(parts, zmq.NOBLOCK)

    def heard(self, peer: bytes) -> list[Message]:
        """Take everything a peer has been sent."""
        found = []
        while (frame := sockets.receive(self._of(peer))) is not None:
            found.append(decode(frame))
        return found

    def go(self, peer: bytes) -> None:
        """Let a peer close its socket."""
        self._sockets.pop(peer).close()


class MotionRig:
    """The port, its router and its peers."""

    def __init__(self, context: sockets.Context, ends: Any = None) -> None:
        address = f"inproc://motion-{id(self)}"
        self.real = sockets.motion_server(context, channels.Endpoint(address))
        self.router = Peers(context, address)
        self.port = MotionPort(self.real, WELCOME, TIMEOUT_NS, BOUND_NS, ends)

    def drain(self, clock: Callable[[], int], due_ns: int = 0) -> bool:
        """Take what has arrived, all of it at one time; whether the tick is complete then."""
        self.port.fast.record["set_ns"] = clock()
        for _ in range(ROUNDS):
            complete = self.port.drain(clock, due_ns)
            self.port.attend(clock(), due_ns)
        return complete
