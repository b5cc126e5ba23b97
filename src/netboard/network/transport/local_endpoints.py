"""Endpoints that stay on one machine, and that no other user of it can open.

POSIX: Unix domain sockets in a folder of this user. Windows, whose pyzmq has none: TCP on the loopback address, beyond
the ports of the server, with a key that is in a file of this user. Both ends have the same key: a peer that does not
know it can neither open the socket, nor pass for the process that bound it.
"""

import os
import secrets
import socket as net
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from netboard.base.errors import ConfigError, NetboardError
from netboard.base.files.new import write_synced
from netboard.base.system.ownership import PRIVATE_FILE, user_folder, why_open
from netboard.network.transport.authenticator import SharedKey, new_keys, public_of

NAMES = ("pointer.left", "pointer.right", "felt.left", "felt.right")
"""Endpoints between a display and an agent of one station."""

KEY_FILE = "local.key"
UNIX = "ipc://"


@dataclass(frozen=True, slots=True)
class Local:
    """An address, and the key that both of its ends have; None where the file system guards it."""

    address: str
    key: SharedKey | None = None


class LocalEndpoints(Protocol):
    """One kind of system's endpoints. ``port``: the first port of the server, which tells sessions apart."""

    ports: int
    """TCP ports that they take behind those of the server [1]."""

    def at_station(self, port: int, name: str, after: int) -> Local:
        """Return one of the `NAMES`. ``after``: how many ports the server has."""

    def channel(self, port: int) -> Local:
        """Return the endpoint in place of a port of the server, for ``transport = "ipc"``."""

    def is_taken(self, address: str) -> bool:
        """Return whether somebody listens at an address that libzmq would take over silently."""


class UnixSockets:
    """Sockets in the file system. ``folder``: that of this user."""

    ports: int = 0

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    def at_station(self, port: int, name: str, after: int) -> Local:
        """Return a file with the name."""
        return self._file(f"{port}.{name}")

    def channel(self, port: int) -> Local:
        """Return a file with the port's number."""
        return self._file(str(port))

    def _file(self, name: str) -> Local:
        return Local(f"{UNIX}{(self._folder or user_folder()) / name}")

    def is_taken(self, address: str) -> bool:
        """Try to connect."""
        if not address.startswith(UNIX):
            return False
        with net.socket(getattr(net, "AF_UNIX")) as probe:  # noqa: B009
            try:
                probe.connect(address.removeprefix(UNIX))
            except (FileNotFoundError, ConnectionRefusedError):
                return False
        return True


class KeyedLoopback:
    """TCP ports of the loopback address, with the key of this user. ``folder``: that of this user."""

    ports: int = len(NAMES)

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    def at_station(self, port: int, name: str, after: int) -> Local:
        """Return the port of a name, behind those of the server and the one that holds them together."""
        key = user_key(self._folder or user_folder())
        return Local(f"tcp://127.0.0.1:{port + after + 1 + NAMES.index(name)}", key)

    def channel(self, port: int) -> Local:
        """Refuse: a channel has its TCP port."""
        raise ConfigError(
            'this system has no Unix domain sockets, which [network] transport = "ipc" needs; expected "tcp"'
        )

    def is_taken(self, address: str) -> bool:
        """Return False: binding a port that is taken fails."""
        return False


def user_key(folder: Path) -> SharedKey:
    """Return the key of this user's local endpoints, made at first use; the first of several processes makes it."""
    path = folder / KEY_FILE
    if not path.exists():
        part = folder / f".{KEY_FILE}.{secrets.token_hex(8)}"
        try:
            part.touch(mode=PRIVATE_FILE)
            write_synced(part, new_keys()[1])
            with suppress(FileExistsError):
                os.link(part, path)
        finally:
            part.unlink(missing_ok=True)
    if why := why_open(path):
        raise NetboardError(f"{path}: {why}")
    secret = path.read_text(encoding="utf-8").strip()
    try:
        return SharedKey(public_of(secret), secret)
    except ValueError:
        raise NetboardError(f"{path}: is not a key; remove it, and another one is made") from None


def set_exclusive(socket: net.socket) -> None:
    """Let a socket be bound as libzmq does: connections of a server that has just ended do not count, others do.

    On Windows, SO_REUSEADDR would also take a port from a server that listens there.
    """
    if sys.platform == "win32":
        socket.setsockopt(net.SOL_SOCKET, getattr(net, "SO_EXCLUSIVEADDRUSE"), 1)  # noqa: B009
    else:
        socket.setsockopt(net.SOL_SOCKET, net.SO_REUSEADDR, 1)


local_endpoints: LocalEndpoints = KeyedLoopback() if sys.platform == "win32" else UnixSockets()
