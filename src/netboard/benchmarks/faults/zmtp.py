"""ZeroMQ's wire protocol, ZMTP 3, just enough to break it: a peer that says whatever it likes over a bare TCP socket.

Nothing here uses ZeroMQ, which would refuse to send what is sent here. `streams` makes bytes that break the protocol in
any way; a `Line` is a peer that keeps to it, up to what its messages say.
"""

import random
import socket as net
import struct
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import TypeAlias

MORE, LONG, COMMAND = 1, 2, 4
"""Flags of a frame."""

CONNECT_SECONDS = 5.0
MOST_WAITING = 2**18
"""Bytes waiting to be sent above which a line accepts no more [bytes]."""

Place: TypeAlias = tuple[str, int]
"""Address and port."""

Stream: TypeAlias = tuple[bytes, ...]
"""Parts sent in one connection, in order."""


def greeting(mechanism: bytes = b"NULL", major: int = 3, minor: int = 0) -> bytes:
    """Return the first 64 bytes of a connection."""
    return b"\xff" + bytes(8) + b"\x7f" + bytes([major, minor]) + mechanism.ljust(20, b"\0")[:20] + bytes(32)


def framed(body: bytes, flags: int = 0) -> bytes:
    """Return a frame."""
    if len(body) < 256:
        return bytes([flags, len(body)]) + body
    return struct.pack(">BQ", flags | LONG, len(body)) + body


def command(name: bytes, body: bytes = b"") -> bytes:
    """Return a command frame."""
    return framed(bytes([len(name)]) + name + body, COMMAND)


def ready(kind: bytes, identity: bytes = b"") -> bytes:
    """Return the command that ends a handshake without keys."""
    properties = ((b"Socket-Type", kind), (b"Identity", identity))
    body = b"".join(bytes([len(name)]) + name + struct.pack(">I", len(value)) + value for name, value in properties)
    return command(b"READY", body)


def message(parts: Sequence[bytes]) -> bytes:
    """Return a message of several parts."""
    return b"".join(framed(part, MORE * (i + 1 < len(parts))) for i, part in enumerate(parts))


