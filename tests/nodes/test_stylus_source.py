"""The simulated participant at a device is re-created for each new block, and only then."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import pytest

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side, parse, resolve
from netboard.base.errors import ConfigError
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.stylus_source import LiveController, LiveParticipant, SecondHand
from netboard.participants.people.submovement import Submovement

TIMEOUT = 60.0
"""Timeout, far above the usual time [s]."""


class StillDevice:
    """A device in a simulated hand that does not move."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self.felt = 0.0

    def live(self, now_ns: int) -> None:
        """Do nothing."""

    def command(self, moves: Iterable[Submovement]) -> None:
        """Do nothing."""


def block(config: Config, number: int, configuration: str) -> str:
    return resolve(
        replace(config, block=replace(config.block, number=number, blocks=99, configuration=configuration))  # type: ignore[arg-type]
    )


@pytest.fixture
def config() -> Config:
    return parse("", "test", (f"network.port={free_port()}",))


@pytest.fixture
def create(config: Config) -> Iterator[Callable[[Side], LiveParticipant]]:
    """Creates participants; their sockets are closed with the context."""
    with sockets.open_context() as context:
        created = []

        def new(side: Side) -> LiveParticipant:
            created.append(LiveParticipant(config, StillDevice(side), context))  # type: ignore[arg-type]
            return created[-1]

        yield new


def begin(participant: LiveParticipant, text: str) -> None:
    """Begin a block, and step until its configuration has been read."""
    participant.begin(text)
    until = time.monotonic() + TIMEOUT
    while participant._configuration is not None:
        assert time.monotonic() < until
        participant.step(now_ns(), haptics=True)


@pytest.mark.parametrize("side", ["left", "right"])
def test_participant_follows_the_configuration_of_the_blocks(
    side: Side, config: Config, create: Callable[[Side], LiveParticipant]
) -> None:
    participant = create(side)
    hand = LiveController if side == "left" else SecondHand
    for number, configuration in enumerate(("dyadic", "bimanual", "bimanual", "dyadic", "bimanual"), start=1):
        begin(participant, block(config, number, configuration))
        assert type(participant._current) is (LiveController if configuration == "dyadic" else hand)
        participant.step(number * 1_000_000, haptics=True)


def test_same_block_keeps_the_participant(config: Config, create: Callable[[Side], LiveParticipant]) -> None:
    participant = create("left")
    begin(participant, block(config, 2, "dyadic"))
    before = participant._current
    begin(participant, block(config, 2, "dyadic"))
    assert participant._current is before
    begin(participant, block(config, 3, "dyadic"))
    assert participant._current is not before


def test_all_bimanual_blocks_share_one_channel_to_the_second_hand(
    config: Config, create: Callable[[Side], LiveParticipant]
) -> None:
    participant = create("left")
    bound = set()
    for number in range(1, 30):
        begin(participant, block(config, number, "bimanual" if number % 5 else "dyadic"))
        bound |= {participant._moves} - {None}
    assert len(bound) == 1


def test_invalid_configuration_ends_the_agent(create: Callable[[Side], LiveParticipant]) -> None:
    with pytest.raises(ConfigError, match="the server's configuration"):
        begin(create("left"), "[nonsense]\n")
