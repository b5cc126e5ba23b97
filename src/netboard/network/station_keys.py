"""The keys of a station's service. The server's machine connects to it, so that the roles are reversed.

The service has the key of its station (``station.left.key``) and admits exactly one other: that of the rig's server,
whose public key is in the same file. The server's machine takes the station's public key from its list of peers. There
is no mode without keys.
"""

from pathlib import Path

from netboard.base.config import Side
from netboard.base.errors import ConfigError
from netboard.network import keys
from netboard.network.protocol.joining import role_and_side
from netboard.network.transport import authenticator

STATION = "station"


class StationRing:
    """The key of a station, and the only one that it admits; see `authenticator.KnownKeys`."""

    def __init__(self, folder: Path, side: Side) -> None:
        found = keys.credentials(folder, role_and_side(STATION, side))
        self.secret, self._server = found.secret, found.server

    def channel_refusal(self, key: str, channel: str) -> str:
        """Return why a key may not open the station's socket; empty if it may."""
        return "" if key == self._server else f"its key is not that of the server of this {channel}"

    def role_refusal(self, key: str, role: str, side: str) -> str:
        """Return why the owner of a key may not act as the server; empty if it may."""
        wanted = (role, side) == (keys.SERVER, "")
        return self.channel_refusal(key, STATION) if wanted else f"the key of the server is not that of {role} {side}"

    def owner(self, key: str) -> str:
        """Return whose key it is; empty if it is unknown."""
        return keys.SERVER if key == self._server else ""

    def fingerprint(self, key: str) -> str:
        """Return the fingerprint of a public key."""
        return keys.fingerprint(key)


def credentials_for(folder: Path, side: Side) -> authenticator.Credentials:
    """Return the keys with which the server's machine connects to a station."""
    secret = keys.KeyRing(folder).secret
    known = [peer for peer in keys.read_list(folder) if (peer.role, peer.side) == (STATION, side)]
    valid = [peer for peer in known if peer.revoked is None]
    if not valid:
        raise ConfigError(
            f"{folder / keys.LIST}: there is no valid key of the {side} station; create it with: "
            f"netboard keys add station {side} --to for-{side}, and bring it there"
        )
    return authenticator.Credentials(authenticator.public_of(secret), secret, valid[-1].public)
