"""Codes of triggers: defaults, what a configuration declares in their place, and what it may not declare."""

import pytest

from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.base.tables.triggers import EVENTS, TRIAL_EVENTS, Triggers, code_of, codes_of


def test_every_event_of_a_trial_has_a_code_of_its_own_by_default() -> None:
    codes = codes_of(Triggers())
    found = {event: code_of(codes, event, {}) for event in EVENTS}
    assert {event: code for event, code in found.items() if code} == TRIAL_EVENTS
    assert len({*TRIAL_EVENTS.values()}) == len(TRIAL_EVENTS)
    assert code_of(codes, "agent_joined", {}) == 0


def test_declared_codes_replace_the_defaults_and_0_removes_one() -> None:
    codes = codes_of(Triggers(codes={"held": 40, "left": 0, "block_began": 99}))
    assert [code_of(codes, event, {}) for event in ("held", "left", "block_began", "fell")] == [40, 0, 99, 5]


@pytest.mark.parametrize(
    ("details", "code"),
    [
        ({"factor_mass": "heavy (0.05 kg)"}, 21),
        ({"factor_mass": "heavy"}, 21),
        ({"factor_mass": "heavyweight"}, 1),
        ({"factor_mass": "light (0.02 kg)", "role": "catch"}, 22),
        ({}, 1),
    ],
)
def test_code_of_a_level_of_a_factor_goes_before_that_of_the_event(details: dict[str, str], code: int) -> None:
    codes = codes_of(Triggers(codes={"level mass=heavy": 21, "level role=catch": 22}))
    assert code_of(codes, "level", details) == code


@pytest.mark.parametrize(
    ("codes", "words"),
    [
        ("held = 256", '"held": found 256, expected a code from 1 to 255'),
        ("held = -1", "found -1"),
        ('"held" = "4"', "expected a whole number"),
        ("helt = 4", "no event has this name; .* did you mean held"),
        ('"level haptics" = 4', "an event with one of its details"),
    ],
)
def test_impossible_code_is_refused(codes: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        parse(f"[triggers.codes]\n{codes}")
