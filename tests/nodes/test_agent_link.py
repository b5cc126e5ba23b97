"""The agent's end of the motion channel: which messages count as new."""

from collections.abc import Iterator
from dataclasses import astuple, replace

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.devices.contract.device import Reading
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_FIRST, HELLO_INTERVAL_NS, Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point
from netboard.network.transport import channels, sockets
from netboard.nodes.agent.motion_link import (
    REFUSAL_GAP_NS,
    REFUSED_NS,
    REMEMBERED,
    UNANSWERED_NS,
    MotionLink,
)
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES

TIMEOUT_NS = 10_000_000_000
"""Far longer than any stall of the machine [ns]."""
HELLO = Hello("agent", "left", PROTOCOL_VERSION, "here:1", "0", {})


class Pair:
    """A link, and the server's end of it."""

    def __init__(self, context: sockets.Context) -> None:
        endpoint = channels.Endpoint("inproc://motion")
        self.router = sockets.motion_server(context, endpoint)
        self.link = MotionLink(sockets.motion_agent(context, endpoint, "agent"), HELLO, TIMEOUT_NS)
        self.link.warm()
        self.send(0, now_ns())
        received = self.router.receive()
        assert received is not None
        self.agent, frame = received
        assert decode(frame) == HELLO
        self.deliver(Welcome("session", PROTOCOL_VERSION, 0, ""))

    def send(self, seq: int, stamp_ns: int) -> None:
        """Send a sample of a stylus at rest."""
        self.link.send(seq, Reading(stamp_ns, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True), 0, 0.0)

    def deliver(self, message: Message) -> bool:
        """Send a message from the server, and return whether the link accepts it."""
        assert self.router.send(self.agent, encode(message))
        return self.link.receive()


@pytest.fixture
def pair() -> Iterator[Pair]:
    with sockets.open_context() as context:
        yield Pair(context)


def force(tick: int, seq: int) -> Force:
    return Force(tick, 0, seq, 1.0, 0)


def test_answer_to_a_recent_sample_is_fresh(pair: Pair) -> None:
    pair.send(1, now_ns())
    assert pair.deliver(force(1, 1))
    assert pair.link.newest == force(1, 1)
    assert pair.link.received_ns == pair.link.answer_ns > 0


