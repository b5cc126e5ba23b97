"""The fast path: the 1 kHz frames, received and sent by compiled code through libzmq's own functions.

A loop that sleeps most of the time finds cold caches whenever it wakes. A few pyzmq calls, with the Python code between
them, then take a tenth of a tick. So kernels handle the frames of the motion channel. They call the same functions as
pyzmq, in the library that pyzmq has loaded, on a socket that `netboard.network.transport.sockets` has made and still
owns.

A fast path compares names and keys of senders with those of its registered peers. Frames of others go to Python.
"""

import errno
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import zmq
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel, machine_code
from netboard.base.errors import NetboardError
from netboard.network.transport import libzmq
from netboard.network.transport.waiting import (
    FIELDS,
    FILE,
    NO_FILE,
    await_file,
    c_function,
    clear,
    forget_files,
    has_signalled,
    machine_ns,
    prepare,
    sleep_until_signalled,
    waitable,
)

MACHINE_CLOCK = -1
"""Value of ``simulated_ns`` that selects the machine's clock."""

PLACES = 2
"""Peers that can be registered with a fast path [1]."""

NAME_ROOM = 255
"""Longest name of a peer that ZeroMQ allows [bytes]."""

KEY_SIZE = 40
"""Length of a key (Z85) [bytes]."""

ADDRESS_ROOM = 64

MAX_PARTS = 256
"""As `netboard.network.transport.endpoints.MAX_PARTS`, and more, because compiled code skips them faster [1]."""

NOTHING, OTHER, FAILED = -1, -2, -3
"""Results of `receive` other than the place of a registered peer."""

SENT, NOT_SENT = 0, 1
"""Results of sending, beside `FAILED`."""

FAST_PATH = np.dtype(
    [
        ("message", "u1", (64,)),  # zmq_msg_t, of the size that zmq.h gives it
        *FIELDS,
        ("watched", FILE),  # number of another file that ends a sleep, or NO_FILE
        ("signalled", "<i4"),  # 1: it has ended one, which its user notes here
        ("simulated_ns", "<i8"),  # simulated time, or MACHINE_CLOCK [ns]
        ("socket", "<i8"),  # libzmq's address of it, 0 once that is closed
        ("keyed", "<i8"),  # 1: the keys of peers are compared, too
        ("size", "<i8"),  # of the newest frame
        ("more", "<i8"),  # 1: parts of a message are left to be skipped
        ("name_size", "<i8"),
        ("name_sizes", "<i8", (PLACES,)),  # of the registered peers, 0 for no peer
        ("names", "u1", (PLACES, NAME_ROOM)),
        ("keys", "u1", (PLACES, KEY_SIZE)),
        ("name", "u1", (NAME_ROOM,)),  # of the newest frame's sender
        ("key", "u1", (KEY_SIZE,)),
        ("address", "u1", (ADDRESS_ROOM,)),
        ("user_id", "u1", (8,)),  # names of a connection's properties, as libzmq expects them
        ("peer_address", "u1", (16,)),
    ],
    align=True,
)
"""A fast path as the kernels see it."""

Socket: TypeAlias = zmq.Socket[bytes]


_INT, _POINTER = types.int32, types.intp
_zmq_recv, _zmq_send, _zmq_errno = map(libzmq.function, ("zmq_recv", "zmq_send", "zmq_errno"))
_msg_init, _msg_recv, _msg_data = map(libzmq.function, ("zmq_msg_init", "zmq_msg_recv", "zmq_msg_data"))
_msg_more, _msg_gets, _msg_close = map(libzmq.function, ("zmq_msg_more", "zmq_msg_gets", "zmq_msg_close"))
_memcpy = c_function("memcpy", _POINTER, _POINTER, _POINTER, _POINTER)
_memcmp = c_function("memcmp", _INT, _POINTER, _POINTER, _POINTER)
_strncpy = c_function("strncpy", _POINTER, _POINTER, _POINTER, _POINTER)

_DONTWAIT, _SNDMORE = int(zmq.DONTWAIT), int(zmq.SNDMORE)
_AGAIN, _INTERRUPTED, _UNREACHABLE = int(zmq.EAGAIN), errno.EINTR, int(zmq.EHOSTUNREACH)


@kernel
def now_ns(fast: Records) -> int:
    """Return this machine's monotonic time, as `netboard.base.clock.now_ns` does, or the simulated time [ns]."""
    if fast[0]["simulated_ns"] != MACHINE_CLOCK:
        return int(fast[0]["simulated_ns"])
    return machine_ns(fast)


