"""The channels between the processes, and their addresses.

Each has one of the server's ports, counted from the first; on one machine they can be Unix domain sockets instead.
`netboard.network.transport.sockets` defines how each channel behaves.
"""

from dataclasses import dataclass

from netboard.base.config import Side
from netboard.base.tables.rig import Network
from netboard.network.transport.authenticator import Authenticator, Credentials, SharedKey
from netboard.network.transport.local_endpoints import local_endpoints

MOTION, LOG, VIEW_LEFT, VIEW_RIGHT, CONTROL, MOVES, PARTNER_LEFT, PARTNER_RIGHT = range(8)
"""Channels: TCP port = network.port + channel."""

CHANNELS = ("motion", "log", "view.left", "view.right", "control", "moves", "partner.left", "partner.right")
"""Their names."""

STATION = len(CHANNELS)
"""Socket of a station's service; it is at the station, and no channel of the server."""

NAMES = (*CHANNELS, "station")
"""Names of all authenticated sockets."""

VIEW: dict[Side, int] = {"left": VIEW_LEFT, "right": VIEW_RIGHT}
"""Channel of each station's views."""

PARTNER: dict[Side, int] = {"left": PARTNER_LEFT, "right": PARTNER_RIGHT}
"""Channel of the views of a block's robot partner at each side; the display of that side sees none of them."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """The address to which a channel is bound or connected."""

    address: str
    channel: int = MOTION
    # The server's authenticator, a peer's keys, or the key of both ends; None without encryption.
    security: Authenticator | Credentials | SharedKey | None = None


@dataclass(frozen=True, slots=True)
class Addresses:
    """The addresses of the channels."""

    host: str
    bind: str
    port: int
    transport: str = "tcp"
    # The server's authenticator, or a peer's keys; None without encryption.
    security: Authenticator | Credentials | None = None

    def listen(self, channel: int) -> Endpoint:
        """Return the endpoint that the server binds for a channel."""
        return self._endpoint(self.bind, channel)

    def reach(self, channel: int) -> Endpoint:
        """Return the endpoint to which a peer connects for a channel."""
        return self._endpoint(self.host, channel)

    def pointer(self, side: Side) -> Endpoint:
        """Return the endpoint at which a side's agent receives the pointer's position."""
        return self._at_station("pointer", side)

    def felt(self, side: Side) -> Endpoint:
        """Return the endpoint at which a side's agent publishes the force on its player's hand."""
        return self._at_station("felt", side)

    def _at_station(self, purpose: str, side: Side) -> Endpoint:
        """Return an endpoint between the display and the agent of one side.

        It stays on the machine whatever the transport, and no other user of the machine can move a hand or see its
        force.
        """
        local = local_endpoints.at_station(self.port, f"{purpose}.{side}", len(CHANNELS))
        return Endpoint(local.address, security=local.key)

    def _endpoint(self, machine: str, channel: int) -> Endpoint:
        """Return an endpoint; the channel for moves stays on the machine, because both hands are at one station."""
        port = self.port + channel
        local = channel == MOVES
        if self.transport == "ipc":
            return Endpoint(local_endpoints.channel(port).address, channel, None if local else self.security)
        if local:
            return Endpoint(f"tcp://127.0.0.1:{port}", channel)
        return Endpoint(_tcp(machine, port), channel, self.security)


def station_endpoint(host: str, port: int, security: Authenticator | Credentials) -> Endpoint:
    """Return the endpoint of a station's service, which always requires keys."""
    return Endpoint(_tcp(host, port), STATION, security)


def _tcp(machine: str, port: int) -> str:
    host = machine.strip("[]")
    return f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}"


def addresses(network: Network, security: Authenticator | Credentials | None = None) -> Addresses:
    """Take the addresses from the configuration."""
    return Addresses(network.host, network.bind, network.port, network.transport, security)
