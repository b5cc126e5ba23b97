"""Endpoints of one machine: the same tests for Unix domain sockets and for TCP on loopback with a key."""

import os
import stat
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import zmq

from netboard.base.errors import ConfigError, NetboardError
from netboard.network.transport import sockets
from netboard.network.transport.authenticator import SharedKey, new_keys
from netboard.network.transport.channels import CHANNELS, Endpoint
from netboard.network.transport.local_endpoints import (
    KEY_FILE,
    NAMES,
    KeyedLoopback,
    LocalEndpoints,
    UnixSockets,
    local_endpoints,
    user_key,
)
from netboard.network.transport.ports import free_port
from waiting import until

KINDS = {"unix": UnixSockets, "loopback": KeyedLoopback}


@pytest.fixture(params=["unix", "loopback"])
def kind(request: pytest.FixtureRequest, tmp_path: Path) -> LocalEndpoints:
    if request.param == "unix" and sys.platform == "win32":
        pytest.skip("Windows has none in pyzmq")
    return KINDS[request.param](tmp_path)


class Opened:
    """Sockets of `sockets`, or of pyzmq itself, that are closed at the end of a test."""

    def __init__(self, context: sockets.Context) -> None:
        self._context = context
        self.made: list[Any] = []

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def make(*arguments: Any) -> Any:
            own = getattr(sockets, name, None)
            self.made.append(
                getattr(self._context, name)(*arguments) if own is None else own(self._context, *arguments)
            )
            return self.made[-1]

        return make


@pytest.fixture
def opened() -> Iterator[Opened]:
    with sockets.open_context() as made:
        opened = Opened(made)
        yield opened
        for socket in opened.made:
            socket.close()


@pytest.fixture
def port() -> int:
    return free_port()


def endpoint(kind: LocalEndpoints, port: int, name: str) -> Endpoint:
    local = kind.at_station(port, name, len(CHANNELS))
    return Endpoint(local.address, security=local.key)


def test_pointer_reaches_the_agent_of_its_side_only(kind: LocalEndpoints, opened: Opened, port: int) -> None:
    left = opened.pointer_receiver(endpoint(kind, port, "pointer.left"))
    right = opened.pointer_receiver(endpoint(kind, port, "pointer.right"))
    sender = opened.pointer_sender(endpoint(kind, port, "pointer.left"))
    until(lambda: sockets.send(sender, b"here"))
    assert until(lambda: sockets.receive(left)) == b"here"
    assert sockets.receive(right) is None


def test_force_reaches_the_display(kind: LocalEndpoints, opened: Opened, port: int) -> None:
    publisher = opened.felt_publisher(endpoint(kind, port, "felt.right"))
    subscriber = opened.felt_subscriber(endpoint(kind, port, "felt.right"))
    until(publisher.wanted)

    def received() -> bytes | None:
        publisher.send(b"force")
        return sockets.receive(subscriber)

    assert until(received) == b"force"


def test_second_agent_of_a_side_is_refused(kind: LocalEndpoints, opened: Opened, port: int) -> None:
    opened.pointer_receiver(endpoint(kind, port, "pointer.left"))
    with pytest.raises(NetboardError, match="is another server running"):
        opened.pointer_receiver(endpoint(kind, port, "pointer.left"))


def test_endpoints_of_two_sessions_and_all_names_differ(kind: LocalEndpoints) -> None:
    step = len(CHANNELS) + 1 + kind.ports
    found = [kind.at_station(at, name, len(CHANNELS)).address for at in (6000, 6000 + step) for name in NAMES]
    assert len(set(found)) == 2 * len(NAMES)
    taken = {f"tcp://127.0.0.1:{at + channel}" for at in (6000, 6000 + step) for channel in range(len(CHANNELS) + 1)}
    assert not taken & set(found)


