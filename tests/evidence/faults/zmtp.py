"""A minimal client of ZMTP 3, ZeroMQ's wire protocol, over plain TCP sockets, for valid and invalid traffic.

It does not use the ZeroMQ library, which cannot send invalid traffic. A `Connection` follows the protocol and sends any
message in it; `invalid_streams` generates byte streams that violate the protocol itself.
"""

import random
import socket as net
import struct
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TypeAlias

MORE, LONG, COMMAND = 1, 2, 4
"""Flags of a ZMTP frame."""

CONNECT_SECONDS = 5.0
"""Timeout for a TCP connection [s]."""
MAX_BACKLOG = 2**18
"""Number of unsent bytes above which a connection accepts no more messages [bytes]."""

Stream: TypeAlias = tuple[bytes, ...]
"""Byte strings sent in one connection, one after the other."""


def greeting(mechanism: bytes = b"NULL", major: int = 3, minor: int = 0) -> bytes:
    """Return the greeting, the first 64 bytes of a connection."""
    return b"\xff" + bytes(8) + b"\x7f" + bytes([major, minor]) + mechanism.ljust(20, b"\0")[:20] + bytes(32)


def framed(body: bytes, flags: int = 0) -> bytes:
    """Return a frame with its header."""
    if len(body) < 256:
        return bytes([flags, len(body)]) + body
    return struct.pack(">BQ", flags | LONG, len(body)) + body


def command(name: bytes, body: bytes = b"") -> bytes:
    """Return a command frame."""
    return framed(bytes([len(name)]) + name + body, COMMAND)


def ready(kind: bytes, identity: bytes = b"") -> bytes:
    """Return the READY command, which ends a handshake with the NULL mechanism."""
    properties = ((b"Socket-Type", kind), (b"Identity", identity))
    body = b"".join(bytes([len(name)]) + name + struct.pack(">I", len(value)) + value for name, value in properties)
    return command(b"READY", body)


def message(parts: Sequence[bytes]) -> bytes:
    """Return a message of one or more parts."""
    return b"".join(framed(part, MORE * (i + 1 < len(parts))) for i, part in enumerate(parts))