@kernel
def _no_frame() -> int:
    """Return why nothing was received."""
    number = _zmq_errno()
    return NOTHING if number in (_AGAIN, _INTERRUPTED) else FAILED


@kernel
def _not_sent() -> int:
    """Return why nothing was sent."""
    number = _zmq_errno()
    return NOT_SENT if number in (_AGAIN, _INTERRUPTED, _UNREACHABLE) else FAILED


@kernel
def copy(target: NDArray[np.uint8], source: NDArray[np.uint8], count: int) -> None:
    """Copy the first elements of an array; for a slice Numba compiles the text of an error, which takes seconds."""
    for k in range(count):
        target[k] = source[k]


@kernel
def _place_of_sender(fast: Records) -> int:
    """Return the place of the newest frame's sender, or `OTHER` if it is not registered."""
    path = fast[0]
    name, size = path["name"].ctypes.data, path["name_size"]
    for place in range(PLACES):
        if path["name_sizes"][place] != size or _memcmp(path["names"][place].ctypes.data, name, size) != 0:
            continue
        if path["keyed"] and _memcmp(path["keys"][place].ctypes.data, path["key"].ctypes.data, KEY_SIZE) != 0:
            continue
        return place
    return OTHER


@kernel
def _note_sender(fast: Records) -> None:
    """Store the key and the address of the newest frame's sender."""
    path = fast[0]
    message = path["message"].ctypes.data
    clear(path["key"])
    clear(path["address"])
    user = _msg_gets(message, path["user_id"].ctypes.data)
    if user != 0:
        _strncpy(path["key"].ctypes.data, user, KEY_SIZE)
    address = _msg_gets(message, path["peer_address"].ctypes.data)
    if address != 0:
        _strncpy(path["address"].ctypes.data, address, ADDRESS_ROOM - 1)


@kernel
def _skip_parts(fast: Records) -> bool:
    """Skip the rest of a multipart message, a bounded number of parts; return whether nothing is left of it."""
    path = fast[0]
    message = path["message"].ctypes.data
    for _ in range(MAX_PARTS):
        if path["more"] == 0:
            return True
        _msg_init(message)
        path["more"] = _msg_recv(message, path["socket"], _DONTWAIT) >= 0 and _msg_more(message) != 0
        _msg_close(message)
    return bool(path["more"] == 0)


@kernel
def receive(fast: Records, frame: NDArray[np.uint8]) -> int:
    """Receive one frame of a router, without waiting.

    A message of several parts, or one that is too long, counts as an empty frame, which is no valid message. Parts are
    skipped a bounded number at a time; until all are skipped the result is `NOTHING`.

    Returns the place of the registered peer that sent it, or `NOTHING`, `OTHER`, `FAILED`.
    """
    if not _skip_parts(fast):
        return NOTHING
    path = fast[0]
    socket = path["socket"]
    size = _zmq_recv(socket, path["name"].ctypes.data, NAME_ROOM, _DONTWAIT)
    if size < 0:
        return _no_frame()
    path["name_size"] = size
    message = path["message"].ctypes.data
    _msg_init(message)  # not a plain buffer: only a message tells of further parts and has its sender's key and address
    size = _msg_recv(message, socket, _DONTWAIT)
    if size < 0:
        _msg_close(message)
        return FAILED
    if path["keyed"]:
        _note_sender(fast)
    whole = size <= len(frame) and _msg_more(message) == 0
    if whole:
        _memcpy(frame.ctypes.data, _msg_data(message), size)
    path["more"] = _msg_more(message) != 0
    _msg_close(message)
    path["size"] = size if whole else 0
    return _place_of_sender(fast)


@kernel
def send_to(fast: Records, place: int, frame: NDArray[np.uint8]) -> int:
    """Send a frame to a registered peer, without waiting.

    Returns `SENT`, `NOT_SENT` if the peer is gone or its queue is full, or `FAILED`.
    """
    path = fast[0]
    name = path["names"][place]
    if _zmq_send(path["socket"], name.ctypes.data, path["name_sizes"][place], _DONTWAIT | _SNDMORE) < 0:
        return _not_sent()  # refused here or not at all
    return SENT if _zmq_send(path["socket"], frame.ctypes.data, len(frame), _DONTWAIT) >= 0 else _not_sent()


@kernel
def receive_one(fast: Records, frame: NDArray[np.uint8]) -> int:
    """Receive one frame on a socket with one peer, without waiting.

    ``frame`` receives it, truncated to the size of this buffer.
    """
    size = _zmq_recv(fast[0]["socket"], frame.ctypes.data, len(frame), _DONTWAIT)
    return min(size, len(frame)) if size >= 0 else _no_frame()


