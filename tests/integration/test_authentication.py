"""A server with keys refuses every kind of unauthorised peer, and reports and records it.

All attempts are made during a trial of one session; the tests examine their results.
"""

import contextlib
import socket as net
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.benchmarks.harness.rig import TIMEOUT, Rig
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Command, Status, StatusRequest
from netboard.network.protocol.joining import Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.views import Frames
from netboard.network.transport import authenticator, channels, poller, sockets
from netboard.recording.files.reader import Recording
from netboard.services.cli import app
from netboard.stage.view import View

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(300)]

PEERS = ("agent.left", "agent.right", "display.left", "display.right", "logger", "console")
GREETING, HELLO_SIZE, COOKIE = 64, 202, 170
"""Sizes of the first messages of a CURVE handshake, by ZeroMQ's RFCs 23 and 26 [bytes]."""
COMPILE_TIMEOUT = 180.0
"""Timeout for a server that has to compile its kernels first on a busy machine [s]."""
EAVESDROP_S = 0.5
"""Duration of listening for messages that must not arrive [s]."""


def rig_with_keys(folder: Path, *settings: str) -> Rig:
    """A rig with all keys in one folder, as on one machine."""
    keys.init(folder / "keys")
    for role, _, side in (peer.partition(".") for peer in PEERS):
        keys.add(folder / "keys", role, side, folder / "keys")  # type: ignore[arg-type]
    soon_level = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0")
    return Rig(folder, ("network.curve=on", f"network.keys={folder / 'keys'}", *soon_level, *settings))


def hello(role: str, side: str) -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, "intruder:1", "0", {})


def stylus(seq: int) -> Stylus:
    """A sample far from both hands."""
    now = time.monotonic_ns()
    return Stylus(seq, now, 0.0, 0.0, 0.123, 0.0, 0.0, 0.0, 0, 1, 0.0, -1, 0, 0, now, 0)


@dataclass
class Intruder:
    """A peer at a channel, with its received messages and the number of frames it sent."""

    rig: Rig
    socket: sockets.Socket
    received: list[Message] = field(default_factory=list)
    sent: int = 0

    def receive(self) -> None:
        while (frame := sockets.receive(self.socket)) is not None:
            self.received.append(decode(frame))

    def send_until(self, condition: Callable[[], bool], *messages: Message) -> None:
        """Send messages repeatedly until a condition holds."""
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, self.rig.output_of("server")
            for message in messages:
                self.sent += sockets.send(self.socket, encode(message))
            time.sleep(0.01)
            self.receive()

    def until_logged(self, reason: str, *messages: Message) -> None:
        """Send until the server has logged the reason of the refusal."""
        self.send_until(lambda: reason in self.rig.output_of("server"), *messages)

    def until_refused(self, reason: str, *messages: Message) -> None:
        """Send until the server has answered with this reason; earlier refusals may have another reason."""

        def answered() -> bool:
            return any(isinstance(message, Refusal) and reason in message.reason for message in self.received)

        self.send_until(answered, *messages)

    def until_received(self, kind: type, *messages: Message) -> None:
        """Send until an answer of a kind has arrived."""
        self.send_until(lambda: any(isinstance(message, kind) for message in self.received), *messages)


