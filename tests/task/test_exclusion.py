"""The rule by which attempts do not count, and the lost trials that follow from it."""

from itertools import chain, combinations
from math import nan

import pytest

from netboard.base.config import parse
from netboard.base.tables.experiment import TECHNICAL
from netboard.task.journal.lost import losses
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import USUAL_RULE, ExclusionRule, is_simulated, rule_of
from netboard.task.trials.quality import FLAG_WORDS, FLAGS


def attempt(trial: int, outcome: str = "success", flags: str = "", repeats: int = 0) -> AttemptOutcome:
    return AttemptOutcome(1, trial, 1, outcome, 2.0 if outcome == "success" else nan, flags, repeats)


def test_every_flag_has_words_and_all_but_a_long_duration_exclude() -> None:
    assert list(FLAG_WORDS) == list(FLAGS)
    assert set(FLAGS) - set(TECHNICAL) == {"too_long"}
    assert parse("").quality.exclude == TECHNICAL


@pytest.mark.parametrize(
    ("outcome", "flags", "said"),
    [
        ("success", (), ""),
        ("fell", (), ""),
        ("success", ("too_long",), ""),
        ("success", ("late_ticks", "too_long"), "excluded: deadline misses"),
        ("fell", ("clipped", "frozen_display"), "excluded: force at its limit, frozen display"),
        ("emergency_stop", (), "excluded"),
        ("aborted", ("late_ticks",), "excluded"),
    ],
)
def test_consequence_names_why_an_attempt_will_be_excluded(outcome: str, flags: tuple[str, ...], said: str) -> None:
    assert USUAL_RULE.consequence(outcome, flags) == said


def test_rule_follows_the_settings_and_spares_the_still_hands_of_simulated_participants() -> None:
    declared = parse('[quality]\nexclude = ["too_long"]')
    assert rule_of(declared).reasons(FLAGS) == ("too long",)
    assert rule_of(parse("")).simulated
    assert rule_of(parse("")).reasons(("stuck_left", "late_ticks")) == ("deadline misses",)
    real = parse('[agents.left]\ndevice = "openhaptics"')
    assert rule_of(real).reasons(("stuck_left",)) == ("left stylus stuck",)
    assert not rule_of(parse(""), {"imported": "measured"}).simulated
    assert is_simulated(real, {"rehearsed": "true"}, ("left", "right"))


def test_lost_trials_are_successes_with_an_excluding_flag() -> None:
    outcomes = [
        attempt(1, flags="late_ticks"),
        attempt(2, "fell", "late_ticks"),
        attempt(2),
        attempt(3, flags="late_ticks,clipped"),
        attempt(4, flags="too_long"),
    ]
    found = losses(outcomes, USUAL_RULE)
    assert found.trials == (1, 3)
    assert found.text == "2 of 4 trials will be excluded: deadline misses, force at its limit"
    assert found.without((3,)).trials == (1,)
    assert found.without((1, 3)).text == ""


def test_no_trial_is_lost_without_excluding_flags() -> None:
    rule = ExclusionRule((), simulated=False)
    for flags in chain.from_iterable(combinations(FLAGS, size) for size in (1, 2)):
        assert losses([attempt(1, flags=",".join(flags))], rule).text == ""