@kernel
def send_one(fast: Records, frame: NDArray[np.uint8]) -> int:
    """Send a frame on a socket with one peer, without waiting.

    Returns `SENT`, `NOT_SENT` if no peer is connected or the queue is full, or `FAILED`.
    """
    return SENT if _zmq_send(fast[0]["socket"], frame.ctypes.data, len(frame), _DONTWAIT) >= 0 else _not_sent()


@kernel
def sleep(fast: Records, longest_ns: int) -> bool:
    """Sleep until something may have arrived, the watched file signals, a signal comes, or the time is over [ns].

    The socket must have been read until it was empty, because only then its file signals again. Simulated time passes
    at once. Returns whether the watched file has signalled.
    """
    path = fast[0]
    if path["simulated_ns"] != MACHINE_CLOCK:
        path["simulated_ns"] += longest_ns
        return False
    forget_files(fast)
    await_file(fast, path["file"])
    await_file(fast, path["watched"])
    sleep_until_signalled(fast, longest_ns)
    return has_signalled(fast, path["watched"])


class Sender(NamedTuple):
    """The sender of a frame."""

    name: bytes
    key: str
    address: str


def sender_of(row: Any) -> Sender:
    """Read a sender from a row with ``name``, ``name_size``, ``key`` and ``address``, as in `FAST_PATH`."""
    key, address = (row[name].tobytes().rstrip(b"\0").decode(errors="replace") for name in ("key", "address"))
    return Sender(row["name"][: row["name_size"]].tobytes(), key, address)


class FastPath:
    """A socket whose frames kernels exchange.

    ``socket``: a router or a dealer, which must not be closed before the fast path; None for a fast path without a
    socket.
    """

    def __init__(self, socket: Socket | None, keyed: bool = False) -> None:
        self.record = np.zeros(1, FAST_PATH)
        path = self.record[0]
        prepare(path)
        path["socket"], path["keyed"] = 0 if socket is None else libzmq.address_of(socket), keyed
        path["file"] = 0 if socket is None else waitable(socket.fileno())
        path["watched"], path["simulated_ns"] = NO_FILE, MACHINE_CLOCK
        for name, text in (("user_id", b"User-Id"), ("peer_address", b"Peer-Address")):
            path[name][: len(text)] = np.frombuffer(text, np.uint8)

    def register(self, place: int, name: bytes, key: str) -> None:
        """Register a peer at a place, by name and key."""
        path = self.record[0]
        path["name_sizes"][place] = len(name)
        path["names"][place][: len(name)] = np.frombuffer(name, np.uint8)
        path["keys"][place] = np.frombuffer(key.encode().ljust(KEY_SIZE, b"\0"), np.uint8)

    def watch(self, file: int) -> None:
        """Let signals of another socket's file end a sleep; `NO_FILE` for none."""
        self.record[0]["watched"] = waitable(file)

    def unregister(self, place: int) -> None:
        """Unregister the peer at a place."""
        self.record[0]["name_sizes"][place] = 0

    @property
    def sender(self) -> Sender:
        """Sender of the newest frame."""
        return sender_of(self.record[0])

    @property
    def size(self) -> int:
        """Length of the newest frame [bytes]."""
        return int(self.record[0]["size"])

    def raise_failure(self, channel: str) -> None:
        """Raise an error that says why the socket is unusable."""
        libzmq.raise_interruption()
        raise NetboardError(f"the {channel} channel failed: {libzmq.last_error()}")

    def close(self) -> None:
        """Release the socket: from now on nothing is received or sent."""
        self.record[0]["socket"] = 0


class Receiver:
    """Receives the single frames of a socket that is mostly empty; to look at it takes a tenth of what pyzmq takes.

    ``socket``: closed with the receiver. ``channel``: its name in an error. ``longest``: size of the longest valid
    frame [bytes].
    """

    def __init__(self, socket: Socket, channel: str, longest: int) -> None:
        self._socket, self._channel, self._path = socket, channel, FastPath(socket)
        self._frame = np.zeros(longest, np.uint8)
        self._receive = machine_code(receive_one, self._path.record, self._frame)

    @property
    def file(self) -> int:
        """File that signals a frame, once the socket has been read until it was empty."""
        return int(self._path.record[0]["file"])

    def receive(self) -> bytes | None:
        """Return the next frame, truncated to the longest valid size, or None if there is none now."""
        size = self._receive(self._path.record, self._frame)
        if size == FAILED:
            self._path.raise_failure(self._channel)
        return None if size < 0 else self._frame[:size].tobytes()

    def close(self) -> None:
        """Close the socket."""
        self._path.close()
        self._socket.close()
