"""Judges the quality of recorded attempts as the server did, by the rules in the configuration, and which are lost.

The ticks go to the referee in batches, each followed by its frames, as on a live server.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from math import nan
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.safeguards import Safeguard
from netboard.recording.files.reader import Recording
from netboard.task.journal.lost import Losses, losses
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import rule_of
from netboard.task.trials.quality import FIELDS_NEEDED, Referee, Verdict

_PORTION = 100
"""Ticks per batch: fewer than the delay after which the server knows every frame [1]."""


def judged(recording: Recording) -> tuple[Verdict, ...]:
    """Judge every completed attempt in a recording."""
    return judged_along(recording, recording.portions(FIELDS_NEEDED))


def judged_along(recording: Recording, portions: Iterable[Mapping[str, NDArray[Any]]]) -> tuple[Verdict, ...]:
    """Judge every completed attempt while the ticks are read for another purpose.

    ``portions``: columns of all ticks in order, at least `netboard.task.trials.quality.FIELDS_NEEDED`.
    """
    judge = Judge(recording, recording.config)
    for columns in portions:
        judge.take_columns(columns)
    return tuple(judge.verdicts)


class Judge:
    """Judges the attempts of a recording while its ticks are read; ``verdicts`` has those that have ended."""

    def __init__(self, recording: Recording, config: Config) -> None:
        self.verdicts: list[Verdict] = []
        self._referee = Referee(config, Safeguard.CLAMPED)
        self._frames = deque(sorted(recording.frames(), key=attrgetter("tick")))

    def take(self, rows: NDArray[Any]) -> None:
        """Take the next ticks."""
        self._take(partial(self._referee.watch, rows), rows["tick"])

    def take_columns(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Take the columns of the next ticks."""
        self._take(partial(self._referee.watch_columns, columns), columns["tick"])

    def _take(self, watch: Callable[[int, int], list[Verdict]], ticks: NDArray[np.int64]) -> None:
        first = 0
        while first < ticks.size:
            count = min(_PORTION if self._frames else ticks.size, ticks.size - first)
            self.verdicts += watch(first, count)
            newest = ticks[first + count - 1]
            while self._frames and self._frames[0].tick <= newest:
                frame = self._frames.popleft()
                self._referee.paint(frame.station, frame.tick, frame.painted_ns)
            first += count


def losses_among(verdicts: Iterable[Verdict], config: Config, metadata: Mapping[str, str]) -> Losses:
    """Return the trials that the analysis will exclude, of a recording with these metadata."""
    attempts = (
        AttemptOutcome(0, one.trial, one.attempt, one.outcome, one.completion, ",".join(one.flags), 0)
        for one in verdicts
    )
    return losses(attempts, rule_of(config, metadata))


def losses_stated(recording: Recording) -> Losses:
    """Return the trials that the analysis will exclude, by the flags that the server has recorded in its events."""
    ended = (event.details for event in recording.events() if event.name == "attempt_ended")
    attempts = (
        AttemptOutcome(0, int(of["trial"]), int(of["attempt"]), of["outcome"], nan, of.get("flags", ""), 0)
        for of in ended
    )
    return losses(attempts, rule_of(recording.config, recording.metadata))
