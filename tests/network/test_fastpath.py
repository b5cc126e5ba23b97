"""The fast path: libzmq's functions called from kernels, with real sockets."""

import socket as net
import sys
from collections.abc import Iterator

import numpy as np
import pytest
import zmq

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.network.transport import channels, fastpath, sockets, waiting
from netboard.network.transport.fastpath import FAILED, NOT_SENT, NOTHING, OTHER, SENT, FastPath

A, B = b"agent.left@1", b"\xff" * fastpath.NAME_ROOM
HERE = channels.Endpoint("inproc://fast")

LONG_NS = 10_000_000_000
"""Longer than any test may sleep [ns]."""


class FastPathRig:
    """A router with its fast path, and two dealers connected to it."""

    def __init__(self, context: sockets.Context) -> None:
        self.context = context
        self.router = sockets.motion_server(context, HERE)
        self.fast = FastPath(self.router.socket)
        self.frame = np.zeros(64, np.uint8)
        self.dealers = {name: self.dealer(name) for name in (A, B)}
        self.fast.register(1, A, "")

    def dealer(self, name: bytes) -> sockets.Socket:
        socket = self.context.socket(zmq.DEALER)
        socket.setsockopt(zmq.IDENTITY, name)
        socket.connect(HERE.address)
        return socket

    def receive(self) -> tuple[int, bytes]:
        place = fastpath.receive(self.fast.record, self.frame)
        return place, self.frame[: self.fast.size].tobytes()


@pytest.fixture
def rig() -> Iterator[FastPathRig]:
    with sockets.open_context() as context:
        yield FastPathRig(context)


def bytes_of(frame: bytes) -> np.ndarray:
    return np.frombuffer(frame, np.uint8)


def test_frame_of_a_known_peer_has_its_place_and_of_others_the_name(rig: FastPathRig) -> None:
    rig.dealers[A].send(b"one")
    rig.dealers[B].send(b"other")
    rig.dealers[A].send(b"")
    assert sorted([rig.receive(), rig.receive(), rig.receive()]) == [(OTHER, b"other"), (1, b""), (1, b"one")]
    assert rig.receive()[0] == NOTHING
    rig.dealers[B].send(b"again")
    assert rig.receive() == (OTHER, b"again")
    assert rig.fast.sender == (B, "", "")


def test_forgotten_peer_is_unknown(rig: FastPathRig) -> None:
    rig.fast.register(0, B, "")
    rig.fast.unregister(1)
    for name in (A, B):
        rig.dealers[name].send(name[:3])
    assert sorted([rig.receive(), rig.receive()]) == [(OTHER, b"age"), (0, b"\xff\xff\xff")]


@pytest.mark.parametrize("parts", [(b"one", b"two"), (b"", b"two", b"three"), (b"x" * 65,), (b"x" * 4000, b"y")])
def test_multipart_or_oversized_message_is_received_as_empty(rig: FastPathRig, parts: tuple[bytes, ...]) -> None:
    rig.dealers[A].send_multipart(parts)
    rig.dealers[A].send(b"next")
    assert rig.receive() == (1, b"")
    assert rig.receive() == (1, b"next")
    assert rig.receive()[0] == NOTHING


def test_frame_as_large_as_the_buffer_is_received_whole(rig: FastPathRig) -> None:
    rig.dealers[A].send(bytes(range(64)))
    assert rig.receive() == (1, bytes(range(64)))


def test_send_reports_delivery_and_a_full_queue(rig: FastPathRig) -> None:
    record = rig.fast.record
    rig.fast.register(0, b"nobody", "")
    assert fastpath.send_to(record, 0, bytes_of(b"force")) == NOT_SENT
    rig.dealers[A].send(b"here")
    rig.receive()
    assert fastpath.send_to(record, 1, bytes_of(b"force")) == SENT
    assert sockets.receive(rig.dealers[A]) == b"force"
    sent = [fastpath.send_to(record, 1, bytes_of(b"%d" % number)) for number in range(5000)]
    assert sent[0] == SENT
    assert sent[-1] == NOT_SENT  # its queue is full
    received = []
    while (frame := sockets.receive(rig.dealers[A])) is not None:
        received.append(frame)
    assert received == [b"%d" % number for number in range(sent.index(NOT_SENT))]


