"""Which peers are admitted."""

import dataclasses

import pytest

from netboard.base.errors import WireError
from netboard.network.protocol.admission import admit
from netboard.network.protocol.joining import Hello
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
def test_peers_are_named(role: str, side: str, name: str) -> None:
    assert admit(dataclasses.replace(HELLO, role=role, side=side)) == name


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"protocol": PROTOCOL_VERSION + 1},
            f"the server speaks protocol {PROTOCOL_VERSION}, the agent {PROTOCOL_VERSION + 1}",
        ),
        ({"side": ""}, "agent with side '': expected left or right"),
        ({"role": "display", "side": ""}, "display with side '': expected left or right"),
        ({"role": "logger"}, "logger with side 'left': expected no side"),
    ],
)
def test_who_is_not_admitted_is_told_why(change: dict[str, str | int], says: str) -> None:
    with pytest.raises(WireError, match=f"^{says}$"):
        admit(dataclasses.replace(HELLO, **change))  # type: ignore[arg-type]
