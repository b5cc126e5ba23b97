"""Admission of peers: names of admitted peers, reasons for refusal."""

import dataclasses

import pytest

from netboard.base.errors import WireError
from netboard.network.protocol.admission import admit
from netboard.network.protocol.joining import ROLES, Hello, role_and_side
from netboard.network.protocol.messages import PROTOCOL_VERSION

HELLO = Hello("agent", "left", PROTOCOL_VERSION, "lab-pc-1", "0.1.0", {})


@pytest.mark.parametrize(
    ("role", "side", "name"),
    [
        ("agent", "left", "agent.left"),
        ("agent", "right", "agent.right"),
        ("display", "right", "display.right"),
        ("logger", "", "logger"),
        ("console", "", "console"),
    ],
)
def test_admitted_peer_is_named_by_role_and_side(role: str, side: str, name: str) -> None:
    hello = dataclasses.replace(HELLO, role=role, side=side)
    admit(hello, "motion", ROLES)
    assert role_and_side(hello.role, hello.side) == name


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            {"protocol": PROTOCOL_VERSION + 1},
            f"the server speaks protocol {PROTOCOL_VERSION}, the agent {PROTOCOL_VERSION + 1}",
        ),
        ({"side": ""}, "agent with side '': expected left or right"),
        ({"role": "display", "side": ""}, "display with side '': expected left or right"),
        ({"role": "logger"}, "logger with side 'left': expected no side"),
        ({"role": "display"}, "this is the motion channel, which takes no display"),
    ],
)
def test_refused_peer_gets_the_reason(change: dict[str, str | int], reason: str) -> None:
    with pytest.raises(WireError, match=f"^{reason}$"):
        admit(dataclasses.replace(HELLO, **change), "motion", ("agent",))  # type: ignore[arg-type]
