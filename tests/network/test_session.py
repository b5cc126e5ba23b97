"""Who is admitted, what is missing, who is silent."""

import dataclasses
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wire_link import Link

from netboard.base.errors import WireError
from netboard.network.protocol.admission import NEVER_NS, Liveness, SequenceGuard, admit
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


def test_a_stream_in_order() -> None:
    guard = SequenceGuard()
    assert guard.newest == -1
    assert all(guard.fresh(seq) for seq in range(5))
    assert (guard.newest, guard.taken, guard.stale, guard.missing) == (4, 5, 0, 0)


def test_gaps_repeats_and_latecomers() -> None:
    guard = SequenceGuard()
    assert [guard.fresh(seq) for seq in (100, 101, 101, 104, 103, 105)] == [True, True, False, True, False, True]
    assert (guard.newest, guard.taken, guard.stale, guard.missing) == (105, 4, 2, 2)


@given(
    st.integers(0, 2**32),
    st.floats(0, 0.5),
    st.floats(0, 0.5),
    st.floats(0, 0.5),
    st.integers(0, 100),
)
def test_a_bad_link_is_accounted_for(seed: int, drop: float, repeat: float, overtake: float, start: int) -> None:
    chance = random.Random(seed)
    link: Link[int] = Link(chance, drop, repeat, overtake)
    guard = SequenceGuard()
    arrived, taken = 0, []
    for seq in range(start, start + 100):
        link.send(seq)
        while chance.random() < 0.6 and (got := link.receive()) is not None:
            arrived += 1
            if guard.fresh(got):
                taken.append(got)
    assert taken == sorted(set(taken))
    assert arrived == guard.taken + guard.stale
    assert guard.taken == len(taken)
    if taken:
        assert guard.newest == taken[-1]
        assert guard.newest - taken[0] + 1 == guard.taken + guard.missing


def test_silence() -> None:
    peer = Liveness(timeout_ns=500)
    assert peer.gone(0)
    assert peer.age_ns(0) == NEVER_NS
    peer.hear(1000)
    assert peer.age_ns(1400) == 400
    assert not peer.gone(1500)
    assert peer.gone(1501)
    peer.hear(1501)
    assert not peer.gone(1501)