def test_silence_of_the_server_is_reported_once_and_its_end_too(pair: Pair, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    pair.send(1, now_ns())
    assert pair.deliver(force(1, 1))
    later = now_ns() + 2 * HELLO_INTERVAL_NS
    for k in range(3):
        pair.send(2 + k, later + k * HELLO_INTERVAL_NS)
    assert caplog.messages == ["the server has been silent for 0.5 s: waiting for it"]
    pair.link._hello_ns = 0
    assert pair.deliver(force(2, 4))
    pair.send(5, now_ns())
    assert caplog.messages[1:] == ["the server answers again"]


def test_server_that_never_answers_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    with sockets.open_context() as context:
        link = MotionLink(
            sockets.motion_agent(context, channels.Endpoint("inproc://nobody"), "agent"), HELLO, TIMEOUT_NS
        )
        link.warm()
        for seq in range(60):
            stamp_ns = UNANSWERED_NS + seq * HELLO_INTERVAL_NS
            link.send(seq, Reading(stamp_ns, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True), 0, 0.0)
            assert len(caplog.messages) == (stamp_ns >= 2 * UNANSWERED_NS)
        link.leave("the test is over")
    assert caplog.messages[0].startswith(
        "no answer from the server for 10 s. If it runs: check [network] host and port"
    )


def test_server_that_has_answered_once_may_be_away(pair: Pair, caplog: pytest.LogCaptureFixture) -> None:
    assert not pair.deliver(Goodbye("the session is over"))
    later = now_ns()
    for k in range(60):
        pair.send(1 + k, later + k * HELLO_INTERVAL_NS)
    assert not caplog.messages


def test_answer_to_an_old_sample_is_received_but_not_fresh(pair: Pair) -> None:
    pair.send(1, now_ns() - TIMEOUT_NS)
    assert pair.deliver(force(1, 1))
    assert pair.link.newest == force(1, 1)
    assert pair.link.answer_ns > 0
    assert pair.link.received_ns is None


def test_answer_to_a_forgotten_sample_is_not_fresh(pair: Pair) -> None:
    pair.send(REMEMBERED + 1, now_ns())
    assert pair.deliver(force(1, 1))
    assert pair.link.received_ns is None


def test_point_is_accepted_like_a_force_in_either_encoding(pair: Pair) -> None:
    pair.send(1, now_ns() - 5_000_000)
    point = Point(1, 0, 1, 7, 0.01, -0.5, 200.0, 2.0, 300_000)
    assert pair.deliver(point)
    assert pair.link.newest == point
    assert pair.link.received_ns is not None
    pair.link.rendered(now_ns())
    assert pair.link.loop_ns >= 5_000_000
    words, frame = np.zeros(len(fixed.POINT.markers), np.int64), np.zeros(fixed.POINT.size, np.uint8)
    words.view(np.dtype(fixed.fields_of(Point)))[0] = astuple(replace(point, tick=2))
    fixed.write(frame, fixed.POINT, words)
    assert pair.router.send(pair.agent, frame.tobytes())
    assert pair.link.receive()
    assert pair.link.newest == replace(point, tick=2)


def test_heartbeat_without_a_sample_is_fresh(pair: Pair) -> None:
    assert pair.deliver(Heartbeat(1, 0, -1, 0, True))
    assert pair.link.received_ns is not None


def test_older_force_is_ignored(pair: Pair) -> None:
    pair.send(1, now_ns())
    assert pair.deliver(force(2, 1))
    assert not pair.deliver(force(1, 1))
    assert pair.link.newest == force(2, 1)


def test_welcome_of_another_session_resets_the_link(pair: Pair) -> None:
    pair.send(1, now_ns())
    assert pair.deliver(force(5, 1))
    assert not pair.deliver(Welcome("another session", PROTOCOL_VERSION, 0, ""))
    assert pair.link.newest is None
    assert pair.deliver(force(1, 1))


def test_empty_frame_is_ignored(pair: Pair) -> None:
    pair.send(1, now_ns())
    assert pair.deliver(force(1, 1))
    assert pair.router.send(pair.agent, b"")
    assert not pair.link.receive()
    assert pair.link.newest == force(1, 1)


def test_agent_that_the_server_has_forgotten_sends_no_samples_until_it_is_welcomed(pair: Pair) -> None:
    pair.send(1, now_ns())
    assert pair.router.receive() is not None
    assert pair.deliver(force(5, 1))
    assert not pair.deliver(Refusal(HELLO_FIRST))
    pair.send(2, now_ns())
    assert pair.router.receive() is None
    assert not pair.deliver(force(6, 1))
    assert not pair.deliver(Welcome("session", PROTOCOL_VERSION, 0, ""))
    pair.send(3, now_ns())
    assert pair.router.receive() is not None
    assert pair.deliver(force(7, 3))


@pytest.mark.parametrize("parting", [Goodbye("the session is over"), Refusal(HELLO_FIRST)])
def test_agent_that_has_left_the_session_may_not_arm_its_device(pair: Pair, parting: Message) -> None:
    pair.send(1, now_ns())
    assert pair.router.receive() is not None
    assert pair.deliver(Heartbeat(5, 0, 1, 0, True))
    assert pair.link.may_arm
    assert not pair.deliver(parting)
    assert not pair.link.may_arm
    assert pair.link.newest is None


def test_agent_gives_up_after_a_refusal_that_lasts(pair: Pair) -> None:
    link, why = pair.link, "the left side already has an agent: lab0:7"
    link._set_session("")
    link._take_refusal(why, 0)
    link._take_refusal(why, REFUSED_NS - 1)  # the gap before it was too long: it counts from here
    assert link.refusal == ""
    for at in range(REFUSED_NS, 2 * REFUSED_NS + 1, REFUSAL_GAP_NS // 2):
        link._take_refusal(why, at)
    assert link.refusal == why


@pytest.mark.parametrize("reason", [TOO_MANY_MESSAGES, "the left side already has an agent: lab0:7"])
def test_agent_that_joins_or_sends_too_much_does_not_give_up(pair: Pair, reason: str) -> None:
    joined = reason != TOO_MANY_MESSAGES
    pair.link._set_session("session" if joined else "")
    for at in range(0, 2 * REFUSED_NS, REFUSAL_GAP_NS // 2):
        pair.link._take_refusal(reason, at)
    assert pair.link.refusal == ""
