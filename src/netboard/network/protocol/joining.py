"""Messages of every peer and the server: joining, clock probes and leaving.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass
from typing import Literal, get_args

HELLO_FIRST = "it has not joined yet"
"""Refusal of a message before a `Hello`, or from a peer that was removed: the peer then says hello again."""

HELLO_INTERVAL_NS = 500_000_000
"""Time without an answer after which a peer sends `Hello` again [ns]."""

Role = Literal["agent", "display", "logger", "console", "listener", "trigger"]
ROLES: tuple[str, ...] = get_args(Role)
ROLES_WITH_SIDE = ("agent", "display")

KeyRole = Literal["agent", "display", "logger", "console", "listener", "trigger", "station"]
KEY_ROLES_WITH_SIDE = (*ROLES_WITH_SIDE, "station")
"""Roles of keys: those of peers, and the service of a station, which the server's machine connects to."""


def role_and_side(role: str, side: str) -> str:
    """Join a role and a side, as in ``agent.left``."""
    return f"{role}.{side}" if side else role


@dataclass(frozen=True, slots=True)
class Hello:
    """First message of every peer on every two-way channel.

    Attributes
    ----------
    role : str
        ``agent``, ``display``, ``logger``, ``console``, ``listener`` or ``trigger``.
    side : str
        ``left`` or ``right`` for agents and displays, else empty.
    protocol : int
        The sender's `PROTOCOL_VERSION` [1].
    name : str
        Host and process, for people.
    version : str
        Version of the sender's software.
    details : dict of str
        Further information for the recording. Of an agent: ``device`` (backend), ``kind`` (as in `Status.devices`),
        ``maker``, ``model``, ``serial`` and limits; ``policy``, ``policy_sha256`` and ``policy_parameters`` if no
        person moves its stylus, and ``seated`` (``true``) while that is the robot partner of a block: a block of a
        person then waits for the agent's own device. Of a display: ``platform``, Qt's name of what draws it.
    """

    role: str
    side: str
    protocol: int
    name: str
    version: str
    details: dict[str, str]


@dataclass(frozen=True, slots=True)
class Welcome:
    """The server's answer to an accepted `Hello`; sent again to every peer when a block begins.

    Attributes
    ----------
    session : str
        Unique id of this run of the server.
    protocol : int
        The server's `PROTOCOL_VERSION` [1].
    server_ns : int
        Server time when this was sent [ns].
    config : str
        The resolved configuration of the block, as TOML.
    """

    session: str
    protocol: int
    server_ns: int
    config: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """The server's answer to a message that it does not accept.

    Attributes
    ----------
    reason : str
        One sentence for people.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Goodbye:
    """The sender ends its connection deliberately.

    Attributes
    ----------
    reason : str
        One sentence for people.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Ping:
    """The server's clock probe of a peer, a few times a second, on the log and control channels.

    Attributes
    ----------
    sent_ns : int
        Server time when it was sent: t0 of a clock probe [ns].
    """

    sent_ns: int


@dataclass(frozen=True, slots=True)
class Pong:
    """The peer's immediate answer to a `Ping`.

    Attributes
    ----------
    ping_ns : int
        The ping's ``sent_ns`` [ns].
    received_ns : int
        When it was received: t1 of a clock probe [ns].
    sent_ns : int
        When this was sent: t2 of a clock probe [ns].
    """

    ping_ns: int
    received_ns: int
    sent_ns: int
