"""Results of weights beside held-out participants, in words and as a card has them."""

import json

import pytest

from netboard.participants.seat.block import BlockSummary
from netboard.training.evaluation import evaluation_of

PAIR = BlockSummary((2.0, 4.0), 1, 9000, given_up=False)
NOTHING_DONE = BlockSummary((), 2, 60_000, given_up=True)


def test_mean_is_that_of_the_completed_trials() -> None:
    found = evaluation_of(1, [BlockSummary((3.0, 25.0), 0, 28_000, given_up=False), NOTHING_DONE], [PAIR])
    assert (found.trials, found.failures, found.longest_seconds) == (5, 2, 25.0)
    assert found.finished == pytest.approx(0.2)
    assert found.lines()[1:] == (
        "mean completion time 14.00 s, longest 25.00 s",
        "pairs of the same participants: 66.7% of 3 trials, mean completion time 3.00 s",
    )


def test_no_mean_is_made_of_no_completed_trial() -> None:
    """A mean that is not a number would be no JSON, and no other program could read the card."""
    found = evaluation_of(1, [NOTHING_DONE], [NOTHING_DONE])
    assert found.lines() == (
        "0.0% of 3 trials beside 1 held-out participants were finished within 20 s; 2 falls",
        "no trial was completed",
        "pairs of the same participants: 0.0% of 3 trials, no trial was completed",
    )
    card = json.dumps(found.as_dict(), allow_nan=False)
    assert json.loads(card)["seconds"] is None
