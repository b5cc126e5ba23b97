"""A server with keys refuses every kind of unauthorised peer, and reports and records it.

One session is played; the attempts are made while a trial runs in it, and the tests look at what came of them.
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

from netboard.benchmarks.faults.rigs import TIMEOUT, Rig
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
GREETING, FIRST_WORD, COOKIE = 64, 202, 170
"""Sizes of what is said first in a handshake with keys, by ZeroMQ's RFCs 23 and 26 [bytes]."""
TO_COMPILE = 180.0
"""A server on a busy machine that has to compile its kernels first is there by then [s]."""
EAVESDROP_S = 0.5
"""So long it is listened for what must not come [s]."""


def rig_with_keys(folder: Path, *settings: str) -> Rig:
    """A rig whose keys are all in one folder, as on one machine."""
    keys.init(folder / "keys")
    for role, _, side in (peer.partition(".") for peer in PEERS):
        keys.add(folder / "keys", role, side, folder / "keys")  # type: ignore[arg-type]
    soon_level = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0")
    return Rig(folder, ("network.curve=on", f"network.keys={folder / 'keys'}", *soon_level, *settings))


def hello(role: str, side: str) -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, "intruder:1", "0", {})


def stylus(seq: int) -> Stylus:
    """A sample far from where any hand is."""
    now = time.monotonic_ns()
    return Stylus(seq, now, 0.0, 0.0, 0.123, 0.0, 0.0, 0.0, 0, 1, 0.0, -1, 0, 0, now, 0)


@dataclass
class Intruder:
    """Somebody at a channel: what was said, and what came back."""

    rig: Rig
    socket: sockets.Socket
    heard: list[Message] = field(default_factory=list)
    sent: int = 0

    def listen(self) -> None:
        while (frame := sockets.receive(self.socket)) is not None:
            self.heard.append(decode(frame))

    def say_until(self, what: Callable[[], bool], *messages: Message) -> None:
        """Say something again and again until it has had an effect."""
        end = time.monotonic() + TIMEOUT
        while not what():
            assert time.monotonic() < end, self.rig.said("server")
            for message in messages:
                self.sent += sockets.send(self.socket, encode(message))
            time.sleep(0.01)
            self.listen()

    def until_told(self, reason: str, *messages: Message) -> None:
        """Until the server has said why not, be it let in or not."""
        self.say_until(lambda: reason in self.rig.said("server"), *messages)

    def until_refused(self, reason: str, *messages: Message) -> None:
        """Until the server has answered why not; what of it comes first may be refused for another reason."""

        def answered() -> bool:
            return any(isinstance(message, Refusal) and reason in message.reason for message in self.heard)

        self.say_until(answered, *messages)

    def until_heard(self, kind: type, *messages: Message) -> None:
        """Until an answer of a kind has come."""
        self.say_until(lambda: any(isinstance(message, kind) for message in self.heard), *messages)


