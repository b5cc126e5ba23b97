"""Counts with their nouns."""

import pytest

from netboard.base.plural import plural


@pytest.mark.parametrize(
    ("count", "words", "text"),
    [
        (0, ("session",), "0 sessions"),
        (1, ("session",), "1 session"),
        (2, ("person",), "2 people"),
        (1, ("tick is", "ticks are"), "1 tick is"),
        (3, ("tick is", "ticks are"), "3 ticks are"),
    ],
)
def test_noun_and_verb_follow_the_count(count: int, words: tuple[str, ...], text: str) -> None:
    assert plural(count, *words) == text
