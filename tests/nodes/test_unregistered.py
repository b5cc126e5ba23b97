"""Peers that flood the motion channel delay no sample and no `Hello`, and are counted completely."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from fake_router import hello
from motion_rig import MotionRig

from netboard.base.tick import TICK
from netboard.network.protocol.control import StatusRequest
from netboard.network.protocol.joining import Refusal, Welcome
from netboard.network.protocol.motion import Stylus
from netboard.network.transport import sockets
from netboard.network.transport.refusal_count import MAX_KINDS
from netboard.nodes.ports.motion_port import MAX_OTHER_FRAMES, OTHER_FRAME_BURST
from netboard.nodes.ports.refusals import REPEAT_INTERVAL_NS, TOO_MANY_MESSAGES
from netboard.nodes.ports.samples import MAX_FRAMES

MS = 1_000_000
A, B = b"agent.left@1", b"agent.right@2"
STYLUS = Stylus(0, 0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.1, 0, 0, 0.0, -1, 0, 0, 0, 0)


@pytest.fixture
def rig() -> Iterator[MotionRig]:
    with sockets.open_context() as context:
        yield MotionRig(context)


def register(rig: MotionRig) -> None:
    rig.router.send_from(A, hello("agent", "left"))
    rig.drain(lambda: 0)
    rig.router.received_by(A)
    rig.port.news.clear()


def newest(rig: MotionRig, now_ns: int) -> int:
    """Number of the newest sample of the left agent."""
    row = np.zeros(1, TICK)
    rig.port.fill(row.view(np.int64), 0, now_ns, 0)
    return int(row["left_seq"][0])


def test_flood_delays_no_sample_and_is_answered_once_and_counted(rig: MotionRig) -> None:
    register(rig)
    flood = 10 * MAX_FRAMES
    for _ in range(flood):
        rig.router.send_from(b"flood", b"\x00")
    rig.router.send_from(A, STYLUS)
    rig.port.drain(lambda: 0, 0)
    assert newest(rig, MS) == 0
    for tick in range(1, 11):
        rig.drain(lambda now=tick * MS: now)
    assert len(rig.router.received_by(b"flood")) == 1
    rig.port.refusals.settle()
    assert {name for name, _ in rig.port.news} == {"refused"}
    totals = {(details["peer"], details["reason"]): int(details["times"]) for _, details in rig.port.news}
    assert totals == {("flood", "1 bytes are no message"): 1, ("strangers", TOO_MANY_MESSAGES): flood - 1}
    assert sum(rig.port.refusals.totals.values()) == flood


def test_unregistered_peer_is_answered_at_intervals_but_hello_always(rig: MotionRig) -> None:
    for message in (StatusRequest(), hello("display", "left"), StatusRequest(), hello("display", "left")):
        rig.router.send_from(b"x", message)
    rig.drain(lambda: 0)
    reasons = ["it has not joined yet", "this is the motion channel, which takes no display"]
    assert rig.router.received_by(b"x") == [Refusal(reason) for reason in reasons]
    rig.router.send_from(b"x", StatusRequest())
    rig.drain(lambda: REPEAT_INTERVAL_NS)
    assert rig.router.received_by(b"x") == [Refusal("it has not joined yet")]


def test_hello_repeated_while_the_server_was_busy_is_no_refusal(rig: MotionRig) -> None:
    for _ in range(100):
        rig.router.send_from(A, hello("agent", "left"))
    for tick in range(100):
        rig.drain(lambda now=tick * MS: now)
    assert isinstance(rig.router.received_by(A)[0], Welcome)
    assert {name for name, _ in rig.port.news} == {"agent_joined"}
    assert not rig.port.refusals.totals


def test_agent_registers_among_any_number_of_unregistered_peers(rig: MotionRig) -> None:
    strangers = [b"stranger %d" % number for number in range(300)]
    for tick in range(1000):
        at = tick * MS
        if tick % 100 == 0:
            for name in strangers:
                rig.router.send_from(name, hello("display", "left"))
                rig.router.send_from(name, STYLUS)
        if tick % 500 == 250:
            rig.router.send_from(A, hello("agent", "left"))
        rig.port.fast.record["simulated_ns"] = at
        rig.port.drain(lambda at=at: at, at)
        rig.port.attend(at, at)
    assert not rig.port.empty
    assert isinstance(rig.router.received_by(A)[0], Welcome)


def test_refusals_name_a_limited_number_of_peers_but_count_all(rig: MotionRig) -> None:
    for number in range(200):
        rig.router.send_from(b"stranger %d" % number, b"\x00")
        rig.drain(lambda now=number * MS: now)
    rig.port.refusals.settle()
    totals = {details["peer"]: int(details["times"]) for _, details in rig.port.news}
    assert len(totals) == MAX_KINDS + 1
    assert sum(totals.values()) == 200


def test_frames_handled_per_call_are_limited(rig: MotionRig) -> None:
    register(rig)
    for seq in range(4 * MAX_OTHER_FRAMES):
        rig.router.send_from(A, replace(STYLUS, seq=seq))
        rig.router.send_from(A, b"\x00")
    numbers = []
    for _ in range(4):
        rig.port.drain(lambda: MS, 0)
        numbers.append(newest(rig, MS) + 1)
    assert numbers == [(tick + 1) * MAX_OTHER_FRAMES // 2 for tick in range(4)]


def test_surplus_messages_of_a_registered_agent_are_refused_and_counted(rig: MotionRig) -> None:
    register(rig)
    for _ in range(2 * OTHER_FRAME_BURST):
        rig.router.send_from(A, hello("agent", "left"))
    for _ in range(2 * OTHER_FRAME_BURST // MAX_OTHER_FRAMES):
        rig.port.drain(lambda: MS, 0)
    assert rig.port.refusals.totals == {TOO_MANY_MESSAGES: OTHER_FRAME_BURST}


def test_long_multipart_message_is_skipped_in_steps(rig: MotionRig) -> None:
    register(rig)
    rig.router.send_from(b"x", *[b""] * 10_000)
    rig.router.send_from(A, STYLUS)
    rounds = 0
    while newest(rig, MS) < 0:
        rig.port.drain(lambda: MS, 0)
        rounds += 1
    assert rounds > 10


def test_message_that_a_role_may_not_send_is_not_unpacked(rig: MotionRig) -> None:
    register(rig)
    rig.router.send_from(A, b"\x97\x1e\xc1")  # a request for records, then invalid bytes
    rig.drain(lambda: 0)
    assert rig.router.received_by(A) == [Refusal("an agent does not send LogRequest")]