class TestKeyOfAUser:
    """What the loopback endpoints add, because every user of a machine can reach its ports."""

    def refused(self, opened: Opened, port: int, folder: Path, security: SharedKey | None) -> None:
        """Try to send without the right key, then with it: only the latter arrives."""
        kind = KeyedLoopback(folder)
        right = endpoint(kind, port, "pointer.left")
        receiver = opened.pointer_receiver(right)
        stranger = opened.socket(zmq.PUSH)  # which queues, and would deliver as soon as it is let in
        stranger.setsockopt(zmq.LINGER, 0)
        if security is not None:
            stranger.setsockopt(zmq.CURVE_SERVERKEY, security.public.encode())
            stranger.setsockopt(zmq.CURVE_PUBLICKEY, security.public.encode())
            stranger.setsockopt(zmq.CURVE_SECRETKEY, security.secret.encode())
        monitor = stranger.get_monitor_socket(zmq.EVENT_DISCONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_CLOSED)
        opened.made.append(monitor)
        stranger.connect(right.address)
        stranger.send(b"a stranger's hand")
        from zmq.utils.monitor import recv_monitor_message

        assert recv_monitor_message(monitor)["event"] != zmq.EVENT_HANDSHAKE_SUCCEEDED
        stranger.disable_monitor()
        owner = opened.pointer_sender(right)
        until(lambda: sockets.send(owner, b"the player's hand"))
        assert until(lambda: sockets.receive(receiver)) == b"the player's hand"

    def test_peer_without_a_key_sends_nothing(self, opened: Opened, port: int, tmp_path: Path) -> None:
        self.refused(opened, port, tmp_path, None)

    def test_peer_with_another_key_sends_nothing(self, opened: Opened, port: int, tmp_path: Path) -> None:
        self.refused(opened, port, tmp_path, SharedKey(*new_keys()))

    def test_program_that_binds_the_port_first_gets_no_frame(self, opened: Opened, port: int, tmp_path: Path) -> None:
        right = endpoint(KeyedLoopback(tmp_path), port, "pointer.left")
        stranger = opened.pointer_receiver(Endpoint(right.address, security=SharedKey(*new_keys())))
        sender = opened.pointer_sender(right)
        stranger.setsockopt(zmq.RCVTIMEO, 1)
        monitor = sender.get_monitor_socket(zmq.EVENT_ALL)
        opened.made.append(monitor)
        from zmq.utils.monitor import recv_monitor_message

        while (event := recv_monitor_message(monitor)["event"]) != zmq.EVENT_CONNECTED:
            pass
        while (event := recv_monitor_message(monitor)["event"]) not in (
            zmq.EVENT_DISCONNECTED,
            zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL,
            zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL,
            zmq.EVENT_HANDSHAKE_SUCCEEDED,
        ):
            pass
        assert event != zmq.EVENT_HANDSHAKE_SUCCEEDED
        sender.disable_monitor()
        assert not sockets.send(sender, b"here")
        assert sockets.receive(stranger) is None

    def test_processes_that_start_together_have_one_key(self, tmp_path: Path) -> None:
        with ThreadPoolExecutor(8) as pool:
            found = set(pool.map(lambda _: user_key(tmp_path), range(32)))
        assert len(found) == 1
        assert [path.name for path in tmp_path.iterdir()] == [KEY_FILE]

    @pytest.mark.skipif(os.name != "posix", reason="no modes")
    def test_key_is_private_and_a_readable_or_damaged_one_is_refused(self, tmp_path: Path) -> None:
        user_key(tmp_path)
        path = tmp_path / KEY_FILE
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        path.chmod(0o644)
        with pytest.raises(NetboardError, match="is accessible to other users"):
            user_key(tmp_path)
        path.chmod(0o600)
        path.write_text("not a key")
        with pytest.raises(NetboardError, match="is not a key; remove it"):
            user_key(tmp_path)


def test_loopback_stands_in_for_no_channel(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='expected "tcp"'):
        KeyedLoopback(tmp_path).channel(5550)


def test_system_has_the_kind_that_its_pyzmq_offers() -> None:
    assert isinstance(local_endpoints, UnixSockets if zmq.has("ipc") else KeyedLoopback)
