"""The stylus source of a player at the display: pointers in, forces out, over real sockets."""

import math
import time
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
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.stylus_source import Player, stylus_source_of

pytestmark = pytest.mark.integration

MS = 1_000_000
TIMEOUT = 30.0


class Station:
    """A stylus and its source, and the display's ends of the two channels; time goes on by itself, 1 ms a step."""

    def __init__(self, config: Config, context: sockets.Context) -> None:
        self.device = MouseStylus("left", config)
        self.device.open()
        player = stylus_source_of(config, self.device, context)
        assert isinstance(player, Player)
        self.player = player
        where = channels.addresses(config.network)
        self.pointer = sockets.pointer_sender(context, where.pointer("left"))
        self.felt = sockets.felt_subscriber(context, where.felt("left"))
        self.now_ns = 0

    def step(self) -> None:
        self.now_ns += MS
        self.player.step(self.now_ns, True)
        self.device.read(self.now_ns)

    def until(self, true: Callable[[], bool]) -> None:
        end = time.monotonic() + TIMEOUT
        while not true():
            assert time.monotonic() < end, "waited in vain"
            self.step()
            time.sleep(0.001)

    def say(self, message: Message | bytes) -> bool:
        """Say it once, which may be lost: of what a player points at only the newest counts; whether it was sent."""
        return sockets.send(self.pointer, message if isinstance(message, bytes) else encode(message))

    def say_until(self, true: Callable[[], bool], message: Message) -> None:
        """Go on saying it until something is true."""
        self.until(lambda: self.say(message) and true())

    def ready(self) -> bool:
        return self.device.read(self.now_ns).ready


@pytest.fixture
def station() -> Iterator[Station]:
    config = parse("", overrides=["agents.left.device=mouse"])
    with sockets.open_context() as context:
        yield Station(replace(config, network=Network(port=free_port())), context)


def test_stylus_follows_the_pointer(station: Station) -> None:
    station.say_until(lambda: abs(station.device.read(station.now_ns).z - 0.02) < 1e-6, Pointer("left", 0.02))
    assert station.ready()


def test_device_without_a_pointer_is_not_ready(station: Station) -> None:
    station.say_until(station.ready, Pointer("left", 0.0))
    station.say_until(lambda: not station.ready(), Pointer("left", None))


@pytest.mark.parametrize(
    "odd", [Pointer("right", 0.03), Pointer("left", math.nan), Pointer("left", math.inf), Goodbye("done"), b"", b"\xc1"]
)
def test_invalid_messages_do_not_move_the_stylus(station: Station, odd: Message | bytes) -> None:
    station.say_until(station.ready, Pointer("left", 0.01))
    for _ in range(50):
        station.say(odd)
        station.step()
        time.sleep(0.001)
    assert abs(station.device.read(station.now_ns).z) <= 0.01
    station.say_until(lambda: abs(station.device.read(station.now_ns).z - 0.01) < 1e-6, Pointer("left", 0.01))


def test_player_receives_the_rendered_force(station: Station) -> None:
    station.device.write(0.0, 0.0, -0.5)
    heard: list[bytes] = []

    def listen() -> bool:
        frame = sockets.receive(station.felt)
        heard.extend([] if frame is None else [frame])
        return bool(heard)

    station.until(listen)
    assert decode(heard[0]) == Felt("left", -0.5)
