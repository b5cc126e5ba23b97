"""A peer that sends `Hello` is admitted despite a slow link, a slow server or floods of other peers."""

from collections import deque
from pathlib import Path

from fake_router import FakeRouter, hello
from log_rig import L, Rig, close_rig

from fakes import Answers, FakeClock
from netboard.base.config import Config, parse, resolve
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command, StatusRequest
from netboard.network.protocol.joining import Hello, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import EventRecord, LogRequest
from netboard.nodes.logger.logger import Logger
from netboard.nodes.ports.control_port import ALLOWED_MESSAGES, MAX_FRAMES, MAX_PEERS, ControlPort
from netboard.nodes.ports.control_port import SILENCE_TIMEOUT_NS as CONTROL_TIMEOUT_NS
from netboard.nodes.ports.log_port import MAX_LOGGERS
from netboard.nodes.ports.subscribers import SILENCE_TIMEOUT_NS
from netboard.nodes.ports.welcomes import RECEIVERS
from netboard.recording.files.reader import Recording

MS = 1_000_000


class SlowLink:
    """A log channel to a real port with a delay for each frame; waiting pumps the port as a session does."""

    def __init__(self, rig: Rig, delay: float) -> None:
        self._rig, self._delay_ns = rig, round(delay * 1e9)
        self._up: deque[tuple[int, bytes]] = deque()
        self._down: deque[tuple[int, bytes]] = deque()

    def wait(self, seconds: float) -> bool:
        rig = self._rig
        rig.clock.advance(seconds)
        now = rig.clock()
        while self._up and self._up[0][0] <= now:
            rig.router.incoming.append((L, self._up.popleft()[1]))
        rig.port.pump(now)
        self._down.extend((now + self._delay_ns, frame) for frame in rig.router.sent.pop(L, []))
        return bool(self._down) and self._down[0][0] <= now

    def receive(self) -> bytes | None:
        if self._down and self._down[0][0] <= self._rig.clock():
            return self._down.popleft()[1]
        return None

    def send(self, frame: bytes) -> bool:
        self._up.append((self._rig.clock() + self._delay_ns, frame))
        return True


def test_logger_joins_over_a_link_slower_than_its_hello_interval(tmp_path: Path) -> None:
    rig = Rig(tmp_path, capacity=50_000)
    config: Config = parse("", "test")
    rig.port.store._welcomes = [(0, Welcome("session", PROTOCOL_VERSION, 0, resolve(config)))]
    rig.port.append(encode(EventRecord(0, 0, 0, "session_started", {})))
    settings = Settings(directory=str(tmp_path / "recordings"))
    logger = Logger(settings, SlowLink(rig, 0.4), once=True, clock=rig.clock)
    for _ in range(500):  # ten seconds
        logger.step()
    assert rig.port.loggers == 1
    assert rig.port.store.backlog == 0, "every record is on disk"
    rig.port.end()
    for _ in range(500):
        logger.step()
    (path,) = logger.finished
    with Recording(path) as recording:
        assert [event.name for event in recording.events()] == ["session_started"]
    close_rig(rig)


def test_welcome_is_sent_once_a_full_queue_has_room(tmp_path: Path) -> None:
    rig = Rig(tmp_path, room=1)
    rig.router.sent[L] = [b"unread"]
    rig.router.send_from(L, hello("logger"))
    rig.port.pump(rig.clock())
    rig.router.sent.clear()
    assert isinstance(rig.pump(L)[0], Welcome)
    rig.pump(L, LogRequest(-1))
    assert rig.port.loggers == 1
    close_rig(rig)


