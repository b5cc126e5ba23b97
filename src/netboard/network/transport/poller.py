"""Waiting for sockets with a resolution below a millisecond, without busy polling.

ZeroMQ's own poll counts in whole milliseconds, which is a tick. A socket's file descriptor only signals that something
has changed, so a `Waiter` checks whether the socket is readable before and after every wait. It reads no frame.
"""

import select
from collections.abc import Iterable

from netboard.base.system.monotonic import monotonic_ns
from netboard.network.transport.authenticator import Socket, readable


class Waiter:
    """Waits until any of several sockets, or another file, can be read. ``others``: numbers of such files."""

    def __init__(self, sockets: Iterable[Socket]) -> None:
        self.others: tuple[int, ...] = ()
        self._sockets = tuple(sockets)
        self._by_file = {socket.fileno(): socket for socket in self._sockets}
        self._files = list(self._by_file)

    def wait(self, timeout: float) -> bool:
        """Wait until the timeout [s]; return whether there is something to read."""
        until_ns = monotonic_ns() + round(timeout * 1e9)
        changed: Iterable[Socket] = self._sockets
        while True:
            for socket in changed:
                if readable(socket):
                    return True
            left = (until_ns - monotonic_ns()) * 1e-9
            if left <= 0:
                return False
            files = select.select([*self._files, *self.others], (), (), left)[0]
            if not set(self.others).isdisjoint(files):
                return True
            changed = [self._by_file[file] for file in files]


def wait_readable(socket: Socket, timeout: float) -> bool:
    """Wait until a socket can be read, or until the timeout [s]; `Waiter` does this for several."""
    return Waiter((socket,)).wait(timeout)