class Attempts:
    """The attempts on one rig, one method each."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.folder = Path(rig.config.network.keys)
        self.server_key = keys.credentials(self.folder, "console").server

    def at(self, channel: int, lock: authenticator.Credentials | None, name: str) -> Intruder:
        """A peer with these credentials, or none, at a channel."""
        endpoint = channels.addresses(self.rig.config.network, lock).reach(channel)
        makers = {channels.MOTION: sockets.motion_agent, channels.LOG: sockets.log_client}
        if channel in channels.VIEW.values():
            return Intruder(self.rig, sockets.view_subscriber(self.rig.context, endpoint))
        make = makers.get(channel, sockets.control_client)
        return Intruder(self.rig, make(self.rig.context, endpoint, name))

    def credentials_of(self, peer: str) -> authenticator.Credentials:
        return keys.credentials(self.folder, peer)

    def unknown_credentials(self) -> authenticator.Credentials:
        """A self-made key pair, with the correct public key of the server."""
        return authenticator.Credentials(*authenticator.new_keys(), self.server_key)

    def no_key(self) -> Intruder:
        who = self.at(channels.MOTION, None, "agent.left@intruder")
        who.until_logged("it has no key, or closed the connection", hello("agent", "left"), stylus(0))
        return who

    def wrong_server(self) -> Intruder:
        """A peer with a wrong public key of the server cannot complete the handshake."""
        lock = replace(self.credentials_of("agent.left"), server=authenticator.new_keys()[0])
        who = self.at(channels.MOTION, lock, "agent.left@intruder")
        who.until_logged("channel motion: it has a wrong server key", hello("agent", "left"))
        return who

    def wrong_key(self) -> Intruder:
        lock = self.unknown_credentials()
        who = self.at(channels.MOTION, lock, "agent.left@intruder")
        reason = f"channel motion: address=127.0.0.1 key={keys.fingerprint(lock.public)}: its key is not known here"
        who.until_logged(reason, hello("agent", "left"), stylus(0))
        return who

    def wrong_role(self) -> Intruder:
        who = self.at(channels.MOTION, self.credentials_of("display.left"), "agent.left@intruder")
        reason = ": the key of display.left is not for this channel"
        who.until_logged(reason, hello("agent", "left"), stylus(0))
        return who

    def wrong_log(self) -> Intruder:
        who = self.at(channels.LOG, self.credentials_of("agent.left"), "logger@intruder")
        who.until_logged("channel log: address=127.0.0.1", hello("logger", ""))
        return who

    def wrong_side(self) -> Intruder:
        """A display claims to be the other station's."""
        who = self.at(channels.CONTROL, self.credentials_of("display.left"), "display.left@intruder")
        who.until_refused("the key of display.left is not that of display.right", hello("display", "right"))
        return who

    def false_console(self) -> Intruder:
        """A display claims to be the operator's console."""
        who = self.at(channels.CONTROL, self.credentials_of("display.left"), "display.left@impostor")
        who.until_refused("the key of display.left is not that of console", hello("console", ""))
        who.until_received(Refusal, Command("end", "", 1))
        return who

    def wrong_hand(self) -> Intruder:
        """An agent claims the other hand, and sends samples of it."""
        who = self.at(channels.MOTION, self.credentials_of("agent.right"), "agent.right@intruder")
        reason = "the key of agent.right is not that of agent.left"
        who.until_refused(reason, hello("agent", "left"), stylus(10_000_000))
        return who

    def wrong_name(self) -> Intruder:
        """An agent uses the other agent's name."""
        who = self.at(channels.MOTION, self.credentials_of("agent.right"), "agent.left@intruder")
        who.until_logged(": it calls itself agent.left@intruder", hello("agent", "left"), stylus(10_000_000))
        return who

    def commands(self) -> Intruder:
        """An accepted display sends commands."""
        who = self.at(channels.CONTROL, self.credentials_of("display.left"), "display.left@rebel")
        who.until_received(Welcome, hello("display", "left"))
        for name in ("pause", "stop", "end"):
            who.received.clear()
            who.until_received(Refusal, Command(name, "", 1))
        who.until_refused("a display may not send StatusRequest", StatusRequest())
        who.received.clear()
        who.until_refused("the left display may not report for the right station", Frames("right", ((1, 1, 1),), 0))
        return who

    def other_view(self) -> Intruder:
        who = self.at(channels.VIEW_RIGHT, self.credentials_of("display.left"), "")
        who.until_logged("channel view.right: address=127.0.0.1")
        return self.eavesdrop(who)

    def own_view(self) -> Intruder:
        """For comparison: the view that the authorised key receives."""
        who = self.at(channels.VIEW_RIGHT, self.credentials_of("display.right"), "")
        who.until_received(View)
        return who

    def revoked(self) -> Intruder:
        """A valid key is revoked by the command while the server runs."""
        lock = self.credentials_of("display.right")
        before = self.at(channels.CONTROL, lock, "display.right@early")
        before.until_received(Welcome, hello("display", "right"))
        done = CliRunner().invoke(app, ["keys", "revoke", "display.right", "-c", str(self.rig.file)])
        assert done.exit_code == 0, done.output
        who = self.at(channels.CONTROL, lock, "display.right@late")
        who.until_logged(": the key of display.right has been revoked", hello("display", "right"))
        before.socket.close()
        return who

    def replay(self) -> Intruder:
        """The bytes of an agent's whole session, captured on the wire, are sent again."""
        network = self.rig.config.network
        with wiretap(network.port + channels.MOTION) as (port, captured):
            taps = replace(network, port=port)
            endpoint = channels.addresses(taps, self.credentials_of("agent.left")).reach(channels.MOTION)
            agent = Intruder(self.rig, sockets.motion_agent(self.rig.context, endpoint, "agent.left@taped"))
            agent.until_received(Refusal, hello("agent", "left"), stylus(0))
            agent.socket.close()
        assert len(captured) > 500
        with net.create_connection(("127.0.0.1", network.port + channels.MOTION)) as replay_socket:
            replay_socket.settimeout(TIMEOUT)
            replay_socket.sendall(captured[:GREETING])
            greeting = read(replay_socket, GREETING)
            replay_socket.sendall(captured[GREETING : GREETING + HELLO_SIZE])
            cookie = read(replay_socket, COOKIE)
            replay_socket.sendall(captured[GREETING + HELLO_SIZE :])
            self.answered = greeting, cookie, read(replay_socket, 65_536)
        self.replayed = bytes(captured)
        return agent

    def eavesdrop(self, who: Intruder) -> Intruder:
        until = time.monotonic() + EAVESDROP_S
        while time.monotonic() < until:
            poller.wait_readable(who.socket, EAVESDROP_S)
            who.receive()
        return who


