"""Warnings of levels of a factor that set different keys."""

import pytest

from netboard.base.config import Config, parse
from netboard.task.studies import library
from netboard.task.studies.level_keys import warnings_of
from netboard.task.studies.study import parse_study

STUDY = """
[orders]
main = "2 dyadic"
[kinds.dyadic]
[factors.mass.levels.light]
{light}
[factors.mass.levels.heavy]
{heavy}
"""


def found(light: str, heavy: str, more: str = "", *, config: Config | None = None) -> tuple[str, ...]:
    study = parse_study(more + STUDY.format(light=light, heavy=heavy))
    return warnings_of(study, config or Config())


def test_levels_that_set_different_keys_are_named_with_both_keys_and_what_stays() -> None:
    (warning,) = found("physics.m = 0.02", "physics.M = 0.06")
    assert warning.startswith("[factors.mass] levels: light sets physics.m, heavy sets physics.M")
    assert "at light physics.M stays 0.01 kg" in warning
    assert "at heavy physics.m stays 0.05 kg" in warning


def test_value_that_stays_is_that_of_the_rig_the_study_or_the_kind() -> None:
    rig = parse("[physics]\nm = 0.07\n", "rig")
    assert "at heavy physics.m stays 0.07 kg" in found("physics.m = 0.02", "physics.M = 0.06", config=rig)[0]
    of_study = found("physics.m = 0.02", "physics.M = 0.06", "physics.m = 0.08\n", config=rig)
    assert "at heavy physics.m stays 0.08 kg" in of_study[0]
    text = STUDY.format(light="physics.m = 0.02", heavy="physics.M = 0.06")
    both = text.replace("[kinds.dyadic]", '[kinds.alone]\nperformers = "A"\nphysics.m = 0.09\n[kinds.dyadic]')
    (of_kinds,) = warnings_of(parse_study(both), Config())
    assert "at heavy physics.m stays 0.09 kg (alone), 0.05 kg (dyadic)" in of_kinds


@pytest.mark.parametrize(
    ("light", "heavy"),
    [
        ("physics.m = 0.02", "physics.m = 0.06"),
        ("", "physics.m = 0.06"),
        ("physics.m = 0.02", "physics.m = 0.06\nphysics.M = 0.02"),
    ],
)
def test_levels_that_leave_keys_at_the_default_are_no_mistake(light: str, heavy: str) -> None:
    assert found(light, heavy) == ()


@pytest.mark.parametrize("name", library.NAMES)
def test_built_in_studies_have_no_warnings(name: str) -> None:
    assert warnings_of(parse_study(library.text_of(name), name), Config()) == ()
