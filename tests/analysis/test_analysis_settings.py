"""Settings are named, checked and complete, and change only the measures that depend on them."""

import inspect
from dataclasses import fields, replace

import pytest

from netboard.analysis.extraction.settings import Exclusions, Readings, Summaries, measured_with, parse, resolve
from netboard.analysis.measures.cooperation import contributions, delays
from netboard.base.errors import ConfigError
from netboard.base.settings import tables
from netboard.task.trials.quality import FLAGS


def test_delays_have_the_same_defaults_in_the_settings_and_in_the_measures() -> None:
    settings = Readings().delays
    defaults = [inspect.signature(function).parameters for function in (delays, contributions)]
    shared = [(name, one[name].default) for one in defaults for name in one if hasattr(settings, name)]
    assert {"search", "threshold", "velocity", "opposite", "amount"} <= {name for name, _ in shared}
    assert [getattr(settings, name) for name, _ in shared] == [default for _, default in shared]


def test_exclusions_accept_every_quality_flag() -> None:
    for word in FLAGS:
        assert parse("", overrides=[f'exclusions.flags=["{word}"]']).exclusions.flags == (word,)


def test_default_settings_survive_a_round_trip() -> None:
    assert parse(resolve(Readings())) == Readings()


def test_every_choice_of_every_setting_survives_a_round_trip() -> None:
    seen = 0
    for table in tables(Readings):
        for key in table.keys:
            if key.kind.startswith('"'):
                for choice in key.kind.split(" or "):
                    found = parse("", overrides=[f"{'.'.join(table.path)}.{key.name}={choice}"])
                    assert parse(resolve(found)) == found
                    seen += 1
    assert seen > 40


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("peaks.window=sometimes", '"to_completion" or "whole"'),
        ("filters.fast=-1", "> 0"),
        ('exclusions.flags=["bored"]', '"late_ticks", "lost_samples"'),
        ("peaks.height=1", "unknown"),
    ],
)
def test_invalid_setting_error_states_the_expected_values(word: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse("", overrides=[word])


def test_summaries_and_exclusions_do_not_change_the_measurement_settings() -> None:
    base = measured_with(Readings())
    assert measured_with(replace(Readings(), summaries=Summaries(level="median"))) == base
    assert measured_with(replace(Readings(), exclusions=Exclusions(warm_up=5))) == base
    assert measured_with(parse("", overrides=["filters.slow=6"])) != base
    assert {f.name for f in fields(Readings)} >= {"summaries", "exclusions"}
