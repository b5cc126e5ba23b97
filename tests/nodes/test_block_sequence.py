"""The blocks of a session, prepared before its first tick."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.nodes.server.answers import words_of
from netboard.nodes.server.blocks import BlockSequence
from netboard.task.trials.state_machine import Phase

BLOCKS = (
    ("block.force=full",),
    ("block.force=none", "block.rest=30", "block.trials=7"),
    ("block.left=robot", "physics.M=0.02"),
    ("block.configuration=bimanual", "block.station=right"),
)


def configs(session: Session | None = None) -> list[Config]:
    created = []
    for number, settings in enumerate(BLOCKS, start=1):
        config = parse("", "test", ("session.pilot=true", f"block.blocks={len(BLOCKS)}", *settings))
        config = replace(config, block=replace(config.block, number=number))
        created.append(replace(config, session=session or config.session))
    return created


class BlockFactory:
    """Creates the blocks again, and stores the sessions that it was called with."""

    def __init__(self) -> None:
        self.sessions: list[Session] = []

    def __call__(self, session: Session) -> Sequence[Config]:
        self.sessions.append(session)
        return configs(session)


def test_blocks_follow_in_order() -> None:
    sequence = BlockSequence(configs(), BlockFactory())
    assert sequence.planned
    found = []
    while True:
        found.append((sequence.block.config.block.number, sequence.last))
        if sequence.last:
            break
        assert sequence.next() is sequence.block
    assert found == [(1, False), (2, False), (3, False), (4, True)]


def test_blocks_ahead_are_those_that_follow() -> None:
    sequence = BlockSequence(configs(), BlockFactory())
    assert [config.block.number for config in sequence.ahead(2)] == [2, 3]
    sequence.next()
    sequence.next()
    assert [words_of(config) for config in sequence.ahead(9)] == ["bimanual, force full"]
    sequence.next()
    assert sequence.ahead(2) == []


def test_resumed_session_starts_at_a_later_block() -> None:
    sequence = BlockSequence(configs(), BlockFactory(), 2)
    assert sequence.block.config.block.number == 3
    assert sequence.next().config.block.number == 4
    assert sequence.last


def test_single_block_is_not_a_plan() -> None:
    sequence = BlockSequence(configs()[:1])
    assert not sequence.planned
    assert sequence.last


def test_each_block_is_prepared() -> None:
    sequence = BlockSequence(configs(), BlockFactory())
    blocks = [sequence.block, *(sequence.next() for _ in range(3))]
    for block in blocks:
        assert parse(block.texts.full, "test") == block.config
        assert int(block.stage.initial()["phase"][0]) == Phase.IDLE
        assert block.curtain.block == block.config.block.number
    assert [block.people for block in blocks] == [("left", "right"), ("left", "right"), ("right",), ("left", "right")]
    assert [block.moved for block in blocks] == [("left", "right")] * 4
    assert [tuple(block.curtain.partners) for block in blocks] == [(), (), ("left",), ()]
    assert [block.curtain.away for block in blocks] == [(), (), ("left",), ("left",)]
    assert [block.ends for block in blocks] == [None] * 4


def test_coupling_at_both_ends_provides_the_board_ends() -> None:
    sequence = BlockSequence([parse("", "test", ("physics.coupling_at=both",))])
    assert np.shape(sequence.block.ends) == (2, 3)


def test_blocks_of_one_scene_share_the_latency_supervisor() -> None:
    sequence = BlockSequence(configs(), BlockFactory())
    first, second, third = sequence.block, sequence.next(), sequence.next()
    assert first.latency is second.latency
    assert first.latency is not third.latency


@pytest.mark.slow
def test_opening_with_a_form_rebuilds_all_blocks() -> None:
    factory = BlockFactory()
    sequence = BlockSequence(configs(), factory, 1)
    before = sequence.block
    form = replace(before.config.session, dyad="D17", consent=True, pilot=False)
    sequence.open(form)
    assert factory.sessions == [form]
    assert sequence.block.config.session == form
    assert sequence.block.config.block == before.config.block
    assert 'dyad = "D17"' in sequence.block.texts.full
    assert sequence.next().config.session == form
    assert sequence.block.latency is not None


@pytest.mark.slow
def test_invalid_block_is_refused_before_the_first_tick(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with pytest.raises(ConfigError, match=r"\[block\] unrelated: found .*other\.mcap"):
        BlockSequence([parse("", "test", ("block.force=unrelated", f"block.unrelated={path}"))])
    with pytest.raises(ConfigError, match=r"\[physics\] balls: found 2"):
        BlockSequence([*configs(), parse("", "test", ("physics.balls=2",))])
