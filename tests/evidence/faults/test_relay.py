"""The relay over real sockets: delays, holds, cuts and duplicates."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from evidence.faults.relay import UNIMPAIRED, Flow, Impairment, Relay

pytestmark = pytest.mark.integration

TIMEOUT = 20.0
MS = 1_000_000


class Line:
    """A listening server, the relay before it, and a client through it."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self.listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        self.listener.settimeout(TIMEOUT)
        self.relay = stack.enter_context(Relay([self.listener.getsockname()]))

    def connect(self) -> tuple[socket.socket, socket.socket]:
        """Connect a client; return it and the server's end of the connection."""
        client = self._stack.enter_context(socket.create_connection(("127.0.0.1", self.relay.port), TIMEOUT))
        return client, self.accept()

    def accept(self) -> socket.socket:
        server, _ = self.listener.accept()
        server.settimeout(TIMEOUT)
        return self._stack.enter_context(server)


def assert_reset(port: int) -> None:
    """Check that a new connection is reset, at once or shortly after."""
    with pytest.raises(ConnectionResetError), socket.create_connection(("127.0.0.1", port), TIMEOUT) as peer:
        peer.recv(1)


@pytest.fixture
def line() -> Iterator[Line]:
    with ExitStack() as stack:
        yield Line(stack)


def test_bytes_pass_both_ways_in_order(line: Line) -> None:
    client, server = line.connect()
    client.sendall(b"there")
    assert server.recv(100) == b"there"
    server.sendall(b"and back")
    assert client.recv(100) == b"and back"


def test_data_larger_than_any_buffer_passes_complete(line: Line) -> None:
    client, server = line.connect()
    sent = bytes(range(256)) * 4096
    client.sendall(sent)
    client.shutdown(socket.SHUT_WR)
    received = b""
    while len(received) < len(sent):
        received += server.recv(2**16)
    assert received == sent


def test_delay_jitter_and_stalls_lose_no_data(line: Line) -> None:
    line.relay.impair(Impairment(delay=0.001, jitter=0.005, stalls=20.0, rate=1e6), Impairment(delay=0.002))
    client, server = line.connect()
    client.sendall(b"".join(b"%04d" % k for k in range(1000)))
    received = b""
    while len(received) < 4000:
        received += server.recv(2**16)
    assert received == b"".join(b"%04d" % k for k in range(1000))


def test_held_data_arrives_after_mending(line: Line) -> None:
    client, server = line.connect()
    client.sendall(b"a")
    assert server.recv(1) == b"a"
    line.relay.hold()
    client.sendall(b"b")
    server.settimeout(0.1)
    with pytest.raises(TimeoutError):
        server.recv(1)
    server.settimeout(TIMEOUT)
    line.relay.restore()
    assert server.recv(1) == b"b"


def test_cut_resets_connections_until_mended(line: Line) -> None:
    client, server = line.connect()
    line.relay.cut()
    with pytest.raises(ConnectionResetError):
        client.recv(1)
    with pytest.raises(ConnectionResetError):
        server.recv(1)
    assert_reset(line.relay.port)
    line.relay.restore()
    client, server = line.connect()
    client.sendall(b"again")
    assert server.recv(100) == b"again"


def test_doubled_connection_is_received_twice_and_answered_once(line: Line) -> None:
    line.relay.duplicate(True)
    client, server = line.connect()
    copy = line.accept()
    client.sendall(b"twice")
    assert (server.recv(100), copy.recv(100)) == (b"twice", b"twice")
    copy.sendall(b"for nobody")
    server.sendall(b"once")
    assert client.recv(100) == b"once"


def test_close_is_forwarded_after_data_in_flight(line: Line) -> None:
    line.relay.impair(up=Impairment(delay=0.05))
    client, server = line.connect()
    client.sendall(b"last words")
    client.close()
    assert server.recv(100) == b"last words"
    assert server.recv(100) == b""


def test_peer_is_reset_without_a_server() -> None:
    with socket.create_server(("127.0.0.1", 0)) as gone:
        place = gone.getsockname()
    with Relay([place]) as relay:
        assert_reset(relay.port)


@pytest.fixture
def flow() -> Iterator[tuple[Flow, socket.socket, socket.socket]]:
    with ExitStack() as stack:
        a, source = map(stack.enter_context, socket.socketpair())
        sink, b = map(stack.enter_context, socket.socketpair())
        yield Flow(source, sink, None, 1), a, b


def test_flow_releases_only_data_that_is_due(flow: tuple[Flow, socket.socket, socket.socket]) -> None:
    line, a, b = flow
    a.sendall(b"first")
    line.read(Impairment(delay=0.010), 0)
    a.sendall(b"second")
    line.read(UNIMPAIRED, 1 * MS)
    assert line.due_ns == 10 * MS
    line.forward(9 * MS)
    b.setblocking(False)
    with pytest.raises(BlockingIOError):
        b.recv(100)
    line.forward(10 * MS)  # data with a shorter delay does not overtake
    assert b.recv(100) == b"firstsecond"
    assert line.due_ns == float("inf")


def test_throttled_flow_limits_the_rate(flow: tuple[Flow, socket.socket, socket.socket]) -> None:
    line, a, _ = flow
    for _ in range(3):
        a.sendall(bytes(1000))
        line.read(Impairment(rate=1e6), 0)
    line.forward(2 * MS)
    assert line.bytes == 1000
    assert line.due_ns == 3 * MS