class Attempts:
    """All that is tried on one rig, each attempt by its name."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.folder = Path(rig.config.network.keys)
        self.server_key = keys.credentials(self.folder, "console").server

    def at(self, channel: int, lock: authenticator.Credentials | None, name: str) -> Intruder:
        """Somebody with some key, or none, at a channel."""
        endpoint = channels.addresses(self.rig.config.network, lock).reach(channel)
        makers = {channels.MOTION: sockets.motion_agent, channels.LOG: sockets.log_client}
        if channel in channels.VIEW.values():
            return Intruder(self.rig, sockets.view_subscriber(self.rig.context, endpoint))
        make = makers.get(channel, sockets.control_client)
        return Intruder(self.rig, make(self.rig.context, endpoint, name))

    def own(self, peer: str) -> authenticator.Credentials:
        return keys.credentials(self.folder, peer)

    def stranger(self) -> authenticator.Credentials:
        """A key of one's own making, and the right one of the server, which is no secret."""
        return authenticator.Credentials(*authenticator.new_keys(), self.server_key)

    def no_key(self) -> Intruder:
        who = self.at(channels.MOTION, None, "agent.left@intruder")
        who.until_told(
            "channel=motion reason=it has no key, or closed the connection", hello("agent", "left"), stylus(0)
        )
        return who

    def wrong_server(self) -> Intruder:
        """Who does not know the server's key cannot be sure to whom he speaks, and is not heard."""
        lock = replace(self.own("agent.left"), server=authenticator.new_keys()[0])
        who = self.at(channels.MOTION, lock, "agent.left@intruder")
        who.until_told("channel=motion reason=it has a wrong server key", hello("agent", "left"))
        return who

    def wrong_key(self) -> Intruder:
        lock = self.stranger()
        who = self.at(channels.MOTION, lock, "agent.left@intruder")
        told = f"channel=motion address=127.0.0.1 key={keys.fingerprint(lock.public)} reason=its key is not known here"
        who.until_told(told, hello("agent", "left"), stylus(0))
        return who

    def wrong_role(self) -> Intruder:
        who = self.at(channels.MOTION, self.own("display.left"), "agent.left@intruder")
        told = "reason=the key of display.left is not for this channel"
        who.until_told(told, hello("agent", "left"), stylus(0))
        return who

    def wrong_log(self) -> Intruder:
        who = self.at(channels.LOG, self.own("agent.left"), "logger@intruder")
        who.until_told("channel=log address=127.0.0.1", hello("logger", ""))
        return who

    def wrong_side(self) -> Intruder:
        """A display says that it is the other station's."""
        who = self.at(channels.CONTROL, self.own("display.left"), "display.left@intruder")
        who.until_refused("the key of display.left is not that of display.right", hello("display", "right"))
        return who

    def wrong_rank(self) -> Intruder:
        """A display says that it is the operator."""
        who = self.at(channels.CONTROL, self.own("display.left"), "display.left@upstart")
        who.until_refused("the key of display.left is not that of console", hello("console", ""))
        who.until_heard(Refusal, Command("end", "", 1))
        return who

    def wrong_hand(self) -> Intruder:
        """An agent says that it is the other hand's, and moves it."""
        who = self.at(channels.MOTION, self.own("agent.right"), "agent.right@intruder")
        reason = "the key of agent.right is not that of agent.left"
        who.until_refused(reason, hello("agent", "left"), stylus(10_000_000))
        return who

    def wrong_name(self) -> Intruder:
        """An agent speaks in the other one's name."""
        who = self.at(channels.MOTION, self.own("agent.right"), "agent.left@intruder")
        who.until_told("reason=it calls itself agent.left@intruder", hello("agent", "left"), stylus(10_000_000))
        return who

    def commands(self) -> Intruder:
        """A display that has been welcomed gives commands."""
        who = self.at(channels.CONTROL, self.own("display.left"), "display.left@rebel")
        who.until_heard(Welcome, hello("display", "left"))
        for name in ("pause", "stop", "end"):
            who.heard.clear()
            who.until_heard(Refusal, Command(name, "", 1))
        who.until_refused("a display may not send StatusRequest", StatusRequest())
        who.heard.clear()
        who.until_refused("the left display may not report for the right station", Frames("right", ((1, 1, 1),), 0))
        return who

    def other_view(self) -> Intruder:
        who = self.at(channels.VIEW_RIGHT, self.own("display.left"), "")
        who.until_told("channel=view.right address=127.0.0.1")
        return self.eavesdrop(who)

    def own_view(self) -> Intruder:
        """For comparison: what comes at once to the key that may."""
        who = self.at(channels.VIEW_RIGHT, self.own("display.right"), "")
        who.until_heard(View)
        return who

    def revoked(self) -> Intruder:
        """A key that was good is revoked while the server runs, by the command."""
        lock = self.own("display.right")
        before = self.at(channels.CONTROL, lock, "display.right@early")
        before.until_heard(Welcome, hello("display", "right"))
        done = CliRunner().invoke(app, ["keys", "revoke", "display.right", "-c", str(self.rig.file)])
        assert done.exit_code == 0, done.output
        who = self.at(channels.CONTROL, lock, "display.right@late")
        who.until_told("reason=the key of display.right has been revoked", hello("display", "right"))
        return who

    def replay(self) -> Intruder:
        """The bytes of a whole session of an agent, recorded on the wire, are sent again."""
        network = self.rig.config.network
        with wiretap(network.port + channels.MOTION) as (port, said):
            taps = replace(network, port=port)
            endpoint = channels.addresses(taps, self.own("agent.left")).reach(channels.MOTION)
            agent = Intruder(self.rig, sockets.motion_agent(self.rig.context, endpoint, "agent.left@taped"))
            agent.until_heard(Refusal, hello("agent", "left"), stylus(0))
            agent.socket.close()
        assert len(said) > 500
        with net.create_connection(("127.0.0.1", network.port + channels.MOTION)) as again:
            again.settimeout(TIMEOUT)
            again.sendall(said[:GREETING])
            greeting = read(again, GREETING)
            again.sendall(said[GREETING : GREETING + FIRST_WORD])
            cookie = read(again, COOKIE)
            again.sendall(said[GREETING + FIRST_WORD :])
            self.answered = greeting, cookie, read(again, 65_536)
        self.replayed = bytes(said)
        return agent

    def eavesdrop(self, who: Intruder) -> Intruder:
        until = time.monotonic() + EAVESDROP_S
        while time.monotonic() < until:
            poller.wait_readable(who.socket, EAVESDROP_S)
            who.listen()
        return who


