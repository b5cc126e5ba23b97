"""The channels between the processes: which there are, and where.

Each has a port of the server's, counted from the first; on one machine they can be sockets of the file system instead.
What stays within a station, whatever the transport, is here as well. How a channel behaves is in
`netboard.network.transport.sockets`.
"""

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from netboard.base.config import Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.tables.rig import Network
from netboard.network.transport.authenticator import Credentials, Door

MOTION, LOG, VIEW_LEFT, VIEW_RIGHT, CONTROL, NERVE = range(6)
"""Channels: TCP port = network.port + channel."""

CHANNELS = ("motion", "log", "view.left", "view.right", "control", "nerve")
"""Their names."""

VIEW: dict[Side, int] = {"left": VIEW_LEFT, "right": VIEW_RIGHT}
"""Channel of each station's views."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a channel is bound or connected to.

    Attributes
    ----------
    lock : Door or Credentials or None
        The door that is bound there, or the keys to come in with; None where nothing is encrypted.
    """

    address: str
    channel: int = MOTION
    lock: Door | Credentials | None = None


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where the channels are.

    Attributes
    ----------
    lock : Door or Credentials or None
        At the server its door, at a peer its keys; None where nothing is encrypted.
    """

    host: str
    bind: str
    port: int
    transport: str = "tcp"
    lock: Door | Credentials | None = None

    def listen(self, channel: int) -> Endpoint:
        """Endpoint the server binds for a channel."""
        return self._endpoint(self.bind, channel)

    def reach(self, channel: int) -> Endpoint:
        """Endpoint a peer connects to for a channel."""
        return self._endpoint(self.host, channel)

    def pointer(self, side: Side) -> Endpoint:
        """Endpoint at which the agent of a side hears where its player points."""
        return self._beside("pointer", side)

    def felt(self, side: Side) -> Endpoint:
        """Endpoint at which the agent of a side says what its player would feel."""
        return self._beside("felt", side)

    def _beside(self, what: str, side: Side) -> Endpoint:
        """What display and agent of one side say to each other stays on the machine, and with its user.

        It is a socket of the file system whatever the transport: it takes no port, and nobody else who uses the
        machine can move a hand or see its force.
        """
        return Endpoint(f"ipc://{_own_folder() / f'{self.port}.{what}.{side}'}")

    def _endpoint(self, machine: str, channel: int) -> Endpoint:
        """The nerve does not leave the machine: who has two hands has them at one station."""
        port = self.port + channel
        inside = channel == NERVE
        if self.transport == "ipc":
            return Endpoint(f"ipc://{_own_folder() / str(port)}", channel, None if inside else self.lock)
        if inside:
            return Endpoint(f"tcp://127.0.0.1:{port}", channel)
        return Endpoint(f"tcp://{machine}:{port}", channel, self.lock)


def addresses(network: Network, lock: Door | Credentials | None = None) -> Addresses:
    """Take the addresses from the configuration."""
    return Addresses(network.host, network.bind, network.port, network.transport, lock)


def _own_folder() -> Path:
    """Where sockets of the file system are: a folder that is this user's alone.

    The same for every process of the user, whatever its environment.
    """
    if not hasattr(os, "getuid"):
        raise ConfigError(
            'this system has no sockets in its file system, which [network] transport = "ipc" needs, and '
            'device = "mouse"; expected "tcp", and another device'
        )
    folder = Path(f"/tmp/netboard-{os.getuid()}")
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) != 0o700:
        raise NetboardError(f"{folder}: is not a folder of this user alone (mode 0700); remove it")
    return folder