def test_logger_that_repeats_hello_stays_connected(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.join(L)
    rig.pump(L, hello("logger", name=L.decode()))
    assert rig.port.loggers == 1
    close_rig(rig)


def test_logger_delayed_by_a_flood_does_not_count_as_silent(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.join(L)
    for _ in range(5 * MAX_FRAMES):
        rig.router.send_from(b"flood", b"\x00")
    rig.router.send_from(L, Pong(0, 0, 0))
    rig.clock.advance(SILENCE_TIMEOUT_NS * 1e-9 + 0.1)
    for _ in range(8):
        rig.port.pump(rig.clock())
    assert "logger_left" not in rig.names()
    assert rig.port.loggers == 1
    close_rig(rig)


class ControlRig:
    """A control port with a fake clock."""

    def __init__(self) -> None:
        self.router, self.clock = FakeRouter(), FakeClock()
        self.port = ControlPort(self.router, dict.fromkeys(RECEIVERS, Welcome("s", PROTOCOL_VERSION, 0, "")))  # type: ignore[arg-type]

    def tick(self) -> None:
        self.clock.advance(1e-3)
        self.port.drain(self.clock)
        self.port.answer(Answers())


def test_console_joins_during_a_flood_of_messages() -> None:
    rig = ControlRig()
    for number in range(50):
        for _ in range(20):
            rig.router.send_from(b"flood %d" % number, b"\x00")
    rig.router.send_from(b"console", hello("console"))
    for _ in range(300):
        rig.tick()
    assert isinstance(rig.router.received_by(b"console")[0], Welcome)


def test_new_peers_replace_only_silent_peers() -> None:
    rig = ControlRig()
    consoles = [b"console %d" % number for number in range(MAX_PEERS)]
    for name in consoles:
        rig.router.send_from(name, hello("console"))
        rig.tick()
    rig.router.send_from(b"late", hello("console"))
    rig.tick()
    assert isinstance(rig.router.received_by(b"late")[0], Refusal)
    rig.router.send_from(b"display", hello("display", "left"))
    rig.tick()
    assert isinstance(rig.router.received_by(b"display")[0], Welcome)
    rig.clock.advance(CONTROL_TIMEOUT_NS * 1e-9 + 1)
    rig.port.pump(rig.clock())
    rig.router.send_from(b"late", hello("console"))
    rig.tick()
    assert isinstance(rig.router.received_by(b"late")[0], Welcome)


def test_flooding_peer_is_refused_and_other_peers_are_answered() -> None:
    rig = ControlRig()
    for name in (b"greedy", b"console"):
        rig.router.send_from(name, hello("console"))
        rig.tick()
        rig.router.received_by(name)
    answered = 0
    for tick in range(1000):
        for _ in range(3):
            rig.router.send_from(b"greedy", StatusRequest())
        if tick % 100 == 0:
            rig.router.send_from(b"console", StatusRequest())
        rig.tick()
        answered += len(rig.router.received_by(b"console"))
    assert answered == 10
    assert rig.port.refusals.totals["too many messages"] > 2000


def test_surplus_commands_are_refused_except_the_emergency_stop() -> None:
    rig = ControlRig()
    rig.router.send_from(b"console", hello("console"))
    rig.tick()
    for number in range(30):
        rig.router.send_from(b"console", Command("note", "x", number))
    rig.router.send_from(b"console", Command("emergency_stop", "", 99))
    for _ in range(10):
        rig.tick()
    assert rig.port.requests[0].command.name == "emergency_stop"
    assert len(rig.port.requests) == 9
    assert rig.port.refusals.totals == {"too many commands at once": 22}


def test_emergency_stops_of_two_operators_at_once_are_both_recorded() -> None:
    rig = ControlRig()
    for name in (b"first", b"second"):
        rig.router.send_from(name, hello("console"))
        rig.tick()
    for name, command in ((b"first", "note"), *[(b"first", "emergency_stop")] * 2, (b"second", "emergency_stop")):
        rig.router.send_from(name, Command(command, "", 1))
        rig.tick()
    requests = [(request.who, request.command.name) for request in rig.port.requests]
    assert requests == [(b"first", "emergency_stop"), (b"second", "emergency_stop"), (b"first", "note")]


def test_only_hello_is_unpacked_from_unregistered_peers() -> None:
    assert Hello in ALLOWED_MESSAGES[""]
    rig = ControlRig()
    rig.router.send_from(b"x", b"\x97\x15\xc1")  # a report of frames, then invalid bytes
    rig.tick()
    assert rig.router.received_by(b"x") == [Refusal("it has not joined yet")]


def test_closed_connection_frees_its_place_at_once() -> None:
    rig = ControlRig()
    for number in range(MAX_PEERS):
        rig.router.send_from(b"guest %d" % number, hello("console"))
        rig.tick()
    rig.router.disconnected.add(b"guest 3")
    rig.router.send_from(b"console", hello("console"))
    for _ in range(30):
        rig.tick()
    assert isinstance(rig.router.received_by(b"console")[0], Welcome)


def test_all_closed_connections_free_their_places_at_once() -> None:
    rig = ControlRig()
    before = [b"guest %d" % number for number in range(MAX_PEERS)]
    for name in before:
        rig.router.send_from(name, hello("console"))
        rig.tick()
    rig.router.disconnected.update(before)
    consoles = [b"console %d" % number for number in range(3)]
    for name in consoles:
        rig.router.send_from(name, hello("console"))
    rig.tick()
    assert [type(rig.router.received_by(name)[0]) for name in consoles] == [Welcome] * 3


def test_closed_connection_of_a_logger_frees_its_place_at_once(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    for number in range(MAX_LOGGERS):
        rig.pump(b"guest %d" % number, hello("logger", name=str(number)))
    assert rig.pump(L, hello("logger")) == [Refusal("too many loggers")]
    rig.router.disconnected.add(b"guest 3")
    assert isinstance(rig.pump(L, hello("logger"))[0], Welcome)
    close_rig(rig)