def read(end: net.socket, size: int) -> bytes:
    """So many bytes, or what there is before the other end hangs up."""
    got = b""
    with contextlib.suppress(ConnectionResetError):
        while len(got) < size and (some := end.recv(size - len(got))):
            got += some
    return got


@contextlib.contextmanager
def wiretap(port: int) -> Iterator[tuple[int, bytearray]]:
    """Stand between a peer and a server, and keep what the peer says."""
    said = bytearray()
    with net.create_server(("127.0.0.1", 0)) as door:
        ends: list[net.socket] = []

        def carry(source: net.socket, sink: net.socket, keep: bytearray | None) -> None:
            with contextlib.suppress(OSError):
                while some := source.recv(65_536):
                    if keep is not None:
                        keep += some
                    sink.sendall(some)

        def stand_between() -> None:
            peer, _ = door.accept()
            server = net.create_connection(("127.0.0.1", port))
            ends.extend((peer, server))
            back = threading.Thread(target=carry, args=(server, peer, None))
            back.start()
            carry(peer, server, said)
            server.shutdown(net.SHUT_RDWR)
            back.join()

        thread = threading.Thread(target=stand_between)
        thread.start()
        yield door.getsockname()[1], said
        thread.join(TIMEOUT)
        for end in ends:
            end.close()


@dataclass
class Evidence:
    """What came of it all."""

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
    "wrong_rank",
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
        before = rig.until(lambda s: s.phase == "running", TO_COMPILE)
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
def test_who_is_not_let_in_gets_no_word_through_and_hears_none(evidence: Evidence, name: str) -> None:
    who = evidence.found[name]
    assert who.sent == 0
    assert who.heard == []


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("wrong_side", "the key of display.left is not that of display.right"),
        ("wrong_rank", "the key of display.left is not that of console"),
        ("wrong_hand", "the key of agent.right is not that of agent.left"),
        ("commands", "the left display may not report for the right station"),
    ],
)
def test_who_is_let_in_and_goes_too_far_is_told_so(evidence: Evidence, name: str, reason: str) -> None:
    heard = evidence.found[name].heard
    assert any(isinstance(message, Refusal) and reason in message.reason for message in heard)
    assert not any(isinstance(message, Welcome | Status) for message in heard)


def test_the_view_of_the_other_station_stays_dark(evidence: Evidence) -> None:
    assert evidence.found["other_view"].heard == []
    assert {message.station for message in evidence.found["own_view"].heard} == {"right"}


def test_a_replayed_session_ends_at_the_handshake(evidence: Evidence) -> None:
    """The server answers with its greeting and a cookie that it makes anew each time, and then hangs up."""
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
def test_every_refused_handshake_is_in_the_recording(
    evidence: Evidence, channel: str, reason: str, *, key_is_known: bool
) -> None:
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
def test_every_refused_word_is_in_the_recording(evidence: Evidence, reason: str) -> None:
    assert any(reason in it["reason"] for it in evidence.reasons)


def test_the_session_went_on_as_if_nobody_had_come(evidence: Evidence) -> None:
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