def test_dealer_sends_and_receives(rig: FastPathRig) -> None:
    fast = FastPath(rig.dealers[A])
    assert fastpath.receive_one(fast.record, rig.frame) == NOTHING
    assert fastpath.send_one(fast.record, bytes_of(b"sample")) == SENT
    assert rig.receive() == (1, b"sample")
    for frame in (b"", b"force", b"z" * 100):
        assert rig.router.send(A, frame)
    assert fastpath.receive_one(fast.record, rig.frame) == 0
    assert fastpath.receive_one(fast.record, rig.frame) == 5
    assert rig.frame[:5].tobytes() == b"force"
    assert fastpath.receive_one(fast.record, rig.frame) == 64  # the rest is cut off


def test_dealer_without_a_peer_reports_not_sent(rig: FastPathRig) -> None:
    alone = sockets.motion_agent(rig.context, channels.Endpoint("tcp://127.0.0.1:1"), "alone")
    assert fastpath.send_one(FastPath(alone).record, bytes_of(b"sample")) == NOT_SENT
    alone.close()


def test_closed_fast_path_fails_harmlessly(rig: FastPathRig) -> None:
    rig.dealers[A].send(b"one")
    rig.fast.close()
    record = rig.fast.record
    assert fastpath.receive(record, rig.frame) == FAILED
    assert fastpath.receive_one(record, rig.frame) == FAILED
    assert fastpath.send_one(record, rig.frame) == FAILED
    assert fastpath.send_to(record, 1, rig.frame) == FAILED
    with pytest.raises(NetboardError, match="the motion channel failed: "):
        rig.fast.raise_failure("motion")
    assert rig.router.receive() == (A, b"one")


def test_fast_path_time_is_the_clocks_or_the_set_time(rig: FastPathRig) -> None:
    before = now_ns()
    read = fastpath.now_ns(rig.fast.record)
    assert before <= read <= now_ns()
    rig.fast.record["simulated_ns"] = 5
    assert fastpath.now_ns(rig.fast.record) == 5


def test_sleep_ends_when_the_time_is_over_or_the_watched_file_signals(rig: FastPathRig) -> None:
    reader, writer = net.socketpair()
    record = rig.fast.record
    assert not fastpath.sleep(record, 1_000_000)
    rig.fast.watch(reader.fileno())
    assert not fastpath.sleep(record, 1_000_000)
    writer.send(b"x")
    before = now_ns()
    assert fastpath.sleep(record, LONG_NS)
    assert now_ns() - before < LONG_NS
    rig.fast.watch(waiting.NO_FILE)
    assert not fastpath.sleep(record, 1_000_000)
    reader.close()
    writer.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows' select takes sockets of any number")
def test_file_that_cannot_be_waited_for_is_refused(rig: FastPathRig) -> None:
    with pytest.raises(NetboardError, match="only the first 1024 can be waited for"):
        rig.fast.watch(waiting.FILES)


def test_receiver_returns_frames_whole_until_there_are_none_and_says_which_channel_failed() -> None:
    with sockets.open_context() as context:
        sender, socket = context.socket(zmq.PUSH), context.socket(zmq.PULL)
        sender.bind("inproc://frames")
        socket.connect("inproc://frames")
        receiver = fastpath.Receiver(socket, "view", 8)
        assert receiver.receive() is None
        sender.send(b"one")
        sender.send(b"longer than allowed")
        assert (receiver.receive(), receiver.receive(), receiver.receive()) == (b"one", b"longer t", None)
        receiver.close()
        assert socket.closed
        with pytest.raises(NetboardError, match="the view channel failed"):
            receiver.receive()