def read(end: net.socket, size: int) -> bytes:
    """Read a number of bytes, or fewer if the other end closes the connection."""
    data = b""
    with contextlib.suppress(ConnectionResetError):
        while len(data) < size and (chunk := end.recv(size - len(data))):
            data += chunk
    return data


@contextlib.contextmanager
def wiretap(port: int) -> Iterator[tuple[int, bytearray]]:
    """Relay between a peer and the server, and capture what the peer sends."""
    captured = bytearray()
    with net.create_server(("127.0.0.1", 0)) as listener:
        ends: list[net.socket] = []

        def forward(source: net.socket, sink: net.socket, capture: bytearray | None) -> None:
            with contextlib.suppress(OSError):
                while chunk := source.recv(65_536):
                    if capture is not None:
                        capture += chunk
                    sink.sendall(chunk)

        def relay() -> None:
            peer, _ = listener.accept()
            server = net.create_connection(("127.0.0.1", port))
            ends.extend((peer, server))
            back = threading.Thread(target=forward, args=(server, peer, None))
            back.start()
            forward(peer, server, captured)
            server.shutdown(net.SHUT_RDWR)
            back.join()

        thread = threading.Thread(target=relay)
        thread.start()
        yield listener.getsockname()[1], captured
        thread.join(TIMEOUT)
        for end in ends:
            end.close()


@dataclass
class Evidence:
    """Results of the attempts and state of the session before and after them."""

    found: dict[str, Intruder]
    attempts: Attempts
    before: Status
    after: Status
    reasons: list[dict[str, str]]
    recording: Path


ORDER = (
    "no_key",
    "wrong_server",
    "wrong_key",
    "wrong_role",
    "wrong_log",
    "wrong_side",
    "false_console",
    "wrong_hand",
    "wrong_name",
    "commands",
    "other_view",
    "own_view",
    "replay",
    "revoked",
)


