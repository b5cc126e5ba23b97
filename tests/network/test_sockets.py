"""Socket options, and their effect on a real loopback."""

import contextlib
import os
import re
import socket as net
import stat
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq

from netboard.base.errors import NetboardError
from netboard.base.system import ownership
from netboard.base.system.scheduling import scheduling
from netboard.base.tables.rig import Network
from netboard.network.protocol.control import Command
from netboard.network.protocol.joining import Goodbye, Hello, Pong
from netboard.network.protocol.messages import KINDS
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.records import LogAck, LogRequest
from netboard.network.protocol.views import Frames
from netboard.network.transport import addresses, authenticator, channels, endpoints, fastpath, poller, sockets
from netboard.network.transport.ports import free_port, try_to_bind
from waiting import PATIENCE, until

pytestmark = pytest.mark.integration

ANYWHERE = channels.Endpoint("tcp://127.0.0.1:*")
WITHOUT_KEYS = b"\xff" + bytes(8) + b"\x7f\3\0" + b"NULL".ljust(20, b"\0") + bytes(32)
"""The greeting of a peer without keys (ZeroMQ's RFC 23)."""


class Made:
    """Creates sockets by `netboard.network.transport.sockets` in one context, which is destroyed at the end."""

    def __init__(self, context: sockets.Context) -> None:
        self.context = context
        self.ends: list[Any] = []

    def __getattr__(self, kind: str) -> Callable[..., Any]:
        def make(*arguments: Any) -> Any:
            self.ends.append(getattr(sockets, kind)(self.context, *arguments))
            return self.ends[-1]

        return make


@pytest.fixture
def made() -> Iterator[Made]:
    with sockets.open_context() as context:
        yield Made(context)
        context.destroy(linger=0)


def raw(end: Any) -> sockets.Socket:
    return end if isinstance(end, zmq.Socket) else end.socket


def endpoint_of(end: Any) -> channels.Endpoint:
    return channels.Endpoint(raw(end).getsockopt(zmq.LAST_ENDPOINT).decode().rstrip("\0"))  # type: ignore[union-attr]


def test_sockets_have_the_options_of_their_channels(made: Made) -> None:
    motion, log = made.motion_server(ANYWHERE), made.log_server(ANYWHERE)
    agent = made.motion_agent(endpoint_of(motion), "agent.left@test")
    logger = made.log_client(endpoint_of(log), "logger@test")
    view = made.view_publisher(ANYWHERE)
    eye = made.view_subscriber(endpoint_of(view))
    for end in (motion, agent):
        assert raw(end).getsockopt(zmq.SNDHWM) == raw(end).getsockopt(zmq.RCVHWM) == sockets.MOTION_HWM
        assert raw(end).getsockopt(zmq.LINGER) == 0
    for end in (log, made.control_server(ANYWHERE)):
        assert raw(end).getsockopt(zmq.RCVHWM) == sockets.SERVER_RECEIVE_HWM
    for end in (log, logger):
        assert raw(end).getsockopt(zmq.LINGER) == sockets.LOG_LINGER_MS > 0
        assert raw(end).getsockopt(zmq.SNDHWM) == sockets.LOG_HWM
    for end in (agent, logger):
        assert end.getsockopt(zmq.IMMEDIATE) == 1
    for end in (motion, log, agent, logger, view, eye):
        assert raw(end).getsockopt(zmq.HEARTBEAT_IVL) == 0
        assert raw(end).getsockopt(zmq.TCP_KEEPALIVE) == 1
    for end, largest in (
        *((end, sockets.MAX_FRAME) for end in (agent, logger, eye)),
        *((end, sockets.MAX_REQUEST) for end in (log, made.control_server(ANYWHERE))),
        (motion, sockets.MAX_SAMPLE),
        (view, sockets.MAX_SUBSCRIPTION),
    ):
        assert raw(end).getsockopt(zmq.MAXMSGSIZE) == largest


def test_size_limits_admit_the_largest_frame_of_each_kind() -> None:
    largest = {kind.message: kind.most_bytes + 64 for kind in KINDS.values()}  # encryption takes some bytes more
    assert max(largest[kind] for kind in (Hello, Stylus, Goodbye)) <= sockets.MAX_SAMPLE
    assert max(largest[kind] for kind in (Hello, LogRequest, LogAck, Pong, Frames, Command)) <= sockets.MAX_REQUEST


