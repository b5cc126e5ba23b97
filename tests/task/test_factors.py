"""Factors of a block and roles of trials in a recording's configuration, including recordings of older versions."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.config import Config, parse, resolve
from netboard.base.tables.experiment import Block, Design, Session
from netboard.task.plans.counterbalance import trial_levels
from netboard.task.plans.plan import blocks_of, plan_of, to_json
from netboard.task.studies.factors import factors_of, role_of, trial_role
from netboard.task.studies.study import paper_study, parse_study

STUDIES = Path(__file__).parents[1] / "data" / "studies"
STUDY = parse_study((STUDIES / "mass_by_force.toml").read_text())


def test_declared_factors_survive_a_round_trip_through_the_configuration() -> None:
    for config in blocks_of(Config(), STUDY, 1, 1):
        assert parse(resolve(config)) == config
        assert parse(resolve(config)).design == config.design


def test_block_lists_level_value_and_unit_of_each_factor() -> None:
    practice, first, *_ = blocks_of(Config(), STUDY, 1, 1)
    assert factors_of(practice) == ()
    mass, felt, gain = factors_of(first)
    assert (mass.scope, felt.scope, gain.scope) == ("block", "block", "trial")
    assert mass.text() == "mass light (0.02 kg)"
    assert mass.value() == first.physics.m
    assert felt.of.levels == ("board", "partner")
    for trial in range(1, first.block.trials + 1):
        assert gain.value(trial) == first.block.trial_scales[trial - 1]


def test_levels_within_a_block_are_balanced_over_targets() -> None:
    for block in plan_of(STUDY, 1, 1).blocks[1:]:
        each = Counter(zip((trial.target for trial in block.trials), block.design.trials["gain"], strict=True))
        assert set(each.values()) == {2}


@settings(deadline=None)
@given(st.integers(1, 7), st.integers(1, 60), st.integers(0, 2**40))
def test_counts_of_trial_levels_differ_by_at_most_one(levels: int, trials: int, seed: int) -> None:
    drawn = trial_levels(levels, trials, seed)
    for part in (drawn, drawn[::2], drawn[1::2]):
        each = [part.count(level) for level in range(levels)]
        assert max(each) - min(each) <= 1


def test_trial_levels_are_drawn_separately_for_each_block_and_dyad() -> None:
    drawn = {block.design.trials["gain"] for dyad in (1, 2) for block in plan_of(STUDY, 1, dyad).blocks[1:]}
    assert len(drawn) > 4


def test_between_dyads_factor_has_dyad_scope() -> None:
    text = 'orders.main = "duo"\n[kinds.duo]\n[factors.age]\norder = "between"\nlevels.young = {}\nlevels.old = {}\n'
    (config,) = blocks_of(Config(), parse_study(text), 1, 2)
    (age,) = factors_of(config)
    assert (age.scope, age.level()) == ("dyad", "old")


def test_factors_of_older_recordings_are_parsed_from_the_block_label() -> None:
    config = Config(session=Session(study="masses"), block=Block(label="solo B, mass light, felt board", performer="B"))
    assert [(one.name, one.level()) for one in factors_of(config)] == [("mass", "light"), ("felt", "board")]
    assert not factors_of(replace(config, session=Session()))


def test_any_block_label_of_an_older_recording_is_parsed() -> None:
    """After the kind of block, each pair of words is a factor and its level; other text is ignored."""
    labels = {"": [], ",": [], "mass  light": [], "a, b c d, e f": [("e", "f")], "übung, x y": [("x", "y")]}
    for label, expected in labels.items():
        found = factors_of(Config(session=Session(study="s"), block=Block(label=label)))
        assert [(one.name, one.level()) for one in found] == expected


@pytest.mark.parametrize(
    ("label", "role"),
    [("practice A", "practice"), ("Training", "practice"), ("baseline, haptics on", "baseline"), ("duo", "test")],
)
def test_undeclared_role_is_derived_from_the_label(label: str, role: str) -> None:
    config = Config(block=Block(label=label, catch=(2,)))
    assert role_of(config) == role
    assert trial_role(config, 1) == role
    assert trial_role(config, 2) == "catch"


def test_declared_role_overrides_the_label() -> None:
    text = 'orders.main = "practice, duo"\n[kinds.practice]\nrole = "test"\n[kinds.duo]\nrole = "baseline"\n'
    study = parse_study(text)
    assert [role_of(config) for config in blocks_of(Config(), study, 1, 1)] == ["test", "baseline"]
    assert '"role":"baseline"' in to_json(plan_of(study, 1, 1))


def test_plan_without_declared_factors_has_no_design_key() -> None:
    """Sessions started before blocks declared their factors can still be resumed."""
    assert '"design"' not in to_json(plan_of(paper_study(), 1, 1))
    assert not Design().factors
