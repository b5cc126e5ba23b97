"""Admission of a peer: whether its `Hello` can be accepted."""

from netboard.base.errors import WireError
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION

_SEATED = ("agent", "display")


def admit(hello: Hello) -> str:
    """Check a `Hello` and name its sender.

    Parameters
    ----------
    hello : Hello
        The peer's message.

    Returns
    -------
    str
        Role and side: ``agent.left``, ``display.right``, ``logger``, ``console``, ``listener``.

    Raises
    ------
    WireError
        If its protocol version differs, or its side does not fit its role. The text says which, and is fit for a
        `Refusal`.
    """
    if hello.protocol != PROTOCOL_VERSION:
        raise WireError(f"the server speaks protocol {PROTOCOL_VERSION}, the {hello.role} {hello.protocol}")
    if (hello.role in _SEATED) != bool(hello.side):
        wanted = "left or right" if hello.role in _SEATED else "no side"
        raise WireError(f"{hello.role} with side {hello.side!r}: expected {wanted}")
    return f"{hello.role}.{hello.side}" if hello.side else hello.role
