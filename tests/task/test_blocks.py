"""The study determines the blocks of a dyad; a shortened run has fewer blocks and trials."""

from dataclasses import replace

from netboard.base.config import Config
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study


def test_blocks_are_those_of_the_dyads_plan() -> None:
    blocks = blocks_of(Config(), paper_study(), 1, 3)
    assert [block.block.number for block in blocks] == list(range(1, 19))
    assert {block.session.dyad for block in blocks} == {"D03"}
    assert {block.session.study for block in blocks} == {"paper"}
    assert len({block.block.seed for block in blocks}) == 18


def test_shortened_plan_has_fewer_blocks_and_trials() -> None:
    plan = blocks_of(Config(), paper_study(), 1, 1)
    plan[1] = replace(plan[1], block=replace(plan[1].block, catch=(1, 9)))
    short = list(shortened(plan, 2, 5))
    assert [config.block.trials for config in short] == [5, 5]
    assert [config.block.blocks for config in short] == [2, 2]
    assert short[1].block.catch == (1,)
    assert [config.block.trials for config in shortened(plan, 1, None)] == [plan[0].block.trials]
    assert next(shortened(plan, None, 1000)).block.trials == plan[0].block.trials
