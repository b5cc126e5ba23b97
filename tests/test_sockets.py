"""The sockets' options, and what they do on a real loopback."""

import time
from collections.abc import Callable, Iterator

import pytest
import zmq

from netboard import sockets
from netboard.config import Network
from netboard.errors import NetboardError

Socket = sockets.Socket


class Made:
    """Makes sockets as `netboard.sockets` does, in one context, and closes them all in the end."""

    def __init__(self) -> None:
        self.context: sockets.Context = zmq.Context()
        self.sockets: list[Socket] = []

    def __getattr__(self, kind: str) -> Callable[..., Socket]:
        def make(*arguments: str) -> Socket:
            self.sockets.append(getattr(sockets, kind)(self.context, *arguments))
            return self.sockets[-1]

        return make


@pytest.fixture
def made() -> Iterator[Made]:
    made = Made()
    yield made
    for socket in made.sockets:
        socket.close(linger=0)
    made.context.term()


def endpoint_of(socket: Socket) -> str:
    return socket.getsockopt(zmq.LAST_ENDPOINT).decode().rstrip("\0")  # type: ignore[union-attr]


def test_every_socket_has_the_options_its_channel_needs(made: Made) -> None:
    any_port = "tcp://127.0.0.1:*"
    motion, log = made.motion_server(any_port), made.log_server(any_port)
    agent = made.motion_agent(endpoint_of(motion), "agent.left@test")
    logger = made.log_client(endpoint_of(log), "logger@test")
    view = made.view_publisher(any_port)
    eye = made.view_subscriber(endpoint_of(view))
    for socket in (motion, agent):
        assert socket.getsockopt(zmq.SNDHWM) == socket.getsockopt(zmq.RCVHWM) == sockets.MOTION_HWM
        assert socket.getsockopt(zmq.LINGER) == 0
    for socket in (log, logger):
        assert socket.getsockopt(zmq.LINGER) == sockets.LOG_LINGER_MS > 0
        assert socket.getsockopt(zmq.SNDHWM) == sockets.LOG_HWM
    for socket in (agent, logger):
        assert socket.getsockopt(zmq.IMMEDIATE) == 1
    for socket in (motion, log, agent, logger, view, eye):
        assert socket.getsockopt(zmq.HEARTBEAT_IVL) == 0
        assert socket.getsockopt(zmq.TCP_KEEPALIVE) == 1
        assert socket.getsockopt(zmq.MAXMSGSIZE) == sockets.LARGEST_FRAME


def test_addresses_count_the_channels_from_the_first_port() -> None:
    where = sockets.addresses(Network(host="10.0.0.1", bind="0.0.0.0", port=6000))
    assert where.listen(sockets.MOTION) == "tcp://0.0.0.0:6000"
    assert where.reach(sockets.CONTROL) == "tcp://10.0.0.1:6004"
    assert {sockets.VIEW["left"], sockets.VIEW["right"]} == {2, 3}


def test_a_taken_port_is_said_in_words(made: Made) -> None:
    first = made.motion_server("tcp://127.0.0.1:*")
    with pytest.raises(NetboardError, match=r"cannot listen on tcp://127.0.0.1:.*is another server running"):
        made.motion_server(endpoint_of(first))


def test_nothing_is_queued_for_a_server_that_is_not_there(made: Made) -> None:
    agent = made.motion_agent("tcp://127.0.0.1:9", "agent.left@test")
    assert not sockets.send(agent, b"stale")


def test_a_peer_that_is_not_there_is_no_error(made: Made) -> None:
    server = made.motion_server("tcp://127.0.0.1:*")
    assert not sockets.send_to(server, b"nobody", b"frame")
    assert sockets.receive_from(server) is None


def talk(made: Made) -> tuple[Socket, Socket]:
    server = made.control_server("tcp://127.0.0.1:*")
    peer = made.control_client(endpoint_of(server), "console@test")
    until = time.monotonic() + 5
    while not sockets.send(peer, b"hello") and time.monotonic() < until:
        sockets.wait_readable(peer, 0.01)
    assert sockets.wait_readable(server, 5.0)
    assert sockets.receive_from(server) == (b"console@test", b"hello")
    return server, peer


def test_frames_go_both_ways_and_foreign_shapes_are_dropped(made: Made) -> None:
    server, peer = talk(made)
    peer.send_multipart((b"too", b"many", b"parts"))
    assert sockets.send(peer, b"good")
    assert sockets.wait_readable(server, 5.0)
    until = time.monotonic() + 5
    while (got := sockets.receive_from(server)) is None and time.monotonic() < until:
        sockets.wait_readable(server, 0.01)
    assert got == (b"console@test", b"good")
    assert sockets.send_to(server, b"console@test", b"answer")
    assert sockets.wait_readable(peer, 5.0)
    assert sockets.receive(peer) == b"answer"
    assert not sockets.wait_readable(peer, 0.0005)


def test_a_view_channel_keeps_only_the_newest(made: Made) -> None:
    publisher = made.view_publisher("tcp://127.0.0.1:*")
    eye = made.view_subscriber(endpoint_of(publisher))
    until = time.monotonic() + 30
    while not sockets.wait_readable(eye, 0.01) and time.monotonic() < until:
        sockets.send(publisher, b"0")
    for number in range(1, 100):
        sockets.send(publisher, b"%d" % number)
    seen = [int(sockets.receive(eye) or b"-1")]
    # The newest itself is lost if it is written while the one before is being read, and the next one makes up for it.
    while seen[-1] < 99 and time.monotonic() < until:
        sockets.send(publisher, b"99")
        sockets.wait_readable(eye, 0.05)
        seen.append(int(sockets.receive(eye) or seen[-1]))
    assert seen[-1] == 99
    assert seen == sorted(seen)
