"""Parsing of the block order in a study file."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.task.studies.order import MOST, steps_of


def expanded(text: str) -> str:
    """Return the parsed order with all repetitions written out."""
    sessions = steps_of(text)
    return " | ".join(" ".join(("/" if step.rested else "") + step.kind for step in steps) for steps in sessions)


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        ("solo", "solo"),
        ("4 solo, 2 dyadic", "solo solo solo solo dyadic dyadic"),
        ("2(a b)", "a b a b"),
        ("2 (a, 2 (b c)) a", "a b c b c a b c b c a"),
        ("a / b | c", "a /b | c"),
        ("2 (a /) b", "a /a /b"),
        ("a / | b /", "a | b"),
        ("2 a-b_3", "a-b_3 a-b_3"),
    ],
)
def test_order_expands_repetitions_brackets_rests_and_sessions(text: str, steps: str) -> None:
    assert expanded(text) == steps


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "a session without blocks"),
        ("a | | b", "a session without blocks"),
        ("(a", "is not closed"),
        ("a)", "was not opened"),
        ("4", "nothing after the number 4"),
        ("4, a", "found , after the number 4"),
        ("2 3 a", "found 3 after the number 2"),
        ("0 a", "the number 0, expected 1 to 1000"),
        ("a; b", 'found "; b"'),
        ("99 (99 a)", "more than 1000 blocks"),
        ("1000 (1000 (1000 (1000 a)))", "more than 1000 blocks"),
    ],
)
def test_syntax_errors_are_reported(text: str, problem: str) -> None:
    with pytest.raises(ConfigError) as raised:
        steps_of(text)
    assert problem in str(raised.value)


@pytest.mark.slow
@settings(deadline=None)
@given(st.text() | st.text(alphabet="ab 12(),/|"))
@example("(" * 100_000)
@example("9" * 100_000)
def test_any_text_parses_or_raises_config_error(text: str) -> None:
    try:
        sessions = steps_of(text)
    except ConfigError:
        return
    assert 1 <= sum(map(len, sessions)) <= MOST
