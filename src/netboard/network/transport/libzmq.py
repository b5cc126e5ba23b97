"""libzmq's own functions for kernels, in the library that pyzmq has loaded.

On Linux and macOS pyzmq's binding shows them. Its wheels for Windows contain libzmq without showing one of its
functions, so functions of the same names and arguments call pyzmq there, in Python. They take some microseconds more
for each call, and the kernels are the same.
"""

import ctypes
import logging
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, c_char_p, c_int, c_ssize_t, c_void_p
from typing import Any, TypeAlias
from weakref import WeakValueDictionary

import zmq
from llvmlite import binding
from numba import types

from netboard.network.transport.waiting import c_function

log = logging.getLogger(__name__)

Socket: TypeAlias = zmq.Socket[bytes]

_INT, _POINTER = "int", "pointer"

PROTOTYPES: dict[str, tuple[str, ...]] = {
    "zmq_recv": (_INT, _POINTER, _POINTER, _POINTER, _INT),
    "zmq_send": (_INT, _POINTER, _POINTER, _POINTER, _INT),
    "zmq_errno": (_INT,),
    "zmq_msg_init": (_INT, _POINTER),
    "zmq_msg_recv": (_INT, _POINTER, _POINTER, _INT),
    "zmq_msg_data": (_POINTER, _POINTER),
    "zmq_msg_more": (_INT, _POINTER),
    "zmq_msg_gets": (_POINTER, _POINTER, _POINTER),
    "zmq_msg_close": (_INT, _POINTER),
}
"""Functions that kernels call: what they return, and their arguments."""

_FOR_KERNELS = {_INT: types.int32, _POINTER: types.intp}
_FOR_C = {_INT: c_int, _POINTER: c_ssize_t}

TERMINATED = int(zmq.ETERM)
"""Error number that no kernel takes for a passing one."""


class PyzmqFunctions:
    """libzmq's functions, written with pyzmq's; the messages are those of one thread's kernels at a time."""

    def __init__(self) -> None:
        self.trouble: BaseException | None = None  # what interrupted a call, and is to be raised outside of the kernels
        self._sockets: WeakValueDictionary[int, Socket] = WeakValueDictionary()
        self._messages: dict[int, tuple[zmq.Frame, bytes]] = {}
        self._properties: dict[int, bytes] = {}
        self._errno = 0
        self._functions = [self._entry(name) for name in PROTOTYPES]  # alive as long as kernels may call them

    def know(self, socket: Socket) -> None:
        """Let kernels use a socket by its address."""
        self._sockets[int(socket.underlying)] = socket

    def _entry(self, name: str) -> Any:
        """Make a function of a name known to kernels."""
        returns, *takes = (_FOR_C[kind] for kind in PROTOTYPES[name])
        made = CFUNCTYPE(returns, *takes)(self._guarded(getattr(self, name)))
        binding.add_symbol(name, ctypes.cast(made, c_void_p).value)
        return made

    def _guarded(self, function: Callable[..., int]) -> Callable[..., int]:
        """Return a function that raises nothing, because a kernel could not: it fails as libzmq's does."""

        def call(*arguments: int) -> int:
            try:
                return function(*arguments)
            except zmq.ZMQError as error:
                self._errno = error.errno or TERMINATED
            except KeyError:  # a socket that is closed, or 0
                self._errno = int(zmq.ENOTSOCK)
            except BaseException as error:  # noqa: BLE001  (such as Ctrl-C; kept for its caller)
                self.trouble, self._errno = error, TERMINATED
            return -1

        return call

    def zmq_recv(self, socket: int, buffer: int, size: int, flags: int) -> int:
        """Receive a frame into a buffer, truncated to its size; return the frame's size."""
        frame = self._sockets[socket].recv(flags)
        ctypes.memmove(buffer, frame, min(size, len(frame)))
        return len(frame)

    def zmq_send(self, socket: int, buffer: int, size: int, flags: int) -> int:
        """Send a frame from a buffer."""
        self._sockets[socket].send(ctypes.string_at(buffer, size), flags)
        return size

    def zmq_errno(self) -> int:
        """Return the error of the last call that failed."""
        return self._errno

    def zmq_msg_init(self, message: int) -> int:
        """Make an empty message at an address."""
        return self.zmq_msg_close(message)

    def zmq_msg_recv(self, message: int, socket: int, flags: int) -> int:
        """Receive a frame as a message; return its size."""
        frame = self._sockets[socket].recv(flags, copy=False)
        self._messages[message] = frame, frame.bytes
        return len(frame)

    def zmq_msg_data(self, message: int) -> int:
        """Return the address of a message's bytes."""
        return ctypes.cast(c_char_p(self._messages[message][1]), c_void_p).value or 0

    def zmq_msg_more(self, message: int) -> int:
        """Return whether parts of the same message follow."""
        return int(message in self._messages and self._messages[message][0].more)

    def zmq_msg_gets(self, message: int, name: int) -> int:
        """Return the address of a text that describes the message's connection; 0 if there is none."""
        try:
            found = str(self._messages[message][0].get(ctypes.string_at(name).decode())).encode()
        except zmq.ZMQError:
            return 0
        self._properties[name] = found
        return ctypes.cast(c_char_p(found), c_void_p).value or 0

    def zmq_msg_close(self, message: int) -> int:
        """Release a message."""
        self._messages.pop(message, None)
        return 0


def _add_own_symbols() -> bool:
    """Make libzmq's own functions known to kernels; return whether pyzmq's binding shows them."""
    module = sys.modules[zmq.backend.Socket.__module__]
    try:
        library = ctypes.CDLL(str(module.__file__))
        addresses = {name: ctypes.cast(getattr(library, name), c_void_p).value for name in PROTOTYPES}
    except (AttributeError, OSError) as error:
        log.info("pyzmq %s does not show libzmq's functions (%s): frames pass through Python", zmq.__version__, error)
        return False
    for name, address in addresses.items():
        binding.add_symbol(name, address)
    return True


_THROUGH_PYTHON = None if _add_own_symbols() else PyzmqFunctions()


def function(name: str) -> Any:
    """Return one of the functions as kernels call it; addresses are integers."""
    returns, *takes = (_FOR_KERNELS[kind] for kind in PROTOTYPES[name])
    return c_function(name, returns, *takes)


def address_of(socket: Socket) -> int:
    """Return the address by which kernels use a socket."""
    if _THROUGH_PYTHON is not None:
        _THROUGH_PYTHON.know(socket)
    return int(socket.underlying)


def raise_interruption() -> None:
    """Raise what interrupted a call from a kernel, if anything did."""
    if _THROUGH_PYTHON is not None and _THROUGH_PYTHON.trouble is not None:
        trouble, _THROUGH_PYTHON.trouble = _THROUGH_PYTHON.trouble, None
        raise trouble


def last_error() -> str:
    """Return why the last call failed, in words."""
    return str(zmq.strerror(zmq.zmq_errno() if _THROUGH_PYTHON is None else _THROUGH_PYTHON.zmq_errno()))