@pytest.fixture(scope="module")
def evidence(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    with rig_with_keys(tmp_path_factory.mktemp("closed"), "block.trials=500") as rig:
        rig.start_all()
        before = rig.until(lambda s: s.phase == "running", COMPILE_TIMEOUT)
        attempts = Attempts(rig)
        found = {name: getattr(attempts, name)() for name in ORDER}
        tick = rig.until(lambda s: True).tick
        after = rig.until(lambda s: s.tick > tick + 200)
        (path,) = rig.finish()
        for who in found.values():
            who.socket.close()
    with Recording(path) as recording:
        reasons = [event.details for event in recording.events() if event.name == "refused"]
    return Evidence(found, attempts, before, after, reasons, path)


@pytest.mark.parametrize("name", ["no_key", "wrong_server", "wrong_key", "wrong_role", "wrong_log", "revoked"])
def test_unauthenticated_peer_neither_sends_nor_receives_a_message(evidence: Evidence, name: str) -> None:
    who = evidence.found[name]
    assert who.sent == 0
    assert who.received == []


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("wrong_side", "the key of display.left is not that of display.right"),
        ("false_console", "the key of display.left is not that of console"),
        ("wrong_hand", "the key of agent.right is not that of agent.left"),
        ("commands", "the left display may not report for the right station"),
    ],
)
def test_authenticated_peer_is_refused_beyond_its_rights_with_a_reason(
    evidence: Evidence, name: str, reason: str
) -> None:
    received = evidence.found[name].received
    assert any(isinstance(message, Refusal) and reason in message.reason for message in received)
    assert not any(isinstance(message, Welcome | Status) for message in received)


def test_display_key_cannot_receive_the_other_station_view(evidence: Evidence) -> None:
    assert evidence.found["other_view"].received == []
    assert {message.station for message in evidence.found["own_view"].received} == {"right"}


def test_replayed_session_ends_at_the_handshake(evidence: Evidence) -> None:
    """The server answers with its greeting and a fresh cookie, and then closes the connection."""
    greeting, cookie, rest = evidence.attempts.answered
    assert b"CURVE" in greeting
    assert b"WELCOME" in cookie
    assert rest == b""
    assert b"INITIATE" in evidence.attempts.replayed
    assert b"MESSAGE" in evidence.attempts.replayed
    assert struct.pack(">d", 0.123) not in evidence.attempts.replayed


@pytest.mark.parametrize(
    ("channel", "reason", "key_is_known"),
    [
        ("motion", "it has no key, or closed the connection", False),
        ("motion", "it has a wrong server key, or replayed a handshake", False),
        ("motion", "its key is not known here", True),
        ("motion", "the key of display.left is not for this channel", True),
        ("motion", "it calls itself agent.left@intruder", False),
        ("log", "the key of agent.left is not for this channel", True),
        ("view.right", "the key of display.left is not for this channel", True),
        ("control", "the key of display.right has been revoked", True),
    ],
)
def test_refused_handshakes_are_recorded(evidence: Evidence, channel: str, reason: str, *, key_is_known: bool) -> None:
    (first, *_) = [it for it in evidence.reasons if it.get("channel") == channel and reason in it["reason"]]
    if key_is_known:
        assert first["address"] == "127.0.0.1"
        assert len(first["key"]) == len("0123-4567-89ab-cdef")


@pytest.mark.parametrize(
    "reason",
    [
        "the key of display.left is not that of display.right",
        "the key of display.left is not that of console",
        "the key of agent.right is not that of agent.left",
        "a display may not send Command",
        "a display may not send StatusRequest",
        "the left display may not report for the right station",
    ],
)
def test_refused_messages_are_recorded(evidence: Evidence, reason: str) -> None:
    assert any(reason in it["reason"] for it in evidence.reasons)


def test_attempts_do_not_affect_the_session(evidence: Evidence) -> None:
    assert evidence.after.session == evidence.before.session
    assert evidence.after.tick > evidence.before.tick
    with Recording(evidence.recording) as recording:
        ticks = recording.ticks()
        events = [event.name for event in recording.events()]
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    for side in ("left", "right"):
        assert not (ticks[f"{side}_sent_z"] == 0.123).any()
    assert events.count("agent_joined") == 2
    assert "pause" not in events
