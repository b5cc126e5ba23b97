"""What a block waits for is one phrase, in which the same thing at both sides appears once."""

import pytest

from netboard.nodes.ports.waiting import in_words


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ((), ""),
        (("the logger",), "the logger"),
        (("the left agent", "the right agent"), "both agents"),
        (
            ("the left device to be armed", "the right device to be armed", "the logger"),
            "both devices to be armed and the logger",
        ),
        (
            ("the left agent", "the right device to be armed", "the logger"),
            "the left agent, the right device to be armed and the logger",
        ),
    ],
)
def test_missing_things_are_one_phrase(missing: tuple[str, ...], said: str) -> None:
    assert in_words(missing) == said
