"""Messages, their bytes, and the rules of a connection. Pure.

Parameters
----------
message : type
    The dataclass of a message that has only numbers.
frame : bytes
    Untrusted input: any bytes from any sender.
form : netboard.network.protocol.fixed.FixedForm
    The fixed form of a message.
role : str
    One of `netboard.network.protocol.joining.ROLES`.
side : str
    ``left`` or ``right``; empty for a role without a side.
kind : str
    Role and side of a peer, as in ``agent.left``.
"""
