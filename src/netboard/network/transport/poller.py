"""Waiting for sockets without burning a core, and to less than a millisecond.

ZeroMQ's own poll counts in whole milliseconds, a tick. A socket's file descriptor only tells that something has
changed, so what can be read is asked before and after every wait. No frame is read here.
"""

import select
import time
from collections.abc import Iterable

from netboard.network.transport.authenticator import Socket, readable


class Waiter:
    """Waits until any of some sockets can be read."""

    def __init__(self, sockets: Iterable[Socket]) -> None:
        self._sockets = tuple(sockets)
        self._by_file = {socket.fileno(): socket for socket in self._sockets}
        self._files = list(self._by_file)

    def wait(self, timeout: float) -> bool:
        """Wait at most so long [s]; whether there is something to read."""
        until = time.monotonic() + timeout
        changed: Iterable[Socket] = self._sockets
        while True:
            for socket in changed:
                if readable(socket):
                    return True
            left = until - time.monotonic()
            if left <= 0:
                return False
            files = select.select(self._files, (), (), left)[0]
            changed = [self._by_file[file] for file in files]

    def signalled(self, timeout: float) -> list[Socket]:
        """Wait at most so long for any that may be read [s].

        A signal comes only after a socket has been read until nothing is left, and what is done with a socket in
        between may swallow it: whoever waits like this looks at every socket now and then, signalled or not.
        """
        return [self._by_file[file] for file in select.select(self._files, (), (), max(timeout, 0.0))[0]]


def wait_signal(socket: Socket, timeout: float) -> bool:
    """Wait until something may have come, at most so long [s]: quicker than being sure of it."""
    return readable(socket) or bool(select.select((socket.fileno(),), (), (), timeout)[0])


def wait_readable(socket: Socket, timeout: float) -> bool:
    """Wait until a socket can be read, at most so long [s]; for one socket alone, as `Waiter` does."""
    until = time.monotonic() + timeout
    while not readable(socket):
        left = until - time.monotonic()
        if left <= 0:
            return False
        select.select((socket.fileno(),), (), (), left)
    return True
