"""Alignment of several recordings on one time line. Pure.

The time line is divided at common points: the start of the block, or the start of each trial that all recordings have.
Each section is as long as the longest recording needs, and the others wait at its end. In the first section the shorter
ones wait at their beginning, so that all reach the first common point together. Nothing is left out, and nothing is
stretched.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Literal

from netboard.base.tick import TICK_SECONDS
from netboard.recording.replay.loaded import LoadedRecording

Sync = Literal["time", "trial"]
"""Common points: the start of the block, or of each trial."""


@dataclass(frozen=True, slots=True)
class Pairing:
    """One time line for several recordings."""

    points: tuple[tuple[float, ...], ...]  # common points of each recording, with its start and end [s]
    common: tuple[float, ...]  # the same points on the common time line [s]

    @property
    def length(self) -> float:
        """Length of the common time line [s]."""
        return self.common[-1]

    @property
    def begin(self) -> float:
        """Position of the first common point [s]."""
        return self.common[1]

    def at(self, position: float) -> tuple[float, ...]:
        """Return the position in each recording [s]."""
        part = min(max(bisect_right(self.common, position) - 1, 0), len(self.common) - 2)
        begin, end = self.common[part : part + 2]
        if part == 0:
            return tuple(max(points[1] - (end - position), 0.0) for points in self.points)
        return tuple(min(points[part] + (position - begin), _last(points, part)) for points in self.points)

    def of(self, which: int, position: float) -> float:
        """Return the common position for a position in one recording [s]."""
        points = self.points[which]
        part = min(max(bisect_right(points, position) - 1, 0), len(points) - 2)
        if part == 0:
            return self.common[1] - (points[1] - position)
        return self.common[part] + (position - points[part])


def _last(points: Sequence[float], part: int) -> float:
    """Return where to wait for the others: at the last tick of this section, not at the first of the next [s]."""
    return points[part + 1] if part + 2 == len(points) else max(points[part + 1] - TICK_SECONDS, points[part])


def pair(recordings: Sequence[LoadedRecording], sync: Sync) -> Pairing:
    """Align recordings."""
    trials: list[int] = []
    if sync == "trial":
        trials = [number for number in recordings[0].trials if all(number in other.trials for other in recordings)]
    return divide([_divisions(recording, trials) for recording in recordings])


def divide(points: Sequence[Sequence[float]]) -> Pairing:
    """Compute the common time line.

    ``points``: common points of each recording, with its start and end: at least three, increasing [s].
    """
    spans = ([after - before for before, after in pairwise(divisions)] for divisions in points)
    longest = [max(parts) for parts in zip(*spans, strict=True)]
    return Pairing(tuple(map(tuple, points)), (0.0, *accumulate(longest)))


def _divisions(recording: LoadedRecording, trials: Sequence[int]) -> tuple[float, ...]:
    """Return the common points of a recording: the starts of these trials, or that of the block."""
    begins = [found[0] for number in trials if (found := recording.trial(number)) is not None]
    return (0.0, *(begins or [recording.begin]), recording.length)
