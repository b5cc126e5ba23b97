"""Admission of a peer: whether its `Hello` can be accepted."""

from collections.abc import Collection

from netboard.base.errors import WireError
from netboard.network.protocol.joining import ROLES_WITH_SIDE, Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION


def admit(hello: Hello, channel: str, roles: Collection[str]) -> None:
    """Check a `Hello`.

    Parameters
    ----------
    hello : Hello
        First message of a peer that is not registered yet.
    channel : str
        Channel on which it came: one of `netboard.network.transport.channels.CHANNELS`.
    roles : collection of str
        Roles of the peers that belong on this channel.

    Raises
    ------
    WireError
        If its protocol version differs, its side does not fit its role, or its role does not belong on the channel.
        The text says which, and is fit for a `Refusal`.
    """
    if hello.protocol != PROTOCOL_VERSION:
        raise WireError(f"the server speaks protocol {PROTOCOL_VERSION}, the {hello.role} {hello.protocol}")
    if (hello.role in ROLES_WITH_SIDE) != bool(hello.side):
        wanted = "left or right" if hello.role in ROLES_WITH_SIDE else "no side"
        raise WireError(f"{hello.role} with side {hello.side!r}: expected {wanted}")
    if hello.role not in roles:
        raise WireError(f"this is the {channel} channel, which takes no {hello.role}")