class Line:
    """A connection to a ZeroMQ socket, renewed whenever the peer cuts it."""

    def __init__(self, place: Place, kind: bytes, identity: bytes = b"", first: Sequence[bytes] = ()) -> None:
        self.made = 0
        self._place = place
        self._handshake = greeting() + ready(kind, identity)
        self._first = b"".join(message([part]) for part in first)
        self._socket: net.socket | None = None
        self._waiting = b""

    def offer(self, *parts: bytes) -> bool:
        """Queue a message; return False if too much is waiting."""
        self._flush()
        if len(self._waiting) > MOST_WAITING:
            return False
        self._waiting += message(parts)
        self._flush()
        return True

    def close(self) -> None:
        """Close the connection; the next message opens a new one."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._waiting = None, b""

    def _flush(self) -> None:
        try:
            if self._socket is None:
                self._socket = self._connect()
                self._waiting = self._first + self._waiting
                self.made += 1
            with suppress(BlockingIOError):
                while self._waiting:
                    self._waiting = self._waiting[self._socket.send(self._waiting) :]
            with suppress(BlockingIOError):
                while True:  # what it answers is for nobody
                    if not self._socket.recv(65_536):
                        raise ConnectionResetError
        except (ConnectionResetError, BrokenPipeError):
            self.close()

    def _connect(self) -> net.socket:
        """Connect and shake hands; bytes sent before the peer is ready would count as handshake."""
        socket = net.create_connection(self._place, CONNECT_SECONDS)
        socket.sendall(self._handshake)
        heard = b""
        while b"READY" not in heard:
            heard += (said := socket.recv(4096))
            if not said:
                raise ConnectionResetError
        socket.setblocking(False)
        return socket


def streams(seed: int) -> Iterator[Stream]:
    """Make what one connection after the other says, in parts with pauses between: none of it is as it should be."""
    chance = random.Random(seed)
    while True:
        yield chance.choice(_STREAMS)(chance)


def _noise(chance: random.Random) -> bytes:
    return chance.randbytes(chance.choice((0, 1, 9, 10, 11, 63, 64, 65, 1000, 9000)))


def _nothing_but_noise(chance: random.Random) -> Stream:
    return _noise(chance), _noise(chance)


def _half_greeting(chance: random.Random) -> Stream:
    return greeting()[: chance.randrange(64)], chance.choice((b"", _noise(chance)))


def _other_greeting(chance: random.Random) -> Stream:
    mechanism = chance.choice((b"NULL", b"PLAIN", b"CURVE", b"GSSAPI", b"", b"X" * 20, chance.randbytes(20)))
    return greeting(mechanism, chance.choice((0, 1, 2, 3, 4, 255)), chance.randrange(4)), _noise(chance)


def _wrong_ready(chance: random.Random) -> Stream:
    kind = chance.choice((b"", b"PUB", b"REQ", b"ROUTER", b"PAIR", b"DEALER\0", b"X" * 4000))
    body = ready(kind, chance.randbytes(chance.choice((0, 1, 255, 256, 5000))))
    return greeting(), chance.choice((body, body[: chance.randrange(len(body))], _flipped(chance, body)))


def _out_of_turn(chance: random.Random) -> Stream:
    early = chance.choice((framed(b"x"), command(b"PING", b"\0\1x"), command(b"ERROR", b"\1x"), b"\4\0"))
    return greeting() + early, _noise(chance)


def _odd_command(chance: random.Random) -> Stream:
    name = chance.choice((b"PING", b"PONG", b"ERROR", b"READY", b"HELLO", b"SUBSCRIBE", b"CANCEL", b"", b"X" * 255))
    return _handshake(chance), command(name, _noise(chance)) + framed(_noise(chance), COMMAND)


def _endless(chance: random.Random) -> Stream:
    """Return a frame longer than any limit, or with a length far beyond its content."""
    size = chance.choice((2**20 + 1, 2**31, 2**32, 2**63 - 1, 2**63, 2**64 - 1, 200_000))
    return _handshake(chance), struct.pack(">BQ", LONG | chance.choice((0, MORE, COMMAND)), size) + _noise(chance)


def _unfinished(chance: random.Random) -> Stream:
    """Return parts of a message whose last part never comes."""
    return _handshake(chance), framed(_noise(chance), MORE) * chance.choice((1, 10, 300))


def _odd_flags(chance: random.Random) -> Stream:
    return _handshake(chance), b"".join(framed(b"x" * 20, chance.randrange(256)) for _ in range(20))


def _flip_anywhere(chance: random.Random) -> Stream:
    return _handshake(chance), _flipped(chance, message([b"a", b"b" * 300]))


def _http(chance: random.Random) -> Stream:
    return b"GET / HTTP/1.1\r\nHost: lab\r\n\r\n", b"x: y\r\n" * chance.choice((0, 500))


def _handshake(chance: random.Random) -> bytes:
    kind = chance.choice((b"DEALER", b"DEALER", b"REQ", b"SUB", b"ROUTER"))
    return greeting() + ready(kind, chance.choice((b"", b"fuzz", chance.randbytes(8))))


def _flipped(chance: random.Random, stream: bytes) -> bytes:
    spoiled = bytearray(stream)
    for _ in range(chance.choice((1, 3, 10))):
        spoiled[chance.randrange(len(spoiled))] ^= 1 << chance.randrange(8)
    return bytes(spoiled)


_STREAMS: tuple[Callable[[random.Random], Stream], ...] = (
    _nothing_but_noise,
    _http,
    _half_greeting,
    _other_greeting,
    _wrong_ready,
    _out_of_turn,
    _odd_command,
    _endless,
    _unfinished,
    _odd_flags,
    _flip_anywhere,
)


class Talk:
    """Connections that send streams part by part; the oldest are closed."""

    def __init__(self, kept: int, seed: int) -> None:
        self._kept = kept
        self._streams = streams(seed)
        self._open: deque[tuple[net.socket, deque[bytes]]] = deque()

    def take(self, connection: net.socket) -> None:
        """Start a stream in a connection."""
        connection.setblocking(False)
        self._open.append((connection, deque(next(self._streams))))

    def turn(self) -> None:
        """Send the next part in each connection."""
        for connection, parts in self._open:
            with suppress(OSError):  # the other end may have hung up, or take no more
                connection.send(parts.popleft() if parts else b"")
        while len(self._open) > self._kept:
            self._open.popleft()[0].close()

    def close(self) -> None:
        """Close all connections."""
        while self._open:
            self._open.popleft()[0].close()