class Connection:
    """A connection to a ZeroMQ socket that reconnects when the server closes it.

    - `connections`: number of connections made [1].
    """

    def __init__(
        self, address: tuple[str, int], kind: bytes, identity: bytes = b"", first: Sequence[bytes] = ()
    ) -> None:
        self.connections = 0
        self._address = address
        self._handshake = greeting() + ready(kind, identity)
        self._first = b"".join(message([part]) for part in first)
        self._socket: net.socket | None = None
        self._backlog = b""

    def send(self, *parts: bytes) -> bool:
        """Queue a message; return False if the backlog is full."""
        self._flush()
        if len(self._backlog) > MAX_BACKLOG:
            return False
        self._backlog += message(parts)
        self._flush()
        return True

    def close(self) -> None:
        """Close the connection; the next message opens a new one."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._backlog = None, b""

    def _flush(self) -> None:
        try:
            if self._socket is None:
                self._socket = self._connect()
                self._backlog = self._first + self._backlog
                self.connections += 1
            with suppress(BlockingIOError):
                while self._backlog:
                    self._backlog = self._backlog[self._socket.send(self._backlog) :]
            with suppress(BlockingIOError):
                while True:  # discard the answers, so that the server can send
                    if not self._socket.recv(65_536):
                        raise ConnectionResetError
        except (ConnectionResetError, BrokenPipeError):
            self.close()

    def _connect(self) -> net.socket:
        """Connect and complete the handshake; the server would read earlier bytes as part of it."""
        socket = net.create_connection(self._address, CONNECT_SECONDS)
        socket.sendall(self._handshake)
        received = b""
        while b"READY" not in received:
            data = socket.recv(4096)
            if not data:
                raise ConnectionResetError
            received += data
        socket.setblocking(False)
        return socket


def invalid_streams(seed: int) -> Iterator[Stream]:
    """Generate the streams of successive connections; all of them violate the protocol."""
    rng = random.Random(seed)
    while True:
        yield _invalid_stream(rng)


def _invalid_stream(rng: random.Random) -> Stream:
    """Return a stream of one of eleven kinds, each with the same probability."""
    match rng.randrange(11):
        case 0:
            return _random_bytes(rng), _random_bytes(rng)
        case 1:
            return b"GET / HTTP/1.1\r\nHost: lab\r\n\r\n", b"x: y\r\n" * rng.choice((0, 500))
        case 2:  # part of a greeting
            return greeting()[: rng.randrange(64)], rng.choice((b"", _random_bytes(rng)))
        case 3:  # an unusual mechanism or version
            mechanism = rng.choice((b"NULL", b"PLAIN", b"CURVE", b"GSSAPI", b"", b"X" * 20, rng.randbytes(20)))
            return greeting(mechanism, rng.choice((0, 1, 2, 3, 4, 255)), rng.randrange(4)), _random_bytes(rng)
        case 4:  # an invalid READY
            kind = rng.choice((b"", b"PUB", b"REQ", b"ROUTER", b"PAIR", b"DEALER\0", b"X" * 4000))
            body = ready(kind, rng.randbytes(rng.choice((0, 1, 255, 256, 5000))))
            return greeting(), rng.choice((body, body[: rng.randrange(len(body))], _with_flipped_bits(rng, body)))
        case 5:  # a frame before READY
            early = rng.choice((framed(b"x"), command(b"PING", b"\0\1x"), command(b"ERROR", b"\1x"), b"\4\0"))
            return greeting() + early, _random_bytes(rng)
        case 6:  # an unusual command
            names = (b"PING", b"PONG", b"ERROR", b"READY", b"HELLO", b"SUBSCRIBE", b"CANCEL", b"", b"X" * 255)
            name = rng.choice(names)
            return _handshake(rng), command(name, _random_bytes(rng)) + framed(_random_bytes(rng), COMMAND)
        case 7:  # a length that exceeds every limit or the content
            size = rng.choice((2**20 + 1, 2**31, 2**32, 2**63 - 1, 2**63, 2**64 - 1, 200_000))
            return _handshake(rng), struct.pack(">BQ", LONG | rng.choice((0, MORE, COMMAND)), size) + _random_bytes(rng)
        case 8:  # a message without its last part
            return _handshake(rng), framed(_random_bytes(rng), MORE) * rng.choice((1, 10, 300))
        case 9:  # random flags
            return _handshake(rng), b"".join(framed(b"x" * 20, rng.randrange(256)) for _ in range(20))
        case _:
            return _handshake(rng), _with_flipped_bits(rng, message([b"a", b"b" * 300]))


def _random_bytes(rng: random.Random) -> bytes:
    return rng.randbytes(rng.choice((0, 1, 9, 10, 11, 63, 64, 65, 1000, 9000)))


def _handshake(rng: random.Random) -> bytes:
    kind = rng.choice((b"DEALER", b"DEALER", b"REQ", b"SUB", b"ROUTER"))
    return greeting() + ready(kind, rng.choice((b"", b"fuzz", rng.randbytes(8))))


def _with_flipped_bits(rng: random.Random, stream: bytes) -> bytes:
    corrupted = bytearray(stream)
    for _ in range(rng.choice((1, 3, 10))):
        corrupted[rng.randrange(len(corrupted))] ^= 1 << rng.randrange(8)
    return bytes(corrupted)


class StreamSender:
    """Sends invalid streams part by part over the connections that it is given.

    - `most_open`: number of connections kept open; older ones are closed [1].
    """

    def __init__(self, most_open: int, seed: int) -> None:
        self._most_open = most_open
        self._streams = invalid_streams(seed)
        self._open: deque[tuple[net.socket, deque[bytes]]] = deque()

    def add(self, connection: net.socket) -> None:
        """Start a new stream in a connection."""
        connection.setblocking(False)
        self._open.append((connection, deque(next(self._streams))))

    def send_next(self) -> None:
        """Send the next part of each stream."""
        for connection, parts in self._open:
            with suppress(OSError):  # the server may have closed the connection, or its buffer may be full
                connection.send(parts.popleft() if parts else b"")
        while len(self._open) > self._most_open:
            self._open.popleft()[0].close()

    def close(self) -> None:
        """Close all connections."""
        while self._open:
            self._open.popleft()[0].close()