def test_pointer_channel_keeps_only_the_newest_and_never_queues(made: Made) -> None:
    where = channels.addresses(Network(port=free_port()))
    early = made.pointer_sender(where.pointer("left"))
    assert not sockets.send(early, b"stale")
    agent = made.pointer_receiver(where.pointer("left"))
    assert until(lambda: sockets.send(early, b"first") and sockets.receive(agent)) == b"first"
    for number in range(50):
        sockets.send(early, b"%d" % number)
    assert until(lambda: sockets.send(early, b"newest") and sockets.receive(agent) == b"newest")


def test_port_in_use_is_reported_clearly(made: Made) -> None:
    first = made.motion_server(ANYWHERE)
    with pytest.raises(NetboardError, match=r"cannot listen on tcp://127.0.0.1:.*is another server running"):
        made.motion_server(endpoint_of(first))


@pytest.mark.parametrize("everywhere", ["0.0.0.0", "*"])
def test_server_on_every_address_is_found_before_another_starts(made: Made, everywhere: str) -> None:
    where = channels.addresses(Network(bind=everywhere, port=free_port())).listen(channels.MOTION)
    with addresses.free_address(where):
        pass
    made.motion_server(where)
    with pytest.raises(NetboardError, match="another server listens on"), addresses.free_address(where):
        pass


@pytest.mark.parametrize("host", ["::1", "[::1]"])
def test_server_may_have_an_ipv6_address(made: Made, host: str) -> None:
    port = free_port()
    try:
        try_to_bind(host, port)
    except OSError:
        pytest.skip("this machine has no IPv6")
    where = channels.addresses(Network(host=host, bind=host, port=port))
    assert where.listen(channels.MOTION).address == f"tcp://[::1]:{port}"
    with addresses.free_address(where.listen(channels.MOTION)):
        pass
    server = made.motion_server(where.listen(channels.MOTION))
    agent = made.motion_agent(where.reach(channels.MOTION), "agent.left@test")
    assert until(lambda: sockets.send(agent, b"frame"))
    assert until(server.receive) == (b"agent.left@test", b"frame")
    publisher, display = (
        made.view_publisher(where.listen(channels.VIEW["left"])),
        made.view_subscriber(where.reach(channels.VIEW["left"])),
    )
    assert until(publisher.wanted)
    publisher.send(b"view")
    assert until(lambda: sockets.receive(display)) == b"view"
    with (
        pytest.raises(NetboardError, match="another server listens on"),
        addresses.free_address(where.listen(channels.MOTION)),
    ):
        pass


def test_nothing_is_queued_for_an_absent_server(made: Made) -> None:
    agent = made.motion_agent(channels.Endpoint("tcp://127.0.0.1:9"), "agent.left@test")
    assert not sockets.send(agent, b"stale")


def test_sending_to_an_absent_peer_is_not_an_error(made: Made) -> None:
    server = made.motion_server(ANYWHERE)
    assert not server.send(b"nobody", b"frame")
    assert server.receive() is None


def talk(made: Made) -> tuple[endpoints.Router, sockets.Socket]:
    server = made.control_server(ANYWHERE)
    peer = made.control_client(endpoint_of(server), "console@test")
    until(lambda: sockets.send(peer, b"hello"))
    assert until(server.receive) == (b"console@test", b"hello")
    return server, peer


def test_frames_go_both_ways_and_multipart_messages_count_as_empty(made: Made) -> None:
    server, peer = talk(made)
    peer.send_multipart((b"too", b"console@other", b"parts"))
    assert sockets.send(peer, b"good")
    assert until(server.receive) == (b"console@test", b"")
    assert until(server.receive) == (b"console@test", b"good")
    assert server.receive() is None
    assert server.key == server.role_refusal("agent", "left") == ""
    assert server.send(b"console@test", b"answer")
    assert poller.wait_readable(peer, PATIENCE)
    assert sockets.receive(peer) == b"answer"
    assert not poller.wait_readable(peer, 0.0005)


def test_waiter_wakes_for_any_of_several_sockets(made: Made) -> None:
    server, peer = talk(made)
    other = made.motion_server(ANYWHERE)
    waiter = poller.Waiter((server.socket, other.socket))
    assert not waiter.wait(0.0)
    assert not waiter.wait(0.0005)
    assert sockets.send(peer, b"one")
    assert waiter.wait(PATIENCE)
    assert waiter.wait(0.0)
    assert server.receive() == (b"console@test", b"one")
    assert not waiter.wait(0.0)


