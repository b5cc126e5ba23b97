"""Recordings side by side on one time line. Pure.

The time line is divided where all of them have something in common: the start of the block, or the beginning of each
trial that all have. Each division is as long as the longest of them needs, and whoever is done sooner waits. Before the
first they wait for their beginning, so that they arrive at it together. Nothing is left out, and nothing is stretched.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Literal

from netboard.base.tick import TICK_SECONDS
from netboard.recording.replay.loaded import Reel

Sync = Literal["time", "trial"]
"""What recordings have in common: the start of the block, or that of each trial."""


@dataclass(frozen=True, slots=True)
class Pairing:
    """One time line for some recordings.

    Attributes
    ----------
    own : tuple of tuple of float
        For each recording where it is divided, its beginning and its end included [s].
    common : tuple of float
        The same on the common time line [s].
    """

    own: tuple[tuple[float, ...], ...]
    common: tuple[float, ...]

    @property
    def length(self) -> float:
        """Length of the common time line [s]."""
        return self.common[-1]

    @property
    def begin(self) -> float:
        """Where the first thing that they have in common begins [s]."""
        return self.common[1]

    def at(self, position: float) -> tuple[float, ...]:
        """Position in each recording."""
        part = min(max(bisect_right(self.common, position) - 1, 0), len(self.common) - 2)
        begin, end = self.common[part : part + 2]
        if part == 0:
            return tuple(max(own[1] - (end - position), 0.0) for own in self.own)
        return tuple(min(own[part] + (position - begin), _last(own, part)) for own in self.own)

    def of(self, which: int, position: float) -> float:
        """Position on the common time line of a position in one of the recordings [s]."""
        own = self.own[which]
        part = min(max(bisect_right(own, position) - 1, 0), len(own) - 2)
        if part == 0:
            return self.common[1] - (own[1] - position)
        return self.common[part] + (position - own[part])


def _last(own: Sequence[float], part: int) -> float:
    """Where to wait for the others: at the last tick of this part, not at the first of the next one [s]."""
    return own[part + 1] if part + 2 == len(own) else max(own[part + 1] - TICK_SECONDS, own[part])


def pair(reels: Sequence[Reel], sync: Sync) -> Pairing:
    """Put recordings side by side."""
    return divide([_divisions(reel, _shared(reels) if sync == "trial" else ()) for reel in reels])


def divide(own: Sequence[Sequence[float]]) -> Pairing:
    """Make the common time line.

    Parameters
    ----------
    own : sequence of sequence of float
        For each recording where it is divided, beginning and end included: at least three, rising [s].
    """
    spans = ([after - before for before, after in pairwise(divisions)] for divisions in own)
    longest = [max(parts) for parts in zip(*spans, strict=True)]
    return Pairing(tuple(map(tuple, own)), (0.0, *accumulate(longest)))


def _shared(reels: Sequence[Reel]) -> tuple[int, ...]:
    """Trials that all recordings have."""
    return tuple(number for number in reels[0].trials if all(number in reel.trials for reel in reels))


def _divisions(reel: Reel, trials: Sequence[int]) -> tuple[float, ...]:
    """Where a recording is divided: at these trials, or at the start of the block."""
    begins = [found[0] for number in trials if (found := reel.trial(number)) is not None]
    return (0.0, *(begins or [reel.begin]), reel.length)
