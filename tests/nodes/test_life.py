"""Whoever is simulated at a device begins anew with each block, and only then."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import pytest

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side, parse, resolve
from netboard.base.errors import ConfigError
from netboard.network.transport import sockets
from netboard.nodes.agent.stylus_source import Life, Limb, Person
from netboard.nodes.operator.launcher import free_port
from netboard.participants.submovement import Submovement

PATIENCE = 60.0
"""What is waited for is there long before, on a busy machine too [s]."""


class Held:
    """A device that is held, and does nothing."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self.felt = 0.0

    def live(self, now_ns: int) -> None:
        """Nothing happens."""

    def command(self, moves: Iterable[Submovement]) -> None:
        """Nothing is done."""


def block(config: Config, number: int, configuration: str) -> str:
    return resolve(
        replace(config, block=replace(config.block, number=number, blocks=99, configuration=configuration))  # type: ignore[arg-type]
    )


@pytest.fixture
def config() -> Config:
    return parse("", "test", (f"network.port={free_port()}",))


@pytest.fixture
def live(config: Config) -> Iterator[Callable[[Side], Life]]:
    """Lets somebody live at a side; the sockets are closed with their context."""
    with sockets.open_context() as context:
        lives = []

        def made(side: Side) -> Life:
            lives.append(Life(config, Held(side), context))  # type: ignore[arg-type]
            return lives[-1]

        yield made


def begin(life: Life, text: str) -> None:
    """Let a block begin, and step until its configuration has been read."""
    life.begin(text)
    until = time.monotonic() + PATIENCE
    while life._told is not None:
        assert time.monotonic() < until
        life.step(now_ns(), haptics=True)


@pytest.mark.parametrize("side", ["left", "right"])
def test_who_lives_at_a_device_follows_the_blocks(side: Side, config: Config, live: Callable[[Side], Life]) -> None:
    life = live(side)
    hand = Person if side == "left" else Limb
    for number, configuration in enumerate(("dyadic", "bimanual", "bimanual", "dyadic", "bimanual"), start=1):
        begin(life, block(config, number, configuration))
        assert type(life._who) is (Person if configuration == "dyadic" else hand)
        life.step(number * 1_000_000, haptics=True)


def test_for_the_same_block_nobody_begins_anew(config: Config, live: Callable[[Side], Life]) -> None:
    life = live("left")
    begin(life, block(config, 2, "dyadic"))
    who = life._who
    begin(life, block(config, 2, "dyadic"))
    assert life._who is who
    begin(life, block(config, 3, "dyadic"))
    assert life._who is not who


def test_the_nerve_of_one_bimanual_block_is_that_of_the_next(config: Config, live: Callable[[Side], Life]) -> None:
    life = live("left")
    nerves = set()
    for number in range(1, 30):
        begin(life, block(config, number, "bimanual" if number % 5 else "dyadic"))
        nerves |= {life._nerve} - {None}
    assert len(nerves) == 1


def test_a_configuration_that_is_none_ends_the_agent(live: Callable[[Side], Life]) -> None:
    with pytest.raises(ConfigError, match="the server's configuration"):
        begin(live("left"), "[nonsense]\n")
