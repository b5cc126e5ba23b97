"""The fast path: what libzmq's own functions do with real sockets, called from kernels."""

from collections.abc import Iterator

import numpy as np
import pytest
import zmq

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.network.transport import channels, fastpath, sockets
from netboard.network.transport.fastpath import FAILED, NOT_SENT, NOTHING, OTHER, SENT, FastPath

A, B = b"agent.left@1", b"\xff" * fastpath.NAME_ROOM
HERE = channels.Endpoint("inproc://fast")


class Road:
    """A router and its fast path, and the dealers at the other end, with theirs."""

    def __init__(self, context: sockets.Context) -> None:
        self.context = context
        self.router = sockets.motion_server(context, HERE)
        self.fast = FastPath(self.router.socket)
        self.frame = np.zeros(64, np.uint8)
        self.dealers = {name: self.dealer(name) for name in (A, B)}
        self.fast.know(1, A, "")

    def dealer(self, name: bytes) -> sockets.Socket:
        socket = self.context.socket(zmq.DEALER)
        socket.setsockopt(zmq.IDENTITY, name)
        socket.connect(HERE.address)
        return socket

    def receive(self) -> tuple[int, bytes]:
        place = fastpath.receive(self.fast.record, self.frame)
        return place, self.frame[: self.fast.size].tobytes()


@pytest.fixture
def road() -> Iterator[Road]:
    with sockets.open_context() as context:
        yield Road(context)


def bytes_of(frame: bytes) -> np.ndarray:
    return np.frombuffer(frame, np.uint8)


def test_a_frame_of_a_known_peer_comes_with_its_place_and_any_other_with_its_name(road: Road) -> None:
    road.dealers[A].send(b"one")
    road.dealers[B].send(b"other")
    road.dealers[A].send(b"")
    assert sorted([road.receive(), road.receive(), road.receive()]) == [(OTHER, b"other"), (1, b""), (1, b"one")]
    assert road.receive()[0] == NOTHING
    road.dealers[B].send(b"again")
    assert road.receive() == (OTHER, b"again")
    assert road.fast.sender == (B, "", "")


def test_a_peer_that_is_forgotten_is_a_stranger(road: Road) -> None:
    road.fast.know(0, B, "")
    road.fast.forget(1)
    for name in (A, B):
        road.dealers[name].send(name[:3])
    assert sorted([road.receive(), road.receive()]) == [(OTHER, b"age"), (0, b"\xff\xff\xff")]


@pytest.mark.parametrize("parts", [(b"one", b"two"), (b"", b"two", b"three"), (b"x" * 65,), (b"x" * 4000, b"y")])
def test_what_is_not_one_frame_or_too_long_is_empty_and_leaves_nothing_behind(
    road: Road, parts: tuple[bytes, ...]
) -> None:
    road.dealers[A].send_multipart(parts)
    road.dealers[A].send(b"next")
    assert road.receive() == (1, b"")
    assert road.receive() == (1, b"next")
    assert road.receive()[0] == NOTHING


def test_a_frame_of_just_the_room_is_whole(road: Road) -> None:
    road.dealers[A].send(bytes(range(64)))
    assert road.receive() == (1, bytes(range(64)))


def test_what_is_sent_arrives_and_what_cannot_be_is_told(road: Road) -> None:
    record = road.fast.record
    road.fast.know(0, b"nobody", "")
    assert fastpath.send_to(record, 0, bytes_of(b"force")) == NOT_SENT
    road.dealers[A].send(b"here")
    road.receive()
    assert fastpath.send_to(record, 1, bytes_of(b"force")) == SENT
    assert sockets.receive(road.dealers[A]) == b"force"
    sent = [fastpath.send_to(record, 1, bytes_of(b"%d" % number)) for number in range(5000)]
    assert sent[0] == SENT
    assert sent[-1] == NOT_SENT  # its queue is full
    heard = []
    while (frame := sockets.receive(road.dealers[A])) is not None:
        heard.append(frame)
    assert heard == [b"%d" % number for number in range(sent.index(NOT_SENT))]


def test_a_dealer_hears_and_says(road: Road) -> None:
    fast = FastPath(road.dealers[A])
    assert fastpath.receive_one(fast.record, road.frame) == NOTHING
    assert fastpath.send_one(fast.record, bytes_of(b"sample")) == SENT
    assert road.receive() == (1, b"sample")
    for frame in (b"", b"force", b"z" * 100):
        assert road.router.send(A, frame)
    assert fastpath.receive_one(fast.record, road.frame) == 0
    assert fastpath.receive_one(fast.record, road.frame) == 5
    assert road.frame[:5].tobytes() == b"force"
    assert fastpath.receive_one(fast.record, road.frame) == 64  # the rest is cut off


def test_a_dealer_that_has_nobody_says_so(road: Road) -> None:
    alone = sockets.motion_agent(road.context, channels.Endpoint("tcp://127.0.0.1:1"), "alone")
    assert fastpath.send_one(FastPath(alone).record, bytes_of(b"sample")) == NOT_SENT
    alone.close()


def test_a_fast_path_that_is_closed_fails_and_does_no_harm(road: Road) -> None:
    road.dealers[A].send(b"one")
    road.fast.close()
    record = road.fast.record
    assert fastpath.receive(record, road.frame) == FAILED
    assert fastpath.receive_one(record, road.frame) == FAILED
    assert fastpath.send_one(record, road.frame) == FAILED
    assert fastpath.send_to(record, 1, road.frame) == FAILED
    with pytest.raises(NetboardError, match="the motion channel failed: "):
        road.fast.fail("motion")
    assert road.router.receive() == (A, b"one")


def test_the_time_is_the_machines_or_what_was_set(road: Road) -> None:
    before = now_ns()
    read = fastpath.now_ns(road.fast.record)
    assert before <= read <= now_ns()
    road.fast.record["set_ns"] = 5
    assert fastpath.now_ns(road.fast.record) == 5
