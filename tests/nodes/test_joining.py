"""A peer that sends `Hello` is admitted, however slow its link or its server, and whatever others send."""

from collections import deque
from pathlib import Path

from fake_router import FakeRouter, hello
from log_rig import L, Rig, end

from fakes import Answers, FakeClock
from netboard.base.config import Config, parse, resolve
from netboard.base.tables.rig import Recording as Settings
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command, StatusRequest
from netboard.network.protocol.joining import Hello, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import EventRecord, LogRequest
from netboard.nodes.logger.logger import Logger
from netboard.nodes.ports.control_port import ALLOWED_MESSAGES, MAX_FRAMES, MAX_PEERS, ControlPort
from netboard.nodes.ports.control_port import SILENCE_TIMEOUT_NS as CONTROL_TIMEOUT_NS
from netboard.nodes.ports.log_port import MAX_LOGGERS, SILENCE_TIMEOUT_NS
from netboard.recording.files.reader import Recording

MS = 1_000_000


class SlowLink:
    """The log channel to a real port, over which every frame takes its time; the port is pumped as a session does."""

    def __init__(self, rig: Rig, delay: float) -> None:
        self._rig, self._delay_ns = rig, round(delay * 1e9)
        self._up: deque[tuple[int, bytes]] = deque()
        self._down: deque[tuple[int, bytes]] = deque()

    def wait(self, seconds: float) -> bool:
        rig = self._rig
        rig.clock.advance(seconds)
        now = rig.clock()
        while self._up and self._up[0][0] <= now:
            rig.router.arrived.append((L, self._up.popleft()[1]))
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
    assert rig.port.store.backlog == 0, "it has brought to disk what there is"
    rig.port.end()
    for _ in range(500):
        logger.step()
    (path,) = logger.finished
    with Recording(path) as recording:
        assert [event.name for event in recording.events()] == ["session_started"]
    end(rig)


def test_welcome_is_sent_once_a_full_queue_has_room(tmp_path: Path) -> None:
    rig = Rig(tmp_path, room=1)
    rig.router.sent[L] = [b"waits to be read"]
    rig.router.say(L, hello("logger"))
    rig.port.pump(rig.clock())
    rig.router.sent.clear()
    assert isinstance(rig.pump(L)[0], Welcome)
    rig.pump(L, LogRequest(-1))
    assert rig.port.loggers == 1
    end(rig)


def test_logger_that_repeats_hello_stays_connected(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.join(L)
    rig.pump(L, hello("logger", name=L.decode()))
    assert rig.port.loggers == 1
    end(rig)


def test_logger_delayed_by_a_flood_does_not_count_as_silent(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.join(L)
    for _ in range(5 * MAX_FRAMES):
        rig.router.say(b"flood", b"\x00")
    rig.router.say(L, Pong(0, 0, 0))
    rig.clock.advance(SILENCE_TIMEOUT_NS * 1e-9 + 0.1)
    for _ in range(8):
        rig.port.pump(rig.clock())
    assert "logger_left" not in rig.names()
    assert rig.port.loggers == 1
    end(rig)


class Control:
    """A control port under a clock of the test's."""

    def __init__(self) -> None:
        self.router, self.clock = FakeRouter(), FakeClock()
        self.port = ControlPort(self.router, Welcome("s", PROTOCOL_VERSION, 0, ""))  # type: ignore[arg-type]

    def tick(self) -> None:
        self.clock.advance(1e-3)
        self.port.drain(self.clock)
        self.port.answer(Answers())


def test_console_joins_during_a_flood_of_messages() -> None:
    rig = Control()
    for number in range(50):
        for _ in range(20):
            rig.router.say(b"flood %d" % number, b"\x00")
    rig.router.say(b"console", hello("console"))
    for _ in range(300):
        rig.tick()
    assert isinstance(rig.router.heard(b"console")[0], Welcome)


def test_new_peers_replace_only_silent_peers() -> None:
    rig = Control()
    consoles = [b"console %d" % number for number in range(MAX_PEERS)]
    for name in consoles:
        rig.router.say(name, hello("console"))
        rig.tick()
    rig.router.say(b"late", hello("console"))
    rig.tick()
    assert isinstance(rig.router.heard(b"late")[0], Refusal)
    rig.router.say(b"display", hello("display", "left"))
    rig.tick()
    assert isinstance(rig.router.heard(b"display")[0], Welcome)
    rig.clock.advance(CONTROL_TIMEOUT_NS * 1e-9 + 1)
    rig.port.pump(rig.clock())
    rig.router.say(b"late", hello("console"))
    rig.tick()
    assert isinstance(rig.router.heard(b"late")[-1], Welcome)


def test_flooding_peer_is_refused_and_other_peers_are_answered() -> None:
    rig = Control()
    for name in (b"greedy", b"console"):
        rig.router.say(name, hello("console"))
        rig.tick()
        rig.router.heard(name)
    answered = 0
    for tick in range(1000):
        for _ in range(3):
            rig.router.say(b"greedy", StatusRequest())
        if tick % 100 == 0:
            rig.router.say(b"console", StatusRequest())
        rig.tick()
        answered += len(rig.router.heard(b"console"))
    assert answered == 10
    assert rig.port.refusals.totals["too many messages"] > 2000


def test_surplus_commands_are_refused_except_the_emergency_stop() -> None:
    rig = Control()
    rig.router.say(b"console", hello("console"))
    rig.tick()
    for number in range(30):
        rig.router.say(b"console", Command("note", "x", number))
    rig.router.say(b"console", Command("emergency_stop", "", 99))
    for _ in range(10):
        rig.tick()
    assert rig.port.requests[0].command.name == "emergency_stop"
    assert len(rig.port.requests) == 9
    assert rig.port.refusals.totals == {"too many commands at once": 22}


def test_only_hello_is_unpacked_from_unregistered_peers() -> None:
    assert Hello in ALLOWED_MESSAGES[""]
    rig = Control()
    rig.router.say(b"x", b"\x97\x15\xc1")  # a report of frames, and then nonsense
    rig.tick()
    assert rig.router.heard(b"x") == [Refusal("say hello first")]


def test_closed_connection_frees_its_place_at_once() -> None:
    rig = Control()
    for number in range(MAX_PEERS):
        rig.router.say(b"guest %d" % number, hello("console"))
        rig.tick()
    rig.router.gone.add(b"guest 3")
    rig.router.say(b"console", hello("console"))
    for _ in range(30):
        rig.tick()
    assert isinstance(rig.router.heard(b"console")[0], Welcome)


def test_all_closed_connections_free_their_places_at_once() -> None:
    rig = Control()
    before = [b"guest %d" % number for number in range(MAX_PEERS)]
    for name in before:
        rig.router.say(name, hello("console"))
        rig.tick()
    rig.router.gone.update(before)
    consoles = [b"console %d" % number for number in range(3)]
    for name in consoles:
        rig.router.say(name, hello("console"))
    rig.tick()
    assert [type(rig.router.heard(name)[0]) for name in consoles] == [Welcome] * 3


def test_closed_connection_of_a_logger_frees_its_place_at_once(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    for number in range(MAX_LOGGERS):
        rig.pump(b"guest %d" % number, hello("logger", name=str(number)))
    assert rig.pump(L, hello("logger")) == [Refusal("too many loggers")]
    rig.router.gone.add(b"guest 3")
    assert isinstance(rig.pump(L, hello("logger"))[0], Welcome)
    end(rig)
