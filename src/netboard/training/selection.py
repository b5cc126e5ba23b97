"""Which round of a training is kept: the one that plays fastest beside participants that it learned with.

A network may get slower, or unstable with late views, from one round to the next. The learning curve does not show it:
it is of episodes with noise on the actions, and of a board that need not be level. So each round plays blocks of the
real task by the strict kernel, as in the evaluation. Participants that are held out have no part in the choice.
"""

from collections.abc import Sequence
from math import isnan, nan
from pathlib import Path
from typing import NamedTuple

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.robots.learned import Learned
from netboard.participants.robots.robot import UnstableError
from netboard.training.evaluation import beside, mean_with_misses, seated

PLAYED_WITH, TRIALS = 8, 5
"""Participants with whom each round plays, and trials beside each at each side [1]."""


class RoundPlayed(NamedTuple):
    """How a round's network plays.

    ``stable_ms``: largest latency of views with which it is stable in the linearisation [ms].
    ``played_seconds``: mean completion time, in which an attempt that is not completed in time counts as long as
    `netboard.training.evaluation.LONGEST`; NaN if the network may not play, as it is not stable enough [s].
    """

    stable_ms: int
    played_seconds: float

    def __str__(self) -> str:
        """Return it in words."""
        if isnan(self.played_seconds):
            return f"not stable with late views, only up to {self.stable_ms} ms"
        return f"{self.played_seconds:.2f} s a trial"


def play_round(weights: Path, people: Sequence[Participant], config: Config) -> RoundPlayed:
    """Let a round's network play beside some participants."""
    there = seated(config, "right", weights, TRIALS, 1)
    try:
        stable_ms = Learned(there, "right").stable_view_latency_ms(there)
    except UnstableError as error:
        return RoundPlayed(error.limit_ms, nan)
    return RoundPlayed(stable_ms, mean_with_misses(list(beside(weights, people, config, TRIALS))))


def best_round(rounds: Sequence[RoundPlayed]) -> int:
    """Return the number of the round to keep, from 1.

    Raises
    ------
    ConfigError
        If the network of no round is stable enough to play.
    """
    able = [number for number, one in enumerate(rounds, 1) if not isnan(one.played_seconds)]
    if not able:
        latencies = ", ".join(str(one.stable_ms) for one in rounds)
        raise ConfigError(
            f"the network of no round steers stably with late views: they do up to {latencies} ms; "
            "expected another seed, or a larger --rounds"
        )
    return min(able, key=lambda number: rounds[number - 1].played_seconds)
