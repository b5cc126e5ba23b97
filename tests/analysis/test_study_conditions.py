"""Conditions of a study from the configurations of its blocks: settings that differ without a declared factor."""

from collections.abc import Iterable
from dataclasses import replace

from made_study import Block, made_study, measured, rows_of, times
from netboard.analysis.extraction.conditions import factor_read, factors_text, settings_text
from netboard.analysis.extraction.recordings import BLOCKS
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.topics.contrasts import questions_of
from netboard.analysis.topics.groups import conditions
from netboard.base.config import Config
from netboard.base.tables.experiment import Design
from netboard.base.tables.forces import Force

TRIALS = 6


def study_with(configs: Iterable[Config]) -> StudyData:
    """Make a study of one block of each configuration."""
    found = []
    for number, config in enumerate(configs, start=1):
        block = measured(Block("D01", "D01", "dyadic", config.block.force, times(*[2.0] * TRIALS)), number)
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


def with_lag(lag: str, force: Force, *between: str, **others: str) -> Config:
    config = Config()
    every = {"lag": ("off", "still", "direct", "late"), "mass": ("light", "heavy")}
    design = Design(factors={"lag": lag, **others}, levels=every, between=between)
    return replace(config, design=design, block=replace(config.block, force=force))


def asked(*configs: Config) -> list[str]:
    return [one.name for one in questions_of(study_with(configs))]


def test_levels_that_differ_in_force_are_compared_with_the_level_without_it() -> None:
    assert asked(with_lag("off", "none"), with_lag("direct", "full"), with_lag("late", "full")) == [
        "dyadic, lag direct, haptics on vs off",
        "dyadic, lag late, haptics on vs off",
        "lag late vs direct, dyadic, haptics on",
    ]


def test_force_is_not_compared_with_another_mass() -> None:
    late = (with_lag("late", "full", mass=mass) for mass in ("light", "heavy"))
    found = asked(with_lag("off", "none", mass="heavy"), with_lag("direct", "full", mass="heavy"), *late)
    assert [name for name in found if name.endswith("vs off")] == [
        "dyadic, lag direct, mass heavy, haptics on vs off",
        "dyadic, lag late, mass heavy, haptics on vs off",
    ]


def test_force_is_not_compared_if_two_levels_have_none() -> None:
    assert asked(*(with_lag(lag, "none") for lag in ("off", "still")), with_lag("late", "full")) == [
        "lag still vs off, dyadic, haptics off"
    ]


def test_force_is_not_compared_between_dyads() -> None:
    assert asked(with_lag("off", "none", "lag"), *(with_lag(lag, "full", "lag") for lag in ("direct", "late"))) == [
        "lag late vs direct, dyadic, haptics on"
    ]


def test_undeclared_gains_of_trials_are_conditions() -> None:
    study = study_with([with_gains(), with_gains(0.5, 1.0)])
    gains = dict.fromkeys(study.trials["condition"])
    assert list(gains) == ["dyadic, haptics on, block.force_scale 1", "dyadic, haptics on, block.force_scale 0.5"]
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
    assert [one.name for one in conditions(study_with([Config(), Config()]))] == ["dyadic, haptics on"]
    assert len(conditions(made_study([Block("D01", "D01", "dyadic", "full", times(1.0))]))) == 1


def test_factors_of_cohorts_of_earlier_versions_are_read() -> None:
    of = {"type": "categorical", "levels": ["a", "b"], "values": [], "unit": "1"}
    read = factor_read({"name": "mass", "scope": "block", "of": of, "told": True})
    assert (read.name, read.of.levels, read.in_names) == ("mass", ("a", "b"), True)
