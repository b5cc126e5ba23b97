"""The stylus source of a player at the display: pointers in, forces out, over real sockets."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from netboard.base.config import Config, parse
from netboard.base.tables.rig import Network
from netboard.devices.mouse import MouseStylus
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Felt, Pointer
from netboard.network.transport import channels, sockets
from netboard.network.transport.fastpath import Receiver
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.stylus_source import PlayerSource, stylus_source_of
from waiting import until

pytestmark = pytest.mark.integration

MS = 1_000_000


class RecordedReceiver:
    """Keeps what a receiver has received."""

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver
        self.frames: list[bytes] = []

    def receive(self) -> bytes | None:
        frame = self._receiver.receive()
        self.frames += [] if frame is None else [frame]
        return frame


class Station:
    """A stylus, its source and the display's ends of the two channels; each step advances the time by 1 ms."""

    def __init__(self, config: Config, context: sockets.Context) -> None:
        self.device = MouseStylus("left", config)
        self.device.open()
        player = stylus_source_of(config, self.device, context)
        assert isinstance(player, PlayerSource)
        self.player = player
        where = channels.addresses(config.network)
        self.pointer = sockets.pointer_sender(context, where.pointer("left"))
        self.felt = sockets.felt_subscriber(context, where.felt("left"))
        self.now_ns = 0

    def step(self) -> None:
        self.now_ns += MS
        self.player.step(self.now_ns, True)
        self.device.read(self.now_ns)

    def until(self, condition: Callable[[], bool]) -> None:
        until(condition, self.step)

    def send(self, message: Message | bytes) -> bool:
        """Send a message once, and return whether it was sent. It may be lost, because only the newest counts."""
        return sockets.send(self.pointer, message if isinstance(message, bytes) else encode(message))

    def send_until(self, condition: Callable[[], bool], message: Message) -> None:
        """Send a message repeatedly until a condition holds."""
        self.until(lambda: self.send(message) and condition())

    def ready(self) -> bool:
        return self.device.read(self.now_ns).ready


@pytest.fixture
def station() -> Iterator[Station]:
    config = parse("", overrides=["agents.left.device=mouse"])
    with sockets.open_context() as context:
        yield Station(replace(config, network=Network(port=free_port())), context)


def test_stylus_follows_the_pointer(station: Station) -> None:
    station.send_until(lambda: abs(station.device.read(station.now_ns).z - 0.02) < 1e-6, Pointer("left", 0.02))
    assert station.ready()


def test_device_without_a_pointer_is_not_ready(station: Station) -> None:
    station.send_until(station.ready, Pointer("left", 0.0))
    station.send_until(lambda: not station.ready(), Pointer("left", None))


@pytest.mark.parametrize(
    "invalid",
    [Pointer("right", 0.03), Pointer("left", math.nan), Pointer("left", math.inf), Goodbye("done"), b"", b"\xc1"],
)
def test_invalid_messages_do_not_move_the_stylus(station: Station, invalid: Message | bytes) -> None:
    station.send_until(station.ready, Pointer("left", 0.01))
    frame = invalid if isinstance(invalid, bytes) else encode(invalid)
    station.player._pointer = received = RecordedReceiver(station.player._pointer)  # type: ignore[assignment]
    station.until(lambda: station.send(frame) and frame in received.frames)
    assert abs(station.device.read(station.now_ns).z) <= 0.01
    station.send_until(lambda: abs(station.device.read(station.now_ns).z - 0.01) < 1e-6, Pointer("left", 0.01))


def test_player_receives_the_rendered_force(station: Station) -> None:
    station.device.write(0.0, 0.0, -0.5)
    received: list[bytes] = []

    def receive() -> bool:
        frame = sockets.receive(station.felt)
        received.extend([] if frame is None else [frame])
        return bool(received)

    station.until(receive)
    assert decode(received[0]) == Felt("left", -0.5)