def test_views_reach_subscribers_and_only_the_newest_is_kept(made: Made) -> None:
    publisher = made.view_publisher(ANYWHERE)
    assert not publisher.wanted()
    publisher.send(b"for nobody")
    eye = made.view_subscriber(endpoint_of(publisher))
    until(publisher.wanted)
    for number in range(100):
        publisher.send(b"%d" % number)
    seen = [-1]

    def look() -> bool:
        """Send the newest once more, which may be lost, and see what has come."""
        publisher.send(b"99")
        frame = sockets.receive(eye)
        seen.extend(() if frame is None else (int(frame),))
        return seen[-1] == 99

    until(look)
    assert seen == sorted(seen)
    eye.close()
    until(lambda: not publisher.wanted())


def test_subscription_to_another_topic_is_not_counted(made: Made) -> None:
    publisher = made.view_publisher(ANYWHERE)
    odd = made.context.socket(zmq.SUB)
    odd.connect(endpoint_of(publisher).address)
    for topic in (b"something else", b""):
        odd.setsockopt(zmq.SUBSCRIBE, topic)
    until(publisher.wanted)
    odd.setsockopt(zmq.UNSUBSCRIBE, b"")
    until(lambda: not publisher.wanted())
    odd.close()


class SmallRing:
    """A key ring that accepts one key."""

    def __init__(self, owner: str) -> None:
        self.public, self.secret = authenticator.new_keys()
        self.known, self._secret = authenticator.new_keys()
        self._owner = owner

    def lock(self) -> authenticator.Credentials:
        return authenticator.Credentials(self.known, self._secret, self.public)

    def channel_refusal(self, key: str, channel: str) -> str:
        return "" if key == self.known else "unknown"

    def role_refusal(self, key: str, role: str, side: str) -> str:
        return "" if f"{role}.{side}" == self._owner else "somebody else"

    def owner(self, key: str) -> str:
        return self._owner

    def fingerprint(self, key: str) -> str:
        return key[:4]


def reports_of(own: authenticator.Authenticator) -> list[dict[str, str]]:
    """Let an authenticator do its work, and return its reports."""
    own.answer_handshakes()
    return own.reports(time.monotonic_ns())


