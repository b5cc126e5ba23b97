"""The blocks of a session, prepared before its first tick."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.nodes.server.blocks import BlockSequence
from netboard.task.trials.state_machine import Phase

BLOCKS = (
    ("block.force=full",),
    ("block.force=none", "block.rest=30", "block.trials=7"),
    ("block.left=robot", "physics.M=0.02"),
    ("block.configuration=bimanual", "block.station=right"),
)


def configs(session: Session | None = None) -> list[Config]:
    made = []
    for number, settings in enumerate(BLOCKS, start=1):
        config = parse("", "test", ("session.pilot=true", f"block.blocks={len(BLOCKS)}", *settings))
        config = replace(config, block=replace(config.block, number=number))
        made.append(replace(config, session=session or config.session))
    return made


class Remade:
    """Makes the blocks anew, and remembers for whom."""

    def __init__(self) -> None:
        self.asked: list[Session] = []

    def __call__(self, session: Session) -> Sequence[Config]:
        self.asked.append(session)
        return configs(session)


def test_the_blocks_come_one_after_the_other() -> None:
    sequence = BlockSequence(configs(), Remade())
    assert sequence.planned
    seen = []
    while True:
        seen.append((sequence.block.config.block.number, sequence.last))
        if sequence.last:
            break
        assert sequence.next() is sequence.block
    assert seen == [(1, False), (2, False), (3, False), (4, True)]


def test_a_session_that_is_resumed_begins_in_its_middle() -> None:
    sequence = BlockSequence(configs(), Remade(), 2)
    assert sequence.block.config.block.number == 3
    assert sequence.next().config.block.number == 4
    assert sequence.last


def test_a_single_block_is_no_plan() -> None:
    sequence = BlockSequence(configs()[:1])
    assert not sequence.planned
    assert sequence.last


def test_each_block_is_ready_to_begin() -> None:
    sequence = BlockSequence(configs(), Remade())
    blocks = [sequence.block, *(sequence.next() for _ in range(3))]
    for block in blocks:
        assert parse(block.text, "test") == block.config
        assert int(block.stage.initial()["phase"][0]) == Phase.IDLE
        assert block.curtain.block == block.config.block.number
    assert [block.people for block in blocks] == [("left", "right"), ("left", "right"), ("right",), ("left", "right")]
    assert [[robot.side for robot in block.robots] for block in blocks] == [[], [], ["left"], []]
    assert [block.curtain.away for block in blocks] == [(), (), ("left",), ("left",)]
    assert [block.ends for block in blocks] == [None] * 4


def test_agents_that_compute_their_own_forces_are_told_what_they_need() -> None:
    sequence = BlockSequence([parse("", "test", ("physics.coupling_at=both",))])
    assert np.shape(sequence.block.ends) == (2, 3)


def test_blocks_of_one_scene_share_the_watch_over_its_loops() -> None:
    sequence = BlockSequence(configs(), Remade())
    first, second, third = sequence.block, sequence.next(), sequence.next()
    assert first.delays is second.delays
    assert first.delays is not third.delays


@pytest.mark.slow
def test_a_form_makes_all_blocks_those_of_its_session() -> None:
    remade = Remade()
    sequence = BlockSequence(configs(), remade, 1)
    before = sequence.block
    form = replace(before.config.session, dyad="D17", consent=True, pilot=False)
    sequence.open(form)
    assert remade.asked == [form]
    assert sequence.block.config.session == form
    assert sequence.block.config.block == before.config.block
    assert 'dyad = "D17"' in sequence.block.text
    assert sequence.next().config.session == form
    assert sequence.block.delays is not None


@pytest.mark.slow
def test_a_block_that_cannot_be_is_refused_before_the_first_tick(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with pytest.raises(ConfigError, match=r"\[block\] unrelated: found .*other\.mcap"):
        BlockSequence([parse("", "test", ("block.force=unrelated", f"block.unrelated={path}"))])
    with pytest.raises(ConfigError, match=r"\[physics\] balls: found 2"):
        BlockSequence([*configs(), parse("", "test", ("physics.balls=2",))])
