"""The list of the paper's open questions and the random paths through them."""

from typing import get_args

import pytest

from evidence.analysis.multiverse import EXCLUDED, random_paths
from evidence.analysis.open_questions import (
    PAIRS,
    QUESTIONS,
    Alternative,
    Family,
    question_named,
    readings_of,
)
from netboard.analysis.extraction.settings import Readings
from netboard.base.errors import ConfigError

ALTERNATIVES = [(one.name, other) for one in QUESTIONS for other in one.alternatives]


def test_every_open_question_is_listed_once() -> None:
    names = [one.name for one in QUESTIONS]
    assert names == [f"A{number}" for number in range(1, 33)] + ["B5", "E4", "E5"]


def test_every_question_has_alternatives_or_a_reason() -> None:
    for one in QUESTIONS:
        assert bool(one.alternatives) != bool(one.reason), one.name
        assert one.text
        assert one.default
        assert set(one.families) <= set(get_args(Family)), one.name
        assert one.families


@pytest.mark.parametrize(("name", "other"), ALTERNATIVES, ids=[f"{name} {other.name}" for name, other in ALTERNATIVES])
def test_alternative_differs_from_the_default(name: str, other: Alternative) -> None:
    assert readings_of(other.settings) != Readings(), name
    for setting in other.settings:
        assert readings_of((setting,)) != Readings(), setting


def test_alternatives_are_unique() -> None:
    found = [readings_of(other.settings) for _, other in ALTERNATIVES]
    assert len({repr(readings) for readings in found}) == len(found)


def test_settings_override_those_of_the_base() -> None:
    found = readings_of(("peaks.window=whole",), ("peaks.window=to_completion", "summaries.ends=5"))
    assert found.peaks.window == "whole"
    assert found.summaries.ends == 5


def test_unknown_setting_is_refused() -> None:
    with pytest.raises(ConfigError, match="peaks"):
        readings_of(("peaks.windows=whole",))


def test_paired_questions_affect_the_same_numbers() -> None:
    for one, other in PAIRS:
        assert set(question_named(one).families) & set(question_named(other).families)
        assert question_named(one).alternatives
        assert question_named(other).alternatives


def test_unknown_question_is_refused() -> None:
    with pytest.raises(KeyError, match="A33"):
        question_named("A33")


@pytest.mark.slow
def test_random_paths_cover_likely_answers_and_depend_only_on_the_seed() -> None:
    paths = random_paths((), 10, 10, 4)
    assert paths == random_paths((), 10, 10, 4)
    assert paths != random_paths((), 10, 10, 4, seed=2)
    assert len(paths.measured) == len(paths.summaries) == 100
    assert len({repr(one.filters) for one in paths.measured}) <= 10
    for one, variants in zip(paths.measured, paths.summaries, strict=True):
        assert all((way.filters, way.delays, way.peaks) == (one.filters, one.delays, one.peaks) for way in variants)
    seen = {setting for one in (*paths.measured, *sum(paths.summaries, ())) for setting in _settings(one)}
    for one in QUESTIONS:
        for other in one.alternatives:
            expected = other.likely and one.name not in EXCLUDED
            assert all(setting in seen for setting in other.settings) == expected, (one.name, other.name)


def _settings(readings: Readings) -> set[str]:
    """List all settings as given to --set."""
    tables = ("filters", "completion", "movements", "segments", "delays", "peaks", "strategy", "summaries")
    return {
        f"{table}.{name}={getattr(getattr(readings, table), name)}"
        for table in tables
        for name in getattr(readings, table).__dataclass_fields__
    }


def test_number_of_paths_is_the_product_of_the_numbers_of_answers() -> None:
    answers = [1 + sum(other.likely for other in one.alternatives) for one in QUESTIONS if one.name not in EXCLUDED]
    product = 1
    for count in answers:
        product *= count
    assert random_paths((), 1, 1, 1).count == product
