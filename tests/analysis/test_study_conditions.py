"""Conditions of a study from the configurations of its blocks: settings that differ without a declared factor."""

from collections.abc import Iterable
from dataclasses import replace

from made_study import Block, made_study, measured, rows_of, times
from netboard.analysis.extraction.conditions import factors_text, settings_text
from netboard.analysis.extraction.recordings import BLOCKS
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import Study, study_of
from netboard.analysis.topics.groups import conditions
from netboard.base.config import Config
from netboard.base.tables.experiment import Design

TRIALS = 6


def study_with(configs: Iterable[Config]) -> Study:
    """Make a study of one block of each configuration."""
    found = []
    for number, config in enumerate(configs, start=1):
        block = measured(Block("D01", "D01", "dyadic", "full", times(*[2.0] * TRIALS)), number)
        row = {name: values[0] for name, values in block.blocks.items()}
        row |= {"factors": factors_text(config), "settings": settings_text(config)}
        found.append(replace(block, blocks=rows_of(BLOCKS, [row])))
    return study_of(found, Readings())


def with_gains(*gains: float) -> Config:
    config = Config()
    return replace(config, block=replace(config.block, trial_scales=gains))


def with_mass(mass: float) -> Config:
    config = Config()
    return replace(config, physics=replace(config.physics, m=mass))


def test_undeclared_gains_of_trials_are_conditions() -> None:
    study = study_with([with_gains(), with_gains(0.5, 1.0)])
    gains = dict.fromkeys(study.trials["condition"])
    assert list(gains) == ["dyadic, full, block.force_scale 1", "dyadic, full, block.force_scale 0.5"]
    assert list(study.trials["factor_block_force_scale_value"]) == [1.0] * TRIALS + [0.5, 1.0] * (TRIALS // 2)
    assert {one.name for one in conditions(study)} == {*gains}


def test_values_that_agree_in_six_digits_are_different_levels() -> None:
    masses = (0.05, 0.05000001, 0.06)
    study = study_with(map(with_mass, masses))
    assert study.trials.groupby("condition", sort=False)["factor_physics_m_value"].first().tolist() == [*masses]


def test_trial_factors_of_different_periods_have_all_combinations() -> None:
    levels = {"first": ("a", "b"), "second": ("x", "y", "z")}
    design = Design(trials=levels, levels=levels)
    study = study_with([replace(Config(), design=design)])
    assert study.trials["condition"].nunique() == TRIALS
    assert {one.name for one in conditions(study)} == {*study.trials["condition"]}


def test_plain_blocks_share_a_condition() -> None:
    assert [one.name for one in conditions(study_with([Config(), Config()]))] == ["dyadic, full"]
    assert len(conditions(made_study([Block("D01", "D01", "dyadic", "full", times(1.0))]))) == 1