class TestAuthenticator:
    @pytest.fixture
    def ring(self) -> SmallRing:
        return SmallRing("agent.left")

    @pytest.fixture
    def own(self, ring: SmallRing) -> authenticator.Authenticator:
        return authenticator.Authenticator(ring, 1)

    @pytest.fixture
    def server(self, made: Made, own: authenticator.Authenticator) -> endpoints.Router:
        return made.motion_server(channels.Endpoint(ANYWHERE.address, channels.MOTION, own))

    def agent(self, made: Made, server: endpoints.Router, lock: authenticator.Credentials, name: str) -> sockets.Socket:
        endpoint = channels.Endpoint(endpoint_of(server).address, channels.MOTION, lock)
        return made.motion_agent(endpoint, name)

    def let_in(self, own: authenticator.Authenticator, agent: sockets.Socket) -> None:
        until(lambda: reports_of(own) or sockets.send(agent, b"hello"))

    def test_accepted_peer_is_identified_by_its_key(
        self, made: Made, ring: SmallRing, own: authenticator.Authenticator, server: endpoints.Router
    ) -> None:
        self.let_in(own, self.agent(made, server, ring.lock(), "agent.left@test"))
        peer, frame = until(server.receive)
        assert frame == b"hello"
        assert peer.startswith(b"agent.left@test.")
        assert len(peer) > len("agent.left@test.") + 10, "the suffix is too short to be unguessable"
        assert server.key == ring.known
        assert server.role_refusal("agent", "left") == ""
        assert server.role_refusal("agent", "right") == "somebody else"

    def test_frame_under_another_name_is_refused_without_revealing_the_name(
        self, made: Made, ring: SmallRing, own: authenticator.Authenticator, server: endpoints.Router
    ) -> None:
        self.let_in(own, self.agent(made, server, ring.lock(), "agent.lefty@test"))
        assert until(server.receive) == endpoints.REFUSED
        (report,) = reports_of(own)
        assert re.fullmatch(r"it calls itself agent\.lefty@test\.[0-9a-f]{4}\.\.\.", report["reason"])
        assert report["address"] == "127.0.0.1"

    def test_fast_path_identifies_a_peer_by_its_key(
        self, made: Made, ring: SmallRing, own: authenticator.Authenticator, server: endpoints.Router
    ) -> None:
        agent = self.agent(made, server, ring.lock(), "agent.left@test")
        self.let_in(own, agent)
        name, _ = until(server.receive)
        fast, frame = fastpath.FastPath(server.socket, server.keyed), np.zeros(64, np.uint8)

        def comes() -> int:
            sockets.send(agent, b"sample")
            until(lambda: authenticator.readable(server.socket))
            return fastpath.receive(fast.record, frame)

        for key, place in ((ring.known, 1), ("k" * fastpath.KEY_SIZE, fastpath.OTHER), ("", fastpath.OTHER)):
            fast.register(1, name, key)
            assert comes() == place
            assert frame[: fast.size].tobytes() == b"sample"
            assert fast.sender == (name, ring.known, "127.0.0.1")
        fast.close()

    def test_key_of_one_server_is_refused_by_another_in_the_same_process(
        self, made: Made, ring: SmallRing, own: authenticator.Authenticator, server: endpoints.Router
    ) -> None:
        other_ring = SmallRing("agent.left")
        other_own = authenticator.Authenticator(other_ring, 2)
        other = made.motion_server(channels.Endpoint(ANYWHERE.address, channels.MOTION, other_own))
        lock = replace(ring.lock(), server=other_ring.public)
        stray = self.agent(made, other, lock, "agent.left@stray")
        (report,) = until(lambda: reports_of(other_own))
        assert report["reason"] == "unknown"
        assert not sockets.send(stray, b"hello")
        assert reports_of(own) == []
        self.let_in(own, self.agent(made, server, ring.lock(), "agent.left@test"))
        assert until(server.receive)[1] == b"hello"

    def test_repeated_refusal_is_rate_limited_and_fully_counted(self, own: authenticator.Authenticator) -> None:
        for _ in range(400):
            own.refuse("motion", "10.0.0.1", "key5", "why")
        expected = {"channel": "motion", "address": "10.0.0.1", "key": "key5", "reason": "why"}
        assert own.reports(0) == [expected | {"times": "400"}]
        own.refuse("motion", "10.0.0.1", "key5", "why")
        assert own.reports(0) == []
        assert own.final_reports() == [expected | {"times": "401"}]
        assert own.totals == {"why": 401}

    def test_flood_of_failed_handshakes_is_reported_and_blocks_no_valid_peer(
        self, made: Made, ring: SmallRing, own: authenticator.Authenticator, server: endpoints.Router
    ) -> None:
        place = endpoint_of(server).address.removeprefix("tcp://").split(":")
        for _ in range(2 * authenticator.MAX_FULL_READS * authenticator.MAX_HANDSHAKES):
            with net.create_connection((place[0], int(place[1]))) as stranger:
                stranger.sendall(WITHOUT_KEYS)
                with contextlib.suppress(ConnectionResetError):
                    while stranger.recv(1000):
                        pass
        until(lambda: any(it["reason"].startswith("more handshakes fail") for it in reports_of(own)))
        self.let_in(own, self.agent(made, server, ring.lock(), "agent.left@test"))
        assert until(server.receive)[1] == b"hello"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no sockets in the file system")
class TestIpcSockets:
    where = channels.Addresses("ignored", "ignored", 30_000 + os.getpid() % 30_000, "ipc")

    @pytest.fixture(autouse=True)
    def removed(self, made: Made) -> Iterator[None]:
        yield
        made.context.destroy(linger=0)
        for channel in (channels.MOTION, channels.LOG, channels.CONTROL):
            Path(self.where.listen(channel).address.removeprefix("ipc://")).unlink(missing_ok=True)

    def test_frame_passes_through_ipc(self, made: Made) -> None:
        endpoint = self.where.listen(channels.CONTROL)
        folder = Path(endpoint.address.removeprefix("ipc://")).parent
        server = made.control_server(endpoint)
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        peer = made.control_client(self.where.reach(channels.CONTROL), "console@test")
        until(lambda: sockets.send(peer, b"hello"))
        assert until(server.receive) == (b"console@test", b"hello")

    def test_second_server_on_the_same_path_is_refused(self, made: Made) -> None:
        made.motion_server(self.where.listen(channels.MOTION))
        with pytest.raises(NetboardError, match="is another server running"):
            made.motion_server(self.where.listen(channels.MOTION))

    def test_stale_socket_file_is_replaced(self, made: Made) -> None:
        endpoint = self.where.listen(channels.LOG)
        file = endpoint.address.removeprefix("ipc://")
        with contextlib.suppress(FileNotFoundError):
            Path(file).unlink()
        with net.socket(net.AF_UNIX) as dead:
            dead.bind(file)
        with net.socket(net.AF_UNIX) as peer, pytest.raises(ConnectionRefusedError):
            peer.connect(file)
        made.log_server(endpoint)
        with net.socket(net.AF_UNIX) as peer:
            peer.connect(file)
            assert peer.getpeername() == file

    def test_folder_open_to_other_users_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ownership, "Path", lambda _: tmp_path / "own")  # the usual one may be in use
        self.where.reach(channels.MOTION)
        (tmp_path / "own").chmod(0o755)
        with pytest.raises(NetboardError, match="not a folder of this user alone"):
            self.where.reach(channels.MOTION)


def test_refused_io_thread_settings_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    with sockets.open_context(io_priority=10_000, io_cpus=(9999,)) as context:
        context.socket(zmq.PAIR).close()
    assert len(caplog.messages) == 2
    assert all("refused" in message for message in caplog.messages)


def test_io_thread_accepts_available_cpus(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    with sockets.open_context(io_cpus=os.sched_getaffinity(0)) as context:
        context.socket(zmq.PAIR).close()
    assert caplog.messages == []


def test_peer_reconnects_after_a_failed_handshake(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "RENEW_S", 0.05)
    with net.create_server(("127.0.0.1", 0)) as impostor:
        where = channels.Endpoint(f"tcp://127.0.0.1:{impostor.getsockname()[1]}")
        peer = made.motion_agent(where, "agent.left@test")
        connection, _ = impostor.accept()
        with connection:
            connection.sendall(WITHOUT_KEYS.replace(b"NULL", b"ODD!"))
            until(lambda: gone(connection))
    server = made.motion_server(where)
    until(lambda: sockets.send_or_renew(peer, b"hello"))
    assert until(server.receive) == (b"agent.left@test", b"hello")


def gone(connection: net.socket) -> bool:
    """Return whether the other end has closed the connection."""
    connection.settimeout(0.1)
    try:
        return not connection.recv(4096)
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


def stalled(made: Made) -> tuple[Any, Any, bytes]:
    """A server, a peer that does not read, to which no more can be sent, and the peer's name."""
    server = made.motion_server(ANYWHERE)
    peer = made.motion_agent(endpoint_of(server), "agent.left")
    until(lambda: sockets.send(peer, b"hello"))
    name, _ = until(server.receive)
    until(lambda: not server.send(name, bytes(60_000)))
    return server, peer, name


def test_newest_queued_message_arrives_once_a_stalled_peer_continues(made: Made) -> None:
    server, peer, name = stalled(made)
    server.send_or_queue(name, b"another block")
    server.send_or_queue(name, b"the newest block")
    assert not server.send(name, b"more")
    received = []

    def newest_received() -> bool:
        server.send_queued()
        received.append(sockets.receive(peer))
        return received[-1] == b"the newest block"

    until(newest_received)
    assert b"another block" not in received
    server.send_queued()
    assert sockets.receive(peer) is None


def test_queued_message_can_be_cancelled(made: Made) -> None:
    server, peer, name = stalled(made)
    server.send_or_queue(name, b"another block")
    server.drop_queued(name)
    server.drop_queued(b"a stranger")

    def read() -> bool:
        server.send_queued()
        frame = sockets.receive(peer)
        assert frame != b"another block"
        return frame is None and server.send(name, b"the last")

    until(read)
    assert until(lambda: sockets.receive(peer)) in (bytes(60_000), b"the last")


def test_message_queued_for_an_absent_peer_is_dropped(made: Made) -> None:
    server = made.motion_server(ANYWHERE)
    server.send_or_queue(b"agent.left", b"another block")
    peer = made.motion_agent(endpoint_of(server), "agent.left")
    until(lambda: sockets.send(peer, b"hello"))
    until(server.receive)
    server.send_queued()
    server.send(b"agent.left", b"welcome")
    assert until(lambda: sockets.receive(peer)) == b"welcome"


def test_io_threads_have_low_priority_while_requested() -> None:
    with sockets.open_context() as context:
        context.set_low_priority(True)  # without a priority there is nothing to lower
        assert context.threads == ()
    if not sockets._is_granted("priority 3", lambda: scheduling.set_priority(3)):
        pytest.skip("real-time priorities are not granted here")
    with sockets.open_context(3, loop_priority=2) as context:
        assert len(context.threads) == 1
        priorities = []
        for wanted in (True, True, False):
            context.set_low_priority(wanted)
            priorities += [os.sched_getparam(thread).sched_priority for thread in context.threads]
        assert priorities == [1, 1, 3]
